"""Meaning of a mission: each of its items is flown, told, or refused with its number."""

from __future__ import annotations

import contextlib
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.ual.routes.missions import ARDUPILOT, PX4, do, item, plan, waypoint
from ual import routes
from ual.routes import Route, RouteError
from ual.types import AltitudeReference, GeoWaypoint

DATA = Path(__file__).parents[2] / "data" / "routes"
HOME, AMSL = AltitudeReference.HOME, AltitudeReference.AMSL
A, B, C = (waypoint(47.1, 8.1), waypoint(47.2, 8.2), waypoint(47.3, 8.3))
NORTH, EAST = math.pi / 2, 0.0


def executed(*items: dict[str, Any], firmware: int | None = PX4) -> Route:
    return routes.parse_plan(plan(*items, firmware=firmware), "m.plan")


def latitudes(route: Route) -> list[float]:
    return [each.latitude_deg for each in route.waypoints if isinstance(each, GeoWaypoint)]


def yaws(route: Route) -> list[float | None]:
    return [each.yaw_rad for each in route.waypoints if isinstance(each, GeoWaypoint)]


# --- Waypoints --------------------------------------------------------------------------------------------------------


def test_a_plan_gives_its_waypoints_with_altitudes_headings_and_speeds() -> None:
    route = executed(
        item(22, [0, 0, 0, None, 47.1, 8.1, 10]),
        waypoint(47.1, 8.1, 20, yaw=0.0),
        do(178, 1, 4.5, -1),
        waypoint(47.2, 8.2, 500, yaw=90.0, frame=0),
        do(2000, 0, 0, 1),
        waypoint(47.3, 8.3, 30, hold=3.0),
        waypoint(47.4, 8.4, 30),
        do(20),
    )
    assert route.waypoints == [
        GeoWaypoint(47.1, 8.1, 20.0, HOME, NORTH),
        GeoWaypoint(47.2, 8.2, 500.0, AMSL, EAST),
        GeoWaypoint(47.3, 8.3, 30.0, HOME),
        GeoWaypoint(47.4, 8.4, 30.0, HOME),
    ]
    assert route.leg_speeds_m_s == [0.0, 4.5, 4.5, 4.5]
    assert route.holds_s == [0.0, 0.0, 3.0, 0.0]
    assert route.left_out == ["item 1: take-off", "item 5: camera and gimbal", "item 8: return to launch"]


@pytest.mark.parametrize(
    ("firmware", "yaw_deg", "yaw_rad"),
    [
        (PX4, 0.0, NORTH),
        (PX4, None, None),
        (PX4, 720.0, NORTH),
        (PX4, -450.0, math.pi),
        (None, 0.0, NORTH),
        (ARDUPILOT, 0.0, None),
        (ARDUPILOT, 90.0, None),
    ],
)
def test_the_firmware_of_a_plan_says_what_its_heading_means(
    firmware: int | None, yaw_deg: float | None, yaw_rad: float | None
) -> None:
    route = executed(waypoint(yaw=yaw_deg), firmware=firmware)
    assert yaws(route) == [pytest.approx(yaw_rad)]
    ignored = ["item 1: the heading (parameter 4), which ArduPilot ignores"]
    assert route.left_out == (ignored if firmware == ARDUPILOT and yaw_deg else [])


def test_a_waypoint_twice_is_one_with_both_holds() -> None:
    route = executed(waypoint(hold=2.0), waypoint(hold=3.0), waypoint(yaw=90.0), B)
    assert yaws(route) == [None, EAST, None]
    assert route.holds_s == [5.0, 0.0, 0.0]
    assert len(routes.read(DATA / "dup.plan").waypoints) == 3


def test_the_radius_within_which_an_autopilot_passes_is_reported() -> None:
    route = executed(item(16, [0, 5, 0, None, 47.1, 8.1, 20]), item(16, [0, 0, 2, None, 47.2, 8.2, 20]))
    assert route.left_out == [
        "items 1 and 2: the radius within which it is passed (the corner radius says how corners are flown)"
    ]


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (waypoint(None, None), "item 2: it has no position"),
        (waypoint(47.0, None), "item 2: it has no position"),
        (waypoint(0, 0), "item 2: latitude 0, longitude 0 is a position that was not set"),
        (waypoint(0, 0, frame=0), "item 2: latitude 0, longitude 0"),
        (waypoint(alt=None), "item 2: its altitude is not given"),
        (waypoint(91, 8), r"item 2: latitude 91, longitude 8 is not on Earth .* swapped"),
        (waypoint(8, 180.00005), "item 2: latitude 8, longitude 180.00005"),
        (waypoint(8.5e6, 1e6), "item 2: .* another coordinate system"),
        (waypoint(frame=10), r"item 2: .* MAV_FRAME 10 \(above the terrain\)"),
        (waypoint(frame=11), "item 2: .* MAV_FRAME 11"),
        (waypoint(frame=1), r"item 2: .* MAV_FRAME 1 \(local\)"),
        (waypoint(frame=99), "item 2: .* MAV_FRAME 99"),
        (waypoint(AltitudeMode=4), r"item 2: .* MAV_FRAME 10 \(above the terrain\)"),
        (waypoint(frame=0, AltitudeMode=3, AMSLAltAboveTerrain=None), "item 2: its altitude above the terrain was"),
        (waypoint(hold=3601), "item 2: it holds for 3601 s; a path may hold for 3600 s"),
        (item(16, [0, 0, 0, None, "47", 8, 20]), "item 2: parameter 5 is '47', not a number"),  # type: ignore[list-item]  # wrong on purpose
        (item(16, [True, 0, 0, None, 47, 8, 20]), "item 2: parameter 1 is 'True', not a number"),
        (item(16, [0, 0]), "item 2: is not in QGroundControl's format"),
        (item(16.5, [0, 0, 0, None, 47, 8, 20]), "item 2: command is 16.5, not a whole number"),
        (item(math.inf, [0, 0, 0, None, 47, 8, 20]), "item 2: command is Infinity, which JSON does not have"),
        (item(1e999, [0] * 7), "item 2: command is Infinity"),
        ({"type": "SimpleItem"}, r"item 2: command is not given \(null\)"),
    ],
)
def test_a_waypoint_that_is_none_is_refused_with_its_number(bad: dict[str, Any], message: str) -> None:
    with pytest.raises(RouteError, match=message):
        executed(A, bad, C)


def test_an_altitude_of_0_is_none_for_ardupilot() -> None:
    with pytest.raises(RouteError, match="item 2: altitude 0 is for ArduPilot that of the waypoint before"):
        executed(A, waypoint(47.2, alt=0), firmware=ARDUPILOT)
    assert executed(waypoint(alt=0)).waypoints == [GeoWaypoint(47.1, 8.1, 0.0)]  # the daemon's floor refuses it


def test_an_altitude_that_was_calculated_above_the_terrain_is_executed_above_mean_sea_level() -> None:
    route = executed(waypoint(alt=512.5, frame=0, AltitudeMode=3, Altitude=20, AMSLAltAboveTerrain=512.5))
    assert route.waypoints == [GeoWaypoint(47.1, 8.1, 512.5, AMSL)]


# --- Stays ------------------------------------------------------------------------------------------------------------


def test_a_delay_holds_at_the_waypoint_before() -> None:
    assert executed(waypoint(hold=1.0), do(93, 10, -1, -1, -1), B).holds_s == [11.0, 0.0]
    route = routes.read(DATA / "delay.plan")
    assert (len(route.waypoints), route.holds_s, route.left_out) == (2, [10.0, 0.0], [])


def test_a_delay_before_the_first_waypoint_is_reported() -> None:
    route = executed(do(93, 10, -1, -1, -1), A)
    assert (route.holds_s, route.left_out) == ((), ["item 1: a delay of 10 s before the first waypoint"])


def test_a_delay_until_a_time_of_the_day_is_refused_but_for_px4_which_does_not_wait() -> None:
    until = do(93, -1, 14, 30, 0)
    with pytest.raises(RouteError, match="item 2: it waits until a time of the day"):
        executed(A, until, B, firmware=ARDUPILOT)
    assert executed(A, until, B, firmware=PX4).holds_s == ()


@pytest.mark.parametrize(("firmware", "yaw_rad"), [(PX4, EAST), (ARDUPILOT, None), (None, None)])
def test_a_loiter_with_a_time_holds_there(firmware: int | None, yaw_rad: float | None) -> None:
    route = executed(A, item(19, [7.5, 0, 0, 90, 47.2, 8.2, 20]), C, firmware=firmware)
    assert route.holds_s == [0.0, 7.5, 0.0]
    assert yaws(route) == [None, yaw_rad, None]


def test_a_loiter_without_an_end_is_the_last_waypoint_or_refused() -> None:
    for_ever = item(17, [0, 0, 0, None, 47.3, 8.3, 20])
    assert latitudes(executed(A, for_ever, do(2000))) == [47.1, 47.3]
    assert len(routes.read(DATA / "loiter_unlim.plan").waypoints) == 3
    with pytest.raises(RouteError, match="item 2: the plan stays there without an end, but item 3 flies on"):
        executed(A, for_ever, C)


def test_a_plan_that_waits_for_an_operator_is_refused_but_for_ardupilot_which_does_not_wait() -> None:
    waits = waypoint(autoContinue=False)
    with pytest.raises(RouteError, match=r"item 1: the plan waits there for an operator .* item 2 flies on"):
        executed(waits, B)
    assert latitudes(executed(B, waits)) == [47.2, 47.1]
    assert latitudes(executed(waits, B, firmware=ARDUPILOT)) == [47.1, 47.2]


# --- The end, and the beginning ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("command", "what"), [(20, "return to launch"), (21, "landing")])
def test_what_ends_a_plan_is_reported_at_its_end_and_refused_amid_it(command: int, what: str) -> None:
    assert executed(A, do(command), do(2001)).left_out == [f"item 2: {what}", "item 3: camera and gimbal"]
    for after in (B, do(177, 1, 1), do(22)):
        with pytest.raises(RouteError, match=f"item 2: it is a {what}, which ends a path, but item 3 flies on"):
            executed(A, do(command), after)


@pytest.mark.parametrize("name", ["rtl_mid.plan", "land_mid.plan"])
def test_a_landing_amid_a_file_is_refused(name: str) -> None:
    with pytest.raises(RouteError, match=f"{name}, item [23]: it is a (landing|return to launch), which ends a path"):
        routes.read(DATA / name)


def test_a_take_off_amid_a_plan_is_refused() -> None:
    with pytest.raises(RouteError, match="item 2: it is a take-off amid the plan"):
        executed(A, do(22), B)


# --- Jumps ------------------------------------------------------------------------------------------------------------


def test_a_jump_is_executed_as_often_as_it_says() -> None:
    assert latitudes(executed(A, B, do(177, 1, 2), C)) == [47.1, 47.2, 47.1, 47.2, 47.1, 47.2, 47.3]
    assert latitudes(executed(A, do(177, 3, 1), B, C, do(177, 2, 1))) == [47.1, 47.2, 47.3, 47.2, 47.3]
    assert latitudes(executed(A, B, do(177, 1, 0), C)) == [47.1, 47.2, 47.3]


def test_a_jump_goes_back_to_the_speed_that_is_set_there() -> None:
    route = executed(A, do(178, 1, 2), B, do(178, 1, 5), C, do(177, 2, 1))
    assert latitudes(route) == [47.1, 47.2, 47.3, 47.2, 47.3]
    assert route.leg_speeds_m_s == [0.0, 2.0, 5.0, 2.0, 5.0]


def test_jumps_within_jumps_are_counted_over_the_whole_plan() -> None:
    """PX4 and ArduPilot never set a jump's count back, so the inner loop repeats in the first round only."""
    once, again = [47.1, 47.2, 47.3], [47.2, 47.3]
    assert latitudes(executed(A, B, C, do(177, 2, 1), do(177, 1, 1))) == [*once, *again, *once]


def test_a_jump_of_a_file_whose_numbers_are_all_alike_counts_the_items() -> None:
    route = routes.read(DATA / "jump.plan")  # each doJumpId is 1
    assert len(route.waypoints) == 2 * 6 + 1
    assert latitudes(route)[-1] == 37.4117


@pytest.mark.parametrize(
    ("jump", "message"),
    [
        (do(177, 1, -1), "item 2: it repeats without an end"),
        (do(177, 9, 1), "item 2: it jumps to item 9, which there is not"),
        (do(177, 1.5, 1), "item 2: parameter 1 is 1.5, not a whole number"),
        (do(177, None, 1), "item 2: parameter 1 is not given"),
        (do(177, 1, 9e9), "the plan flies more than 10000 waypoints"),
        (do(177, 2, 9e9), "the plan flies more than 10000 waypoints"),
        (do(601, 1, 1), r"item 2: UAL cannot fly a jump to a tag \(MAVLink command 601\)"),
    ],
)
def test_a_jump_that_has_no_end_or_no_target_is_refused(jump: dict[str, Any], message: str) -> None:
    with pytest.raises(RouteError, match=message):
        executed(A, jump, B)


# --- Speeds and headings ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("firmware", "value", "speed_m_s"),
    [(PX4, -1, 0.0), (PX4, 0, 0.0), (ARDUPILOT, -1, 3.0), (ARDUPILOT, 0, 3.0), (None, -1, 3.0), (None, -2, 0.0)],
)
def test_the_firmware_says_what_no_speed_means(firmware: int | None, value: float, speed_m_s: float) -> None:
    route = executed(do(178, 1, 3), A, do(178, 0, value), B, firmware=firmware)
    assert route.leg_speeds_m_s == [3.0, speed_m_s]


@pytest.mark.parametrize("kind", [2, 3])
def test_a_speed_of_climbs_or_descents_is_refused(kind: int) -> None:
    with pytest.raises(RouteError, match="item 2: it sets the speed of climbs or descents"):
        executed(A, do(178, kind, 1), B)


def test_a_turn_is_executed_at_the_waypoint_before() -> None:
    route = executed(A, do(115, 90), B)
    assert latitudes(route) == [47.1, 47.1, 47.2]
    assert yaws(route) == [None, EAST, None]
    assert yaws(executed(do(115, 90), A, B)) == [EAST, None]
    route = routes.read(DATA / "yawcmd.plan")
    assert yaws(route) == [None, EAST, None]
    assert route.left_out == ["item 2: the rate and the side of the turn (flown by the smaller angle)"]


def test_a_hold_after_a_turn_is_held_after_the_turn() -> None:
    assert executed(waypoint(hold=1.0), do(115, 90), do(93, 4), B).holds_s == [1.0, 4.0, 0.0]


def test_a_turn_without_a_heading_is_refused() -> None:
    with pytest.raises(RouteError, match=r"item 2: the heading .* is not given"):
        executed(A, do(115, None), B)


def test_a_turn_by_an_angle_is_refused() -> None:
    with pytest.raises(RouteError, match="item 2: it turns by an angle relative to a heading"):
        executed(A, do(115, 90, 0, 1, 1), B)


@pytest.mark.parametrize("what", [do(178, 1, 3), do(115, 90)], ids=["speed", "turn"])
@pytest.mark.parametrize("condition", [112, 114])
def test_what_takes_effect_amid_a_leg_is_refused(condition: int, what: dict[str, Any]) -> None:
    with pytest.raises(RouteError, match=r"item 3: it takes effect amid a leg \(item 2 delays it\)"):
        executed(A, do(condition, 5), what, B)
    told = ["item 2: what its camera or payload waits for", "item 3: camera and gimbal"]
    assert executed(A, do(condition, 5), do(2000), B, what, C).left_out == told


# --- All other commands -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "what"),
    [
        *((command, "camera and gimbal") for command in (205, 206, 214, 531, 1000, 2000, 2500)),
        *((command, "servos, relays and payload") for command in (183, 211)),
        (207, "the autopilot's fence"),
        (189, "the autopilot's marks (a landing, a return path, a tag, a rally landing)"),
        *((command, "the end of a region of interest") for command in (197, 201)),
    ],
)
def test_what_does_not_change_the_flight_is_reported(command: int, what: str) -> None:
    assert executed(A, do(command), B).left_out == [f"item 2: {what}"]


@pytest.mark.parametrize(
    "command",
    [
        *(18, 23, 24, 25, 30, 31, 82, 84, 85, 92, 94, 113, 176, 179, 180, 185, 186, 195, 196, 208, 218, 222, 223),
        *(400, 3000, 5001, 5100, 42702, 9999),
    ],
)
def test_what_changes_the_flight_or_is_not_known_is_refused(command: int) -> None:
    with pytest.raises(RouteError, match=f"m.plan, item 2: .*MAVLink command {command}.*delete it"):
        executed(A, do(command, 1), B)


@pytest.mark.parametrize("command", [80, 195, 201])
def test_a_region_of_interest_is_refused(command: int) -> None:
    with pytest.raises(RouteError, match="item 2: UAL cannot fly a region of interest, which turns the nose"):
        executed(A, item(command, [3, 0, 0, 0, 47.0, 8.0, 0]), B)


def test_the_numbers_of_many_items_are_reported_in_one_message() -> None:
    route = executed(A, *[do(206, 5) for _ in range(8)], B)
    assert route.left_out == ["items 2, 3, 4, 5, 6 and 3 more: camera and gimbal"]


@given(
    st.lists(
        st.builds(
            item,
            st.sampled_from([16, 17, 19, 20, 21, 22, 82, 93, 112, 114, 115, 177, 178, 195, 206, 999]),
            st.lists(st.none() | st.floats(-200.0, 200.0) | st.integers(-3, 9), min_size=7, max_size=7),
            st.sampled_from([0, 2, 3, 10]),
        ),
        max_size=8,
    ),
    st.sampled_from([PX4, ARDUPILOT, 0]),
)
def test_what_is_read_of_any_mission_can_be_executed(items: list[dict[str, Any]], firmware: int) -> None:
    with contextlib.suppress(RouteError):
        route = executed(*items, firmware=firmware)
        count = len(route.waypoints)
        assert 0 < count <= 10_000
        assert {len(route.leg_speeds_m_s), len(route.holds_s)} <= {0, count}
        assert all(0.0 <= each <= 3600.0 for each in route.holds_s)
        for each in route.waypoints:
            assert isinstance(each, GeoWaypoint)
            assert abs(each.latitude_deg) <= 90.0
            assert abs(each.longitude_deg) <= 180.0
            assert math.isfinite(each.altitude_m)
            assert each.yaw_rad is None or abs(each.yaw_rad) <= math.pi
