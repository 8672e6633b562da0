import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.snapshots import value_of
from tests.ual_daemon.backends.mavlink.fakes import (
    BOOT_MS,
    UTC_S,
    Harness,
    attitude,
    heartbeat,
    packer,
    position,
)
from ual.geometry import Vector3
from ual.types import Battery, GpsFix, State
from ual_daemon.backends.mavlink.backend import MavlinkBackend
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.values import Control, LandedState
from ual_daemon.flight.state import estimate
from ual_daemon.geodesy import SphereProjection

REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE
GOOD = 0x37F


def estimator_status(flags: int = GOOD) -> Message:
    return mavlink.MAVLink_estimator_status_message(0, flags, 0, 0, 0, 0, 0, 0, 0, 0)


def on_ground() -> Message:
    return mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_ON_GROUND)


def state(harness: Harness) -> State:
    return estimate(harness.snapshot(), MavlinkBackend.freshness).state


def test_pose_and_velocity_are_in_our_axes() -> None:
    harness = Harness()
    harness.receive(heartbeat(), attitude(0.0), position(0.0, north=1.0, east=2.0, down=-3.0))
    snapshot = harness.snapshot()
    assert snapshot.motion.pose.value.position == Vector3(2.0, 1.0, 3.0)
    assert snapshot.motion.pose.value.yaw_rad == pytest.approx(math.pi / 2)
    assert snapshot.motion.velocity.value.linear == Vector3(0.25, 0.5, 0.125)
    assert tuple(snapshot.motion.velocity.value.angular) == pytest.approx((0.1, -0.2, -0.3))


def test_a_position_without_a_fresh_attitude_is_no_pose() -> None:
    harness = Harness()
    harness.receive(heartbeat(), position(0.0))
    assert harness.snapshot().motion.pose is None
    harness.receive(attitude(), position(0.0))
    assert harness.snapshot().motion.pose.time_s == 0.0
    harness.now_s = 0.6
    harness.receive(position(0.6))
    assert harness.snapshot().motion.pose.time_s == 0.0


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_position_that_is_no_number_is_no_pose(bad: float) -> None:
    harness = Harness()
    harness.receive(heartbeat(), attitude(), position(0.0, north=bad))
    assert harness.snapshot().motion.pose is None


def test_the_stamp_is_when_the_autopilot_measured() -> None:
    harness = Harness()
    harness.receive(heartbeat(), attitude(), position(0.0))
    harness.now_s = 0.3  # comes 0.1 s late
    harness.receive(attitude(), position(0.2))
    assert harness.snapshot().motion.stamp_s == pytest.approx(UTC_S + 0.2)


def test_a_pose_that_is_not_renewed_keeps_its_stamp() -> None:
    harness = Harness()
    harness.receive(heartbeat(), attitude(), position(0.0))
    harness.now_s = 1.0
    harness.receive(position(1.0))  # without an attitude it is no pose
    assert harness.snapshot().motion.pose.time_s == 0.0
    assert harness.snapshot().motion.stamp_s == pytest.approx(UTC_S)


def test_an_autopilot_that_says_everything_is_ready() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    assert state(harness) is State.UNINITIALIZED
    harness.receive(attitude(), position(0.0), on_ground(), estimator_status())
    assert state(harness) is State.LANDED_DISARMED


def test_a_pose_from_before_the_position_became_good_is_none() -> None:
    harness = Harness()
    harness.receive(heartbeat(), attitude(), position(0.0), on_ground(), estimator_status(0))
    harness.receive(estimator_status())
    found = estimate(harness.snapshot(), MavlinkBackend.freshness)
    assert (found.state, found.why) == (State.UNINITIALIZED, "the autopilot has not said its pose")
    harness.receive(position(2.0), estimator_status())
    assert state(harness) is State.LANDED_DISARMED


def test_before_px4_says_whether_it_is_landed_it_is_not_taken_for_flying() -> None:
    harness = Harness()
    harness.receive(heartbeat(armed=True), attitude(), position(0.0), estimator_status())
    found = estimate(harness.snapshot(), MavlinkBackend.freshness)
    assert (found.state, found.why) == (State.UNINITIALIZED, "the autopilot has not said whether it is landed")


def test_silence_is_reported_as_a_lost_link_and_not_as_a_lost_value() -> None:
    harness = Harness()
    harness.receive(heartbeat(), attitude(), position(0.0), on_ground(), estimator_status())
    harness.now_s = 0.02
    harness.receive(mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0))
    found = []
    for _ in range(200):
        harness.now_s += 0.01
        found.append(estimate(harness.snapshot(), MavlinkBackend.freshness))
    lost = [each for each in found if each.state is State.UNINITIALIZED]
    assert len(lost) > 50
    assert not any(each.is_link_up for each in lost)


def test_after_a_pause_of_ours_the_past_is_forgotten_and_requested_at_once() -> None:
    harness = Harness()
    harness.receive(
        heartbeat(armed=True), attitude(), position(0.0), on_ground(), estimator_status(),
        mavlink.MAVLink_gps_global_origin_message(1, 1, 1),
    )  # fmt: skip
    harness.run(0.5)
    assert state(harness) is State.LANDED_ARMED
    harness.link.sent.clear()
    harness.discovery.discard_state()
    assert state(harness) is State.UNINITIALIZED
    assert harness.snapshot().earth.projection is not None
    harness.run(0.05)
    assert 0.0 in {sent.param1 for sent in harness.commands(REQUEST)}


def test_after_a_lost_link_the_past_is_forgotten_whatever_comes_first() -> None:
    for first in (position(1.3), attitude(), mavlink.MAVLink_ping_message(0, 0, 0, 0)):
        harness = Harness()
        flying = mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_IN_AIR)
        harness.receive(heartbeat(6 << 16, armed=True), attitude(), position(0.0), flying, estimator_status())
        assert state(harness) is State.FLYING_AUTO
        harness.run(1.3)  # what it does by itself meanwhile we do not hear
        harness.link.sent.clear()
        harness.receive(first)
        harness.receive(attitude(), position(1.3), estimator_status())
        assert state(harness) is State.UNINITIALIZED
        harness.run(0.1)
        assert 0.0 in {sent.param1 for sent in harness.commands(REQUEST)}
        harness.receive(heartbeat(4 << 16 | 5 << 24, armed=True), flying)
        assert state(harness) is State.FLYING_MANUAL


def test_a_message_that_makes_us_fail_costs_no_other(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    harness = Harness()
    harness.receive(heartbeat())
    on_message = harness.session.on_message

    def failing(message_id: int, sequence: int, message: Message, *rest: Any) -> None:
        if message.get_type() == "ATTITUDE_QUATERNION":
            raise ZeroDivisionError
        on_message(message_id, sequence, message, *rest)

    monkeypatch.setattr(harness.session, "on_message", failing)
    harness.receive(data=harness.pack(attitude()) + harness.pack(heartbeat(armed=True)))
    harness.receive(attitude())
    assert harness.snapshot().control.armed.value is True
    (told,) = [record for record in caplog.records if "could not be used" in record.message]
    assert "message 31 " in told.message


@pytest.mark.parametrize(
    "kind", [mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_TYPE_VTOL_TILTROTOR]
)
def test_a_px4_that_is_no_multirotor_is_only_watched(kind: int) -> None:
    harness = Harness()
    harness.receive(heartbeat(kind=kind), attitude(), position(0.0))
    assert harness.snapshot().motion.pose is not None
    info = harness.session.info()
    assert not info.capabilities
    assert info.autopilot.startswith("unknown (px4, ")


def _position(latitude: int, longitude: int) -> Message:
    return mavlink.MAVLink_global_position_int_message(BOOT_MS, latitude, longitude, 488_000, 3_000, 0, 0, 0, 0)


def test_a_position_on_earth_is_reported_while_it_is_fresh_and_one() -> None:
    harness = Harness()
    harness.receive(heartbeat(), _position(0, 0))  # ArduPilot before its first fix
    assert harness.snapshot().motion.position_geo is None
    harness.receive(_position(473977420, 85455940))
    assert harness.snapshot().motion.position_geo.latitude_deg == pytest.approx(47.397742)
    harness.now_s += 1.0
    harness.receive(heartbeat())
    assert harness.snapshot().motion.position_geo is not None
    harness.now_s += 1.0
    harness.receive(heartbeat())
    assert harness.snapshot().motion.position_geo is None


@pytest.mark.parametrize(
    ("flags", "why"),
    [
        (0x3FF, ""),
        (0x33F, ""),
        (0x37F, ""),
        (0x365, "no horizontal velocity, horizontal position"),
        (0x25, "no horizontal velocity, horizontal position"),
        (0, "no attitude, horizontal velocity, vertical velocity, horizontal position, height"),
    ],
)
def test_the_estimator_is_good_by_its_flags(flags: int, why: str) -> None:
    harness = Harness()
    harness.receive(heartbeat(), estimator_status(flags))
    estimator = harness.snapshot().motion.estimator.value
    assert (estimator.is_good, estimator.why) == (not why, why)


def test_a_mode_is_taken_from_whichever_message_says_it_first() -> None:
    harness = Harness()
    harness.receive(heartbeat(0x00060000))
    assert harness.snapshot().control.mode.value.control is Control.REFERENCES
    harness.receive(mavlink.MAVLink_current_mode_message(0, 0x00030000, 0))
    assert harness.snapshot().control.mode.value.name == "POSCTL"


def reported_battery(number: int, percent: int, function: int = 0, cells: int = 4, more: int = 0) -> Message:
    voltages, ext = [4000] * cells + [0xFFFF] * (10 - cells), [4000] * more + [0] * (4 - more)
    return mavlink.MAVLink_battery_status_message(
        number, function, 0, 0x7FFF, voltages, 250, 0, 0, percent, 0, 0, ext, 0, 0
    )


def test_of_several_batteries_the_emptiest_counts_and_all_are_reported() -> None:
    harness = Harness()
    harness.receive(heartbeat(), reported_battery(0, 80), _charge(81))
    assert harness.snapshot().condition.battery == Battery(81.0, 16.2, 1.0)  # one: as the system's status says
    harness.receive(reported_battery(1, 40, 2, 10, 2), reported_battery(2, 5, 4), _charge(81), reported_battery(3, 101))
    condition = harness.snapshot().condition
    assert condition.battery == Battery(40.0, 48.0, 2.5, 1, "propulsion")
    assert [(each.id, each.remaining_percent) for each in condition.batteries] == [(0, 80.0), (1, 40.0), (2, 5.0)]


def test_batteries_of_which_nothing_comes_any_more_are_gone() -> None:
    """The charge of a minute before was told, while the system's status had a lower one."""
    harness = Harness()
    harness.receive(heartbeat(), reported_battery(0, 80), reported_battery(1, 85))
    for _ in range(25):
        harness.run(1.0, step_s=0.5)
        harness.receive(heartbeat(), _charge(10))
    condition = harness.snapshot().condition
    assert (condition.battery.remaining_percent, condition.batteries) == (10.0, ())


def test_battery_gps_and_positions_are_reported_in_our_units() -> None:
    harness = Harness()
    harness.receive(
        heartbeat(),
        mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 16200, 1234, 87, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_gps_raw_int_message(
            0, 6, 473977000, 85455000, 489000, 70, 110, 3, 0, 14, 536500, 25, 40, 400, 0
        ),
        mavlink.MAVLink_global_position_int_message(0, 473977427, 85455967, 492000, 3000, 0, 0, 0, 0),
        mavlink.MAVLink_gps_global_origin_message(473977428, 85455967, 489052),
        mavlink.MAVLink_home_position_message(
            473977427, 85455967, 489454, 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0
        ),
    )
    snapshot = harness.snapshot()
    battery, gps, geo = snapshot.condition.battery, snapshot.condition.gps, snapshot.motion.position_geo
    assert (battery.voltage_v, battery.current_a, battery.remaining_percent) == (16.2, 12.34, 87.0)
    assert (gps.fix, gps.satellites_count) == (GpsFix.RTK_FIXED, 14)
    assert (gps.horizontal_accuracy_m, gps.vertical_accuracy_m) == (0.025, 0.04)
    assert snapshot.earth.geoid_separation_m == pytest.approx(47.5)
    assert (geo.latitude_deg, geo.longitude_deg) == pytest.approx((47.3977427, 8.5455967))
    assert (geo.altitude_amsl_m, geo.altitude_home_m) == (492.0, 3.0)
    assert geo.altitude_ellipsoid_m == pytest.approx(539.5)
    assert snapshot.earth.home_altitude_amsl_m == 489.454
    assert snapshot.earth.home_geo is not None
    assert (snapshot.earth.home_geo.latitude_deg, snapshot.earth.home_geo.longitude_deg) == (47.3977427, 8.5455967)
    assert isinstance(snapshot.earth.projection, SphereProjection)
    assert snapshot.earth.projection.altitude_amsl_m == 489.052


def test_what_is_not_known_is_none() -> None:
    harness = Harness()
    harness.receive(heartbeat(), mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 0xFFFF, -100, -1, 0, 0, 0, 0, 0, 0))
    assert harness.snapshot().condition.battery is None
    harness.receive(mavlink.MAVLink_gps_raw_int_message(0, 1, 0, 0, 0, 0, 0, 0, 0, 255))
    gps = harness.snapshot().condition.gps
    assert (gps.fix, gps.satellites_count, gps.horizontal_accuracy_m) == (GpsFix.NONE, None, None)
    assert harness.snapshot().earth.geoid_separation_m is None


def test_a_long_status_text_is_put_together() -> None:
    harness = Harness()
    harness.receive(heartbeat(), mavlink.MAVLink_statustext_message(6, b"a" * 50, 3, 0))
    harness.receive(mavlink.MAVLink_statustext_message(6, b"bc", 3, 1))
    assert harness.snapshot().condition.status_text == "a" * 50 + "bc"
    harness.receive(mavlink.MAVLink_statustext_message(6, b"new", 4, 0))
    assert harness.snapshot().condition.status_text == "new"


def _received_out_of_order(harness: Harness, earlier: Any, later: Any) -> None:
    first, second = harness.pack(earlier), harness.pack(later)
    harness.receive(data=second)
    harness.now_s += 0.1
    harness.receive(data=first)


def test_a_message_that_comes_late_does_not_bring_the_past_back() -> None:
    harness = Harness()
    offboard, landing = 6 << 16, 4 << 16 | 6 << 24
    harness.receive(heartbeat(offboard, armed=True))
    _received_out_of_order(harness, heartbeat(offboard, armed=True), heartbeat(landing, armed=False))
    assert harness.snapshot().control.mode.value.name == "AUTO.LAND"
    assert harness.snapshot().control.armed.value is False
    mode = mavlink.MAVLink_current_mode_message
    _received_out_of_order(harness, mode(0, landing, 0), heartbeat(offboard, armed=True))  # whichever message told it
    assert harness.snapshot().control.mode.value.name == "OFFBOARD"
    said = mavlink.MAVLink_extended_sys_state_message
    _received_out_of_order(
        harness, said(0, mavlink.MAV_LANDED_STATE_IN_AIR), said(0, mavlink.MAV_LANDED_STATE_ON_GROUND)
    )
    assert harness.snapshot().control.landed.value is LandedState.ON_GROUND
    harness.receive(attitude())
    _received_out_of_order(harness, position(1.0, north=1.0), position(1.02, north=2.0))
    assert harness.snapshot().motion.pose.value.position.y == 2.0


def test_a_copy_of_the_mode_before_is_known_by_its_number_however_long_it_was_en_route() -> None:
    harness = Harness()
    offboard, position_mode = 6 << 16, 3 << 16
    copy = harness.pack(mavlink.MAVLink_current_mode_message(0, offboard, 0))
    harness.receive(data=copy)
    harness.receive(heartbeat(position_mode, armed=True))
    for _ in range(30):
        harness.now_s += 0.05
        harness.receive(attitude())
    harness.receive(data=copy)
    assert harness.snapshot().control.mode.value.name == "POSCTL"


def test_numbers_that_begin_anew_are_believed_after_a_moment() -> None:
    harness = Harness()
    for _ in range(5):
        harness.receive(heartbeat(armed=True))
    harness.pack = packer()  # another boot, say
    harness.run(0.35)
    harness.receive(heartbeat(armed=False))
    assert harness.snapshot().control.armed.value is False


def test_a_landed_state_that_is_not_known_is_unknown() -> None:
    harness = Harness()
    harness.receive(heartbeat(), mavlink.MAVLink_extended_sys_state_message(0, 77))
    assert harness.snapshot().control.landed.value is LandedState.UNKNOWN


def _attitude(norm: float, rate: float = 0.0) -> Message:
    return mavlink.MAVLink_attitude_quaternion_message(BOOT_MS, norm, 0.0, 0.0, 0.0, rate, 0.0, 0.0)


def _moving(north: float = 0.0, speed: float = 0.0) -> Message:
    return mavlink.MAVLink_local_position_ned_message(BOOT_MS, north, 0.0, 0.0, speed, 0.0, 0.0)


def _geo(latitude: float, longitude: float, altitude_m: float = 488.0, home_m: float = 3.0) -> Message:
    degrees = round(latitude * 1e7), round(longitude * 1e7)
    return mavlink.MAVLink_global_position_int_message(
        BOOT_MS, *degrees, round(altitude_m * 1e3), round(home_m * 1e3), 0, 0, 0, 0
    )


def _origin(latitude: float, altitude_m: float = 0.0) -> Message:
    return mavlink.MAVLink_gps_global_origin_message(round(latitude * 1e7), 1, round(altitude_m * 1e3))


def _charge(percent: int) -> Message:
    return mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 16200, 100, percent, 0, 0, 0, 0, 0, 0)


def _ellipsoid(altitude_m: float) -> Message:
    return mavlink.MAVLink_gps_raw_int_message(0, 3, 1, 1, 1000, 0, 0, 0, 0, 9, round(altitude_m * 1e3))


def test_a_home_without_a_position_is_none() -> None:
    harness = Harness()
    nowhere = mavlink.MAVLink_home_position_message(0, 0, 400_000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0)
    harness.receive(heartbeat(), nowhere)
    assert harness.snapshot().earth.home_geo is None


def _home(altitude_m: float) -> Message:
    return mavlink.MAVLink_home_position_message(1, 1, round(altitude_m * 1e3), 0, 0, 0, [1, 0, 0, 0], 0, 0, 0)


def _parameter(value: float, name: bytes = b"MPC_XY_VEL_MAX") -> Message:
    return mavlink.MAVLink_param_value_message(name, value, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0)


IMPOSSIBLE = {
    "position of 3e+38 m": _moving(3e38),
    "position of 1.1e+07 m": _moving(-1.1e7),
    "position of nan m": _moving(math.nan),
    "velocity of 1.5e+03 m/s": _moving(1.0, 1500.0),
    "velocity of inf m/s": _moving(1.0, math.inf),
    "attitude with a quaternion of norm 0.9": _attitude(0.9),
    "attitude with a quaternion of norm 0 ": _attitude(0.0),
    "attitude with a quaternion of norm nan": _attitude(math.nan),
    "angular velocity of 2e+03 rad/s": _attitude(1.0, 2000.0),
    "place at latitude 214, longitude 8": _geo(214.0, 8.0),
    "place at latitude 47, longitude -181": _geo(47.0, -181.0),
    "altitude of 2e+06 m": _geo(47.0, 8.0, 2e6),
    "altitude of -2e+06 m": _geo(47.0, 8.0, 1.0, -2e6),
    "place at latitude -91,": _origin(-91.0),
    "altitude of 1e+06 m": _origin(47.0, 1e6),
    "altitude of 1.5e+06 m": _home(1.5e6),
    "geoid separation of 999 m": _ellipsoid(1000.0),
    "battery with 101 %": _charge(101),
    "parameter MPC_XY_VEL_MAX of nan": _parameter(math.nan),
    "parameter MPC_XY_VEL_MAX of 1e+30": _parameter(1e30),
}


@pytest.mark.parametrize("what", IMPOSSIBLE)
def test_data_that_cannot_be_true_change_nothing_and_are_logged_once(
    what: str, caplog: pytest.LogCaptureFixture
) -> None:
    harness = Harness()
    harness.receive(
        heartbeat(), attitude(), position(0.0), _geo(47.0, 8.0), _origin(47.0), _charge(87), _ellipsoid(48.0),
        _home(400.0), _parameter(12.0), on_ground(), estimator_status(),
    )  # fmt: skip
    before, info = harness.snapshot(), harness.session.info()
    harness.now_s += 0.01
    for _ in range(5):
        harness.receive(IMPOSSIBLE[what])
    after = harness.snapshot()
    kept = ("pose", "velocity", "position_geo", "home_altitude_amsl_m", "geoid_separation_m", "battery", "stamp_s")
    assert {name: value_of(after, name) for name in kept} == {name: value_of(before, name) for name in kept}
    assert after.earth.projection.latitude_deg == 47.0
    assert harness.session.info() == info
    assert [what in record.message for record in caplog.records if "cannot be true" in record.message] == [True]
    assert harness.discovery.link_statistics(harness.now_s).impossible_count == 5
    assert harness.discovery.receiver.corrupt_count == 0


def test_an_autopilot_that_sends_only_impossible_positions_becomes_uninitialized() -> None:
    harness = Harness()
    harness.receive(heartbeat(), attitude(), position(0.0), on_ground(), estimator_status())
    assert state(harness) is State.LANDED_DISARMED
    for _ in range(20):
        harness.now_s += 0.1
        harness.receive(heartbeat(), attitude(), _moving(3e38), on_ground(), estimator_status())
    found = estimate(harness.snapshot(), MavlinkBackend.freshness)
    assert (found.state, found.is_link_up) == (State.UNINITIALIZED, True)


def test_only_the_parameters_that_are_used_are_kept() -> None:
    harness = Harness()
    harness.receive(heartbeat(), _parameter(12.0))
    for number in range(2000):
        harness.receive(_parameter(1.0, b"P%d" % number))
    assert harness.session.telemetry.parameters == {"MPC_XY_VEL_MAX": 12.0}
