from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest

from tests.ual.missions.plans import HOME, TEN, Example, at, plan, take_off
from tests.ual.missions.public_plans import FLOWN, REFUSED, Public
from tests.ual.routes.missions import ARDUPILOT, do, item, waypoint, wpl
from ual.missions import (
    CameraAction,
    CameraTrigger,
    Heading,
    HoldTime,
    Item,
    Jump,
    Land,
    RegionOfInterest,
    ReturnToLaunch,
    Speed,
    TakeOff,
    Waypoint,
    checks,
    parse,
    read,
)
from ual.routes import RouteError
from ual.types import AltitudeReference

DATA = Path(__file__).parents[2] / "data" / "missions"


def items(text: str, name: str = "a.plan") -> list[Item]:
    return list(parse(text.encode(), name).items)


def refusal(text: str, name: str = "a.plan") -> str:
    with pytest.raises(RouteError) as caught:
        parse(text.encode(), name)
    return str(caught.value).removeprefix(f"{name}, ")


@pytest.mark.parametrize("example", [each for each in TEN if each.kinds], ids=lambda each: each.name)
def test_a_plan_becomes_items_that_a_mission_can_have(example: Example) -> None:
    found = items(example.text)
    checks.require(found)
    assert tuple(type(each).__name__ for each in found) == example.kinds


@pytest.mark.parametrize("example", [each for each in TEN if each.refusal], ids=lambda each: each.name)
def test_what_a_mission_cannot_have_is_refused_with_its_number(example: Example) -> None:
    assert refusal(example.text).startswith(example.refusal)


def test_the_fields_of_a_plan_have_their_values() -> None:
    found = items(
        plan(
            take_off(20.0),
            do(178, 1, 3.5, -1, 0),
            waypoint(47.1, 8.1, 30.0, hold=2.0, yaw=90.0),
            do(93, 5),
            item(195, [0, 0, 0, 0, 47.2, 8.2, 1]),
            do(206, 12.5, 0, 1, 0),
            do(2000, 0, 4, 0, None),
            do(177, 3, 2),
            item(21, [0, 0, 0, None, 47.3, 8.3, 0]),
        )
    )
    assert found == [
        TakeOff(20.0),
        Speed(3.5),
        Waypoint(47.1, 8.1, 30.0, hold_s=2.0, yaw_rad=0.0),
        HoldTime(5.0),
        RegionOfInterest(47.2, 8.2, 1.0),
        CameraTrigger(CameraAction.BY_DISTANCE, 12.5),
        CameraTrigger(CameraAction.BY_INTERVAL, 4.0),
        Jump(3, 2),
        Land(47.3, 8.3),
    ]
    assert [each.number for each in found] == list("123456789")


def actions(*commands: dict[str, Any]) -> list[CameraAction]:
    found = items(plan(take_off(20.0), waypoint(), *commands))[2:]
    return [each.action for each in found if isinstance(each, CameraTrigger)]


@pytest.mark.parametrize(
    ("command", "action"),
    [
        (do(206, 12.5, 0, 1), CameraAction.BY_DISTANCE),
        (do(206, 12.5, 0, 0), CameraAction.BY_DISTANCE_LATER),
        (do(206, 0, 0, 1), CameraAction.STOP_WITH_PHOTO),
        (do(206, 0, 0, 0), CameraAction.STOP),
        (do(206, 0, -1, None), CameraAction.STOP),
        (do(2001), CameraAction.STOP),
    ],
)
def test_a_trigger_says_whether_it_takes_a_photo_at_once(command: dict[str, Any], action: CameraAction) -> None:
    assert actions(command) == [action]


def test_the_end_of_one_trigger_is_not_the_end_of_another_one() -> None:
    by_distance, by_time, no_distance, no_time = do(206, 10, 0, 1), do(2000, 0, 4, 0), do(206), do(2001)
    both = [CameraAction.STOP] * 2
    assert actions(no_distance, no_time) == both  # QGroundControl's "stop taking photos"
    assert actions(by_time, no_distance, no_time) == [CameraAction.BY_INTERVAL, *both]
    assert actions(by_distance, no_distance, no_time) == [CameraAction.BY_DISTANCE, *both]
    for commands in ([by_time, no_distance], [by_distance, no_time], [by_distance, by_time, no_distance, no_time]):
        assert "it ends a trigger by" in refusal(plan(take_off(20.0), waypoint(), *commands))


def test_a_survey_of_mission_planner_is_read_as_it_is_executed() -> None:
    mission = read(DATA / "mp_survey.waypoints")
    found = [each for each in mission.items if isinstance(each, CameraTrigger)]
    assert found == [CameraTrigger(CameraAction.BY_DISTANCE_LATER, 12.5), CameraTrigger(CameraAction.STOP)]
    assert mission.left_out == ["item 0: home"]


WRITTEN = plan(take_off(20.0), waypoint(autoContinue=True, AltitudeMode=1, Altitude=20), firmware=ARDUPILOT)


@pytest.mark.parametrize(("at", "letter"), [(each.start(), each[0]) for each in re.finditer(r"[A-Za-z]", WRITTEN)])
def test_a_letter_that_is_another_one_gives_the_same_mission_or_a_refusal(at: int, letter: str) -> None:
    """A key that is misspelled has no other effect than a key that is right."""
    wanted = items(WRITTEN)
    for other in ("x", letter.swapcase(), ""):
        text = WRITTEN[:at] + other + WRITTEN[at + 1 :]
        try:
            found = items(text)
        except RouteError:
            continue
        assert found == wanted, text[at - 10 : at + 10]


def test_the_fence_of_an_old_plan_is_named_as_left_out() -> None:
    fence = {"version": 1, "polygon": [[47.0, 8.0], [47.1, 8.0], [47.1, 8.1]]}
    text = json.dumps({**json.loads(plan(take_off(20.0), waypoint())), "geoFence": fence})
    assert parse(text.encode(), "a.plan").left_out == [
        "the geofence and rally points (`ual fence upload` uploads them)"
    ]


def test_parameters_that_multirotors_ignore_are_named() -> None:
    text = plan(
        item(22, [15, 0, 0, None, 0, 0, 20]),
        item(19, [7, 1, 30, 0, 47.1, 8.1, 20]),
        do(2000, 0, 0, 1, 7),
        item(21, [0, 0, 0, None, 47.1, 8.1, 5]),
    )
    assert parse(text.encode(), "a.plan").left_out == [
        "item 1: the pitch of the take-off, which multirotors ignore",
        "item 2: the heading before it goes on, which multirotors ignore",
        "item 2: the radius of the loiter, which multirotors ignore",
        "item 4: the altitude of the landing, which multirotors ignore",
    ]


def test_a_take_off_at_the_planned_home_has_no_position_and_one_elsewhere_has() -> None:
    elsewhere = item(22, [0, 0, 0, None, HOME[0] + 1e-4, HOME[1], 20])
    assert items(plan(take_off())) == [TakeOff(20.0)]
    assert items(plan(elsewhere)) == [TakeOff(20.0, AltitudeReference.HOME, HOME[0] + 1e-4, HOME[1])]


def test_a_loiter_with_a_time_is_a_waypoint_with_a_hold() -> None:
    assert items(plan(item(19, [7, 0, 0, 0, 47.1, 8.1, 20]))) == [Waypoint(47.1, 8.1, 20.0, hold_s=7.0)]


def test_the_items_of_a_waypoint_file_keep_its_numbers_and_home_is_none_of_them() -> None:
    text = wpl((0, 16, 0, 0, 0, 0, 47.0, 8.0, 488), (3, 22, 0, 0, 0, 0, 0, 0, 15), (3, 16, 3, 0, 0, 0, 47.1, 8.1, 20),
               (2, 177, 2, 1, 0, 0, 0, 0, 0), (2, 20, 0, 0, 0, 0, 0, 0, 0))  # fmt: skip
    mission = parse(text.encode(), "a.waypoints")
    assert mission.items == [TakeOff(15.0), Waypoint(47.1, 8.1, 20.0, hold_s=3.0), Jump(2, 1), ReturnToLaunch()]
    assert [each.number for each in mission.items] == ["1", "2", "3", "4"]
    assert mission.left_out == ["item 0: home"]


def test_a_heading_of_zero_is_none_for_ardupilot_and_north_for_px4() -> None:
    text = plan(waypoint(yaw=0.0), firmware=ARDUPILOT)
    assert items(text) == [Waypoint(47.1, 8.1, 20.0)]
    assert items(plan(waypoint(yaw=0.0))) == [Waypoint(47.1, 8.1, 20.0, yaw_rad=math.pi / 2)]


def test_a_heading_is_turned_to_rep_103() -> None:
    [found] = items(plan(do(115, 180.0)))
    assert isinstance(found, Heading)
    assert found.yaw_rad == pytest.approx(-math.pi / 2)


@pytest.mark.parametrize(
    ("faulty", "words"),
    [
        (waypoint(autoContinue=False), "it waits for an operator"),
        (waypoint(alt=None), "its altitude is not given (null)"),
        (waypoint(lat=None), "it has no position (null)"),
        (waypoint(lat=0, lon=0), "latitude 0, longitude 0 is a position that was not set"),
        (item(16, [0, 0, 5, None, 47.1, 8.1, 20]), "it passes the waypoint at a distance (parameter 3)"),
        (item(21, [0, 0, 0, None, 0, 0, 0]), "it has no position: give it one, or return to launch"),
        (item(21, [0, 1, 0, None, 47.1, 8.1, 0]), "it is a precision landing"),
        (item(17, [0, 0, 0, None, 47.1, 8.1, 20]), "it has a stay without an end"),
        (do(93, -1, 12, 0, 0), "it waits until a time of the day"),
        (do(178, 2, 3, -1, 0), "it sets the speed of climbs or descents"),
        (do(178, 1, 3, -1, 1), "it changes the speed by an amount"),
        (do(178, 1, 0, -1, 0), "it gives no speed"),
        (do(178, 1, 3, 50, 0), "it sets the throttle"),
        (do(115, 90, 20, 0, 0), "it turns at a rate"),
        (do(115, 90, 0, -1, 0), "it turns to a side"),
        (do(115, 90, 0, 0, 1), "it turns by an angle"),
        (do(203, 0, 0, 0, 0, 1), "it has a photo by DO_DIGICAM_CONTROL"),
        (do(214, 1, 0, 0, 0), "it has a trigger by time, which ArduPilot refuses"),
        (do(206, 10, 100, 1, 0), "it sets the time of the shutter"),
        (do(206, 10, 0, 2, 0), "its parameter 3 (a photo at once) is 2, not 0 or 1"),
        (do(206, -1, 0, 0, 0), "its distance is negative"),
        (do(206, 10, 0, 1, 3), "it has 3 as parameter 4"),
        (do(93, 5, 12, 0, 0), "it waits for seconds (parameter 1) and until a time of the day"),
        (item(22, [0, 0, 0, 90, 0, 0, 20]), "it has 90 as parameter 4"),
        (item(21, [30, 0, 0, None, 47.1, 8.1, 0]), "it has 30 as parameter 1"),
        (item(20, [0, 0, 0, 0, 47.1, 0, 0]), "it has 47.1 as parameter 5"),
        (item(19, [7, 0, 0, 90, 47.1, 8.1, 20]), "it has 90 as parameter 4"),
        (item(197, [2, 0, 0, 0, 0, 0, 0]), "it has 2 as parameter 1"),
        (item(2001, [1, 0, 0, 0, 0, 0, 0]), "it has 1 as parameter 1"),
        (waypoint(autoContinue="false"), "autoContinue is 'false', neither true nor false"),
        (waypoint(autocontinue=False), "has a key that is none: 'autocontinue' is not known: is 'autoContinue' meant?"),
        (waypoint(AltitudeMode="2"), "AltitudeMode is '2', not a number"),
        (waypoint(AltitudeMode=2), "its AltitudeMode is 2, but its frame 3"),
        (waypoint(AltitudeMode=1, Altitude=30), "its Altitude is 30, but its parameter 7 20"),
        (do(2000, 0, 1, 5, 0), "it takes a number of photos"),
        (do(2000, 2, 1, 0, 0), "it chooses one of several cameras"),
        (do(177, 9, 1), "it jumps to item 9, which there is not"),
        (do(177, 1, -1), "it repeats without an end, or never"),
        (do(177, 1, 1e38), "it repeats 1e+38 times, more than an autopilot can count"),
        (do(201, 2, 5), "its region of interest is no place"),
        (do(112, 5), "it has a condition (a delay)"),
        (do(31000), "it is not known to UAL (MAVLink command 31000)"),
    ],
)
def test_a_faulty_item_is_named(faulty: dict[str, object], words: str) -> None:
    assert refusal(plan(take_off(), at(1, 1), faulty)).startswith(f"item 3: {words}")


KML = """<kml><Placemark><LineString><altitudeMode>{mode}</altitudeMode>
<coordinates>8.1,47.1,20 8.2,47.2,30</coordinates></LineString></Placemark></kml>"""


def test_the_positions_of_a_row_are_waypoints() -> None:
    found = items(KML.format(mode="absolute"), "a.kml")
    above = AltitudeReference.AMSL
    assert found == [Waypoint(47.1, 8.1, 20.0, above), Waypoint(47.2, 8.2, 30.0, above)]
    assert [each.number for each in found] == ["1", "2"]


def test_an_altitude_passed_replaces_those_of_a_row() -> None:
    mission = parse(KML.format(mode="clampToGround").encode(), "a.kml", altitude_m=15.0)
    assert mission.items == [Waypoint(47.1, 8.1, 15.0), Waypoint(47.2, 8.2, 15.0)]


def test_altitudes_above_the_ellipsoid_are_refused() -> None:
    gpx = '<gpx><rte><rtept lat="47.1" lon="8.1"><ele>20</ele></rtept></rte></gpx>'
    with pytest.raises(RouteError, match="above the ellipsoid"):
        parse(gpx.encode(), "a.gpx", altitude_reference=AltitudeReference.ELLIPSOID)


def test_poses_are_no_mission(tmp_path: Path) -> None:
    file = tmp_path / "way.txt"
    file.write_text("1, 2, 3\n")
    with pytest.raises(RouteError, match="positions on Earth"):
        read(file)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(RouteError, match=r"cannot read .*no\.plan"):
        read(tmp_path / "no.plan")


@pytest.mark.parametrize("public", FLOWN, ids=lambda each: each.name)
def test_a_plan_that_others_have_published_is_read(public: Public) -> None:
    found = items(public.text, public.file_name)
    checks.require(found)
    places = [each for each in found if isinstance(each, Waypoint)]
    assert tuple((each.latitude_deg, each.longitude_deg, each.altitude_m) for each in places) == public.way
    assert len(found) == len(public.items)


@pytest.mark.parametrize("public", REFUSED, ids=lambda each: each.name)
def test_a_published_plan_that_a_mission_cannot_have_is_refused_by_its_item(public: Public) -> None:
    assert refusal(public.text, public.file_name).startswith(public.refusal)


def test_the_position_of_a_take_off_is_left_out_as_ardupilot_ignores_it() -> None:
    delay = next(each for each in FLOWN if each.name == "ardupilot_delay")
    mission = parse(delay.text.encode(), delay.file_name)
    assert mission.items[0] == TakeOff(20.0)
    assert mission.left_out == ["item 0: home", "item 1: the place of the take-off, which ArduPilot ignores"]


def test_what_ardupilot_does_not_give_is_that_of_the_item_executed_before() -> None:
    nowhere = item(16, [0, 0, 0, 0, 0, 0, 30])
    landing = item(21, [0, 0, 0, 0, 0, 0, 0])
    first = waypoint(47.1, 8.1, 25.0, yaw=0.0)
    same_height = waypoint(47.2, 8.2, 0.0, yaw=0.0)
    assert items(plan(take_off(), first, same_height, nowhere, landing, firmware=ARDUPILOT)) == [
        TakeOff(20.0),
        Waypoint(47.1, 8.1, 25.0),
        Waypoint(47.2, 8.2, 25.0),
        Waypoint(47.2, 8.2, 30.0),
        Land(47.2, 8.2),
    ]
    assert items(plan(take_off(), same_height)) == [TakeOff(20.0), Waypoint(47.2, 8.2, 0.0, yaw_rad=math.pi / 2)]


@pytest.mark.parametrize(
    ("faulty", "words"),
    [
        ([waypoint(alt=0.0)], "item 1: altitude 0 is for ArduPilot that of the item flown before"),
        ([take_off(), waypoint(lat=0, lon=0)], "item 2: no position is for ArduPilot that of the item flown before"),
        ([take_off(), item(21, [0] * 7)], "item 2: no position is for ArduPilot"),
        ([take_off(), waypoint(alt=0.0, frame=0)], "item 2: altitude 0 is for ArduPilot"),
        ([take_off(), waypoint(), waypoint(alt=0.0), do(177, 3, 2)], "item 3: altitude 0 is for ArduPilot"),
    ],
)
def test_what_ardupilot_does_not_give_and_is_not_known_is_refused(faulty: list[dict[str, object]], words: str) -> None:
    assert refusal(plan(*faulty, firmware=ARDUPILOT)).startswith(words)


@pytest.mark.parametrize("name", ["a.waypoints", "a.plan"])
def test_a_file_of_too_many_items_is_refused_before_the_rest_of_it_is_read(name: str) -> None:
    """Its last item is none, which nobody comes to know."""
    most = 2 * checks.MOST_ITEMS
    if name == "a.plan":
        text = json.dumps({"fileType": "Plan", "mission": {"items": [at(1.0, 2.0)] * (most + 2) + ["no item"]}})
    else:
        text = wpl(*[(3, 16, 0, 0, 0, 0, 47.1, 8.1, 20)] * (most + 2)) + "no item\n"
    with pytest.raises(RouteError, match=f"has more than {most} items: fly it in parts"):
        parse(text.encode(), name)
