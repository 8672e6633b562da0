import math
from collections.abc import Mapping
from dataclasses import astuple
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.ardupilot import RENAMED, RENAMED_IN_4_7_0
from tests.snapshots import changed
from tests.ual_daemon.backends.mavlink.fakes import Harness, ack, attitude, heartbeat, position
from ual.errors import RejectedByAutopilotError, WrongStateError
from ual.geometry import Pose, Vector3
from ual.types import Capability, GeoPoint, Limits
from ual_daemon.backends.engine.limits import RESTART_SILENCE_S
from ual_daemon.backends.firmwares.ardupilot import LONGEST_LEAD_S, velocity_lead
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.values import (
    Control,
    EarthReference,
    MotionState,
    PositionSetpoint,
    Sample,
    Snapshot,
    VelocitySetpoint,
)
from ual_daemon.geodesy import FlatProjection

COPTER = ArduCopter()
GUIDED, LOITER, RTL, LAND, BRAKE = 4, 5, 6, 9, 17
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
SET_MODE, TAKE_OFF = mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_NAV_TAKEOFF
ACCEPTED, FAILED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED


def beat(mode: int = LOITER, *, armed: bool = False, kind: int = mavlink.MAV_TYPE_QUADROTOR) -> Any:
    return heartbeat(mode, armed=armed, autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, kind=kind)


def met(mode: int = LOITER, *, armed: bool = False) -> Harness:
    """A session with an ArduCopter that has answered no request yet."""
    harness = Harness()
    harness.receive(beat(mode, armed=armed))
    return harness


def standing(home_amsl_m: float) -> Snapshot:
    """On the ground 0.2 m above the origin, which is at 488 m."""
    return Snapshot(
        0.0,
        motion=MotionState(pose=Sample(Pose.at(0.0, 0.0, 0.2), 0.0)),
        earth=EarthReference(projection=FlatProjection(47.4, 8.5, 488.0), home_altitude_amsl_m=home_amsl_m),
    )


@pytest.mark.parametrize(
    ("number", "name", "control"),
    [
        (0, "STABILIZE", Control.OTHER),
        (3, "AUTO", Control.OTHER),
        (4, "GUIDED", Control.REFERENCES),
        (5, "LOITER", Control.OTHER),
        (6, "RTL", Control.OTHER),
        (9, "LAND", Control.LAND),
        (17, "BRAKE", Control.OTHER),
        (20, "GUIDED_NOGPS", Control.OTHER),
        (99, "MODE99", Control.OTHER),
    ],
)
def test_modes(number: int, name: str, control: Control) -> None:
    mode = COPTER.mode(number)
    assert (mode.name, mode.control) == (name, control)


def test_a_multirotor_is_executed() -> None:
    info = met().session.info()
    assert info.autopilot == "ArduPilot"
    assert info.capabilities == frozenset(Capability)
    assert info.flies_takeoff_on_setpoints is False


@pytest.mark.parametrize(
    ("kind", "name"),
    [(mavlink.MAV_TYPE_FIXED_WING, "fixed wing"), (mavlink.MAV_TYPE_GROUND_ROVER, "ground rover")],
)
def test_what_is_no_multirotor_is_only_watched(kind: int, name: str) -> None:
    harness = Harness()
    harness.receive(beat(kind=kind))
    info = harness.session.info()
    assert info.autopilot == f"unknown (ardupilotmega, {name})"
    assert info.capabilities == frozenset()


def test_a_velocity_setpoint_has_velocity_and_yaw_rate_only() -> None:
    sent = COPTER.encode_setpoint(VelocitySetpoint(Vector3(1, 2, 3)), MessageSource(3, 1), 0)
    assert (sent.target_system, sent.coordinate_frame) == (3, mavlink.MAV_FRAME_LOCAL_NED)
    assert sent.type_mask == 0b010111000111  # the yaw rate counts: without it the nose turns into the way it flies
    assert (sent.vx, sent.vy, sent.vz, sent.yaw_rate) == (2, 1, -3, 0)


def test_a_position_setpoint_has_all_but_the_acceleration_which_would_go_on_when_setpoints_end() -> None:
    sent = COPTER.encode_setpoint(
        PositionSetpoint(Vector3(1, 2, 3), 0.0, Vector3(4, 5, 6), Vector3(7, 8, 9), 0.5), MessageSource(1, 1), 0
    )
    assert sent.type_mask == 0b000111000000
    assert (sent.x, sent.y, sent.z, sent.vx, sent.vy, sent.vz) == (2, 1, -3, 5, 4, -6)
    assert (sent.yaw, sent.yaw_rate) == pytest.approx((math.pi / 2, -0.5))


SHAPING = {
    "WPNAV_SPEED": 1000.0,
    "WPNAV_SPEED_UP": 250.0,
    "WPNAV_SPEED_DN": 150.0,
    "WPNAV_ACCEL": 250.0,
    "WPNAV_ACCEL_Z": 100.0,
    "PSC_JERK_XY": 5.0,
    "PSC_JERK_Z": 5.0,
}
numbers = st.floats(-20.0, 20.0)


def lead(velocity: Vector3, acceleration: Vector3, parameters: Mapping[str, float] = SHAPING) -> Vector3:
    return velocity_lead(PositionSetpoint(Vector3(), 0.0, velocity, acceleration), parameters)


def test_the_velocity_leads_by_what_its_shaping_takes_for_the_acceleration() -> None:
    led = lead(Vector3(3.0, 0.0, 1.0), Vector3(1.0, -1.0, 0.5))
    assert led == pytest.approx(Vector3(3.7, -0.7, 1.2))
    sent = COPTER.encode_setpoint(
        PositionSetpoint(Vector3(), 0.0, Vector3(3, 0, 1), Vector3(1, -1, 0.5)), MessageSource(1, 1), 0, SHAPING
    )
    assert (sent.vx, sent.vy, sent.vz) == pytest.approx((-0.7, 3.7, -1.2))


def test_at_rest_nothing_leads() -> None:
    assert lead(Vector3(), Vector3()) == Vector3()


@given(st.builds(Vector3, numbers, numbers, numbers), st.builds(Vector3, numbers, numbers, numbers))
def test_the_lead_never_exceeds_its_speed_limits_unless_the_reference_does(v: Vector3, a: Vector3) -> None:
    led = lead(v, a)
    assert led.horizontal_norm() <= max(10.0, v.horizontal_norm()) + 1e-9
    assert min(-1.5, v.z) - 1e-9 <= led.z <= max(2.5, v.z) + 1e-9


@given(st.builds(Vector3, numbers, numbers, numbers), st.builds(Vector3, numbers, numbers, numbers))
def test_the_lead_is_bounded_where_its_jerk_limit_is_low(v: Vector3, a: Vector3) -> None:
    led = lead(v, a, SHAPING | {"PSC_JERK_XY": 0.5, "PSC_JERK_Z": 0.5, "WPNAV_SPEED": 1e6})
    assert (led - v).horizontal_norm() <= LONGEST_LEAD_S * a.horizontal_norm() + 1e-9


@pytest.mark.parametrize("missing", ["WPNAV_ACCEL", "PSC_JERK_XY"])
def test_what_is_not_known_leads_by_nothing(missing: str) -> None:
    known = {name: value for name, value in SHAPING.items() if name != missing}
    assert lead(Vector3(3.0, 0.0, 0.0), Vector3(1.0, 0.0, 0.0), known) == Vector3(3.0, 0.0, 0.0)


@pytest.mark.parametrize(("home_amsl_m", "above_home_m"), [(488.0, 3.2), (488.2, 3.0), (487.5, 3.7)])
def test_the_height_of_a_take_off_is_above_where_it_stands_not_above_home(
    home_amsl_m: float, above_home_m: float
) -> None:
    climb = COPTER.take_off(3.0, standing(home_amsl_m)).then
    assert climb is not None
    assert climb.request.id == TAKE_OFF
    assert climb.request.params[6] == pytest.approx(above_home_m)


def test_it_does_not_take_off_before_home_is_known() -> None:
    with pytest.raises(WrongStateError, match="home"):
        COPTER.take_off(3.0, Snapshot(0.0))


@pytest.mark.parametrize(
    "snapshot", [changed(standing(487.0), projection=None), changed(standing(487.0), home_altitude_amsl_m=None)]
)
def test_where_home_or_origin_was_not_received_yet_its_own_height_above_home_counts(snapshot: Snapshot) -> None:
    place = GeoPoint(47.4, 8.5, altitude_amsl_m=488.2, altitude_home_m=0.3)
    climb = COPTER.take_off(3.0, changed(snapshot, position_geo=place)).then
    assert climb is not None
    assert climb.request.params[6] == pytest.approx(3.3)


@pytest.mark.parametrize("altitude_home_m", [30.0, -30.0, None])
def test_its_own_height_may_be_above_the_home_before_it_was_armed(altitude_home_m: float | None) -> None:
    place = GeoPoint(47.4, 8.5, altitude_home_m=altitude_home_m)
    with pytest.raises(WrongStateError, match="home"):
        COPTER.take_off(3.0, Snapshot(0.0, motion=MotionState(position_geo=place)))


def test_a_take_off_begins_in_guided() -> None:
    harness = met(armed=True)
    done = harness.session.submit(COPTER.take_off(3.0, standing(488.2)), harness.now_s)
    (mode,) = harness.commands(SET_MODE)
    assert (mode.param1, mode.param2) == (1, GUIDED)
    harness.run(0.1)
    assert harness.commands(TAKE_OFF) == []
    harness.receive(ack(SET_MODE, ACCEPTED))
    (climb,) = harness.commands(TAKE_OFF)
    assert climb.param7 == pytest.approx(3.0)
    assert not done.done()
    harness.receive(ack(TAKE_OFF, ACCEPTED))
    assert done.done()
    assert done.exception() is None


def test_a_take_off_that_is_refused_or_not_in_guided_fails_in_the_autopilots_words() -> None:
    harness = met(armed=True)
    done = harness.session.submit(COPTER.take_off(3.0, standing(488.2)), harness.now_s)
    harness.receive(mavlink.MAVLink_statustext_message(4, b"Mode change to GUIDED failed: requires position"))
    harness.receive(ack(SET_MODE, FAILED))
    harness.run(0.2)
    error = done.exception(0)
    assert isinstance(error, RejectedByAutopilotError)
    assert "refused to take off: FAILED; it said: Mode change to GUIDED failed" in str(error)
    assert harness.commands(TAKE_OFF) == []


def test_a_take_off_that_was_withdrawn_is_not_begun() -> None:
    harness = met(armed=True)
    harness.session.submit(COPTER.take_off(3.0, standing(488.2)), harness.now_s).cancel()
    harness.run(0.1)
    harness.receive(ack(SET_MODE, ACCEPTED))
    harness.run(1.0)
    assert harness.commands(TAKE_OFF) == []


def test_its_own_hold_is_brake() -> None:
    assert COPTER.hold().request.params == (
        1,
        BRAKE,
    )  # LOITER would follow the throttle stick, which may be at its bottom


OF_4_6 = SHAPING | {"ATC_SLEW_YAW": 6000.0}


def renamed(new_names: Mapping[str, tuple[str, float]]) -> dict[str, float]:
    return {new: OF_4_6[old] / per_unit for old, (new, per_unit) in new_names.items()}


VERSIONS = [OF_4_6, renamed(RENAMED_IN_4_7_0), renamed(RENAMED)]
CAREFUL = Limits(1.6, 1.2, 1.2, 0.6, 0.3, math.radians(32.5))


@pytest.mark.parametrize("read", VERSIONS)
def test_limits_are_its_parameters_by_the_names_and_units_of_each_version(read: dict[str, float]) -> None:
    assert COPTER.limits(read) == Limits(10.0, 2.5, 1.5, 1.5, 0.6, math.radians(60.0))  # it needs some to catch up by
    assert COPTER.acceleration_share(read) == 0.6
    setpoint = PositionSetpoint(Vector3(), 0.0, Vector3(3.0, 0.0, 1.0), Vector3(1.0, -1.0, 0.5))
    assert velocity_lead(setpoint, read) == pytest.approx(Vector3(3.7, -0.7, 1.2))
    assert not {name for name in COPTER.missing_parameters(read) if not name.startswith("FENCE_")}
    assert not {name for name in COPTER.absent_parameters(read) if name.startswith(("W", "P", "A"))}
    assert COPTER.limits(dict.fromkeys(read, 0.0)) == CAREFUL


@pytest.mark.parametrize("read", VERSIONS)
def test_a_limit_that_did_not_come_is_the_lowest_that_any_version_ships(read: dict[str, float]) -> None:
    assert COPTER.limits({}) == CAREFUL
    assert COPTER.acceleration_share({}) == 1.0
    for missing in read:
        known = {name: value for name, value in read.items() if name != missing}
        assumed, true = astuple(COPTER.limits(known)), astuple(COPTER.limits(read))
        assert all(each <= limit for each, limit in zip(assumed, true, strict=True))
        (name,) = (each for each in COPTER.missing_parameters(known) if not each.startswith("FENCE_"))
        assert missing in name.split(" or ")


def test_both_names_of_a_parameter_are_requested_until_one_has_come() -> None:
    harness = met()
    harness.run(0.5)
    asked = [message.param_id for message in harness.link.take("PARAM_REQUEST_READ")]
    assert {"WP_SPD", "WPNAV_SPEED"} <= set(asked)
    harness.receive(mavlink.MAVLink_param_value_message(b"WP_SPD", 5.0, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0))
    harness.run(1.0)
    asked = [message.param_id for message in harness.link.take("PARAM_REQUEST_READ")]
    assert not {"WP_SPD", "WPNAV_SPEED"} & set(asked)
    assert "WPNAV_ACCEL" in asked


def test_what_is_assumed_ends_the_reason_of_the_state_until_the_parameters_come() -> None:
    harness = met()
    for name, value in OF_4_6.items():
        if name != "WPNAV_ACCEL":
            kind = mavlink.MAV_PARAM_TYPE_REAL32
            harness.receive(mavlink.MAVLink_param_value_message(name.encode(), value, kind, 1, 0))
    for name in COPTER.parameters:
        if name.startswith("FENCE_"):
            harness.receive(mavlink.MAVLink_param_value_message(name.encode(), 0.0, 9, 1, 0))
    assert harness.session.info().note == ""
    harness.run(6.0)
    assert harness.session.info().note == (
        "it has not sent WP_ACC or WPNAV_ACCEL: assumed are at most 10 m/s, 2.5 m/s up and 1.5 m/s down, 0.6 m/s^2 "
        "and vertically 0.6 m/s^2, 1.05 rad/s; no fence of its own but what was read"
    )
    harness.receive(mavlink.MAVLink_param_value_message(b"WP_ACC", 2.5, 9, 1, 0))
    assert harness.session.info().note == ""


def test_a_fence_whose_parameters_did_not_come_is_reported() -> None:
    fence = COPTER.autopilot_fence({"FENCE_ENABLE": 1.0}, is_enabled=True)
    assert (fence.limits, fence.unread) == ((), "FENCE_TYPE, which it has not sent")
    fence = COPTER.autopilot_fence({"FENCE_ENABLE": 1.0, "FENCE_TYPE": 3.0, "FENCE_ALT_MAX": 50.0}, is_enabled=True)
    assert [each.value_m for each in fence.limits] == [50.0]
    assert fence.unread == "FENCE_RADIUS, which it has not sent"


def version(board_type: int = 0, usb: tuple[int, int] = (0, 0)) -> Any:
    """Its AUTOPILOT_VERSION; a simulator has no board."""
    nothing = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        64495, 0x040603FF, 0, 0, board_type << 16, nothing, nothing, nothing, *usb, 0
    )


def test_a_parameter_of_the_simulator_and_no_board_tell_that_it_is_one() -> None:
    harness = met()
    assert harness.session.judge_simulation().is_simulated is None
    harness.receive(version())
    assert harness.session.judge_simulation().is_simulated is None
    assert harness.session.info().is_simulation is False
    harness.receive(mavlink.MAVLink_param_value_message(b"SIM_SPEEDUP", -1.0, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0))
    assert harness.session.judge_simulation().is_simulated is True
    assert harness.session.info().is_simulation is True


@pytest.mark.parametrize(("board_type", "usb"), [(50, (0, 0)), (0, (0x1209, 0x5740))])
def test_on_a_board_it_is_no_simulator_even_where_it_simulates(board_type: int, usb: tuple[int, int]) -> None:
    harness = met()
    harness.receive(version(board_type, usb))
    harness.receive(mavlink.MAVLink_param_value_message(b"SIM_SPEEDUP", 1.0, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0))
    assert harness.session.judge_simulation().is_simulated is False
    assert "flight controller" in harness.session.judge_simulation().why


@pytest.mark.parametrize(
    ("flags", "why"),
    [
        (831, ""),
        (831 - 16, ""),  # a relative position (optical flow) is good enough
        (831 - 8 - 16, "no horizontal position"),
        (167, "it assumes that it stands still (no GPS or other position yet)"),
        (0, "no attitude, horizontal velocity, vertical velocity, horizontal position, height"),
    ],
)
def test_its_estimator_is_assessed_by_its_flags(flags: int, why: str) -> None:
    harness = met()
    harness.receive(mavlink.MAVLink_ekf_status_report_message(flags, 0, 0, 0, 0, 0))
    found = harness.snapshot().motion.estimator.value
    assert (found.is_good, found.why) == (not why, why)


def test_it_is_requested_everything_since_nothing_comes_by_itself() -> None:
    harness = met()
    asked: set[int] = set()
    for _ in range(20):
        harness.run(0.05)
        for command in harness.commands(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL):
            asked.add(int(command.param1))
            harness.receive(ack(command.command, ACCEPTED))
    assert asked == {int(command.request.params[0]) for command in COPTER.streams(50.0)}
    assert mavlink.MAVLINK_MSG_ID_HEARTBEAT in asked


def test_it_is_requested_anew_when_it_booted_so_fast_that_its_silence_was_not_noticed() -> None:
    harness = met()
    for _ in range(20):
        harness.run(0.05)
        for _ in harness.commands(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL):
            harness.receive(ack(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, ACCEPTED))
    harness.receive(attitude(), position(harness.now_s))
    streamed_s = harness.now_s
    harness.link.sent.clear()
    while harness.now_s < streamed_s + RESTART_SILENCE_S + 0.5:
        harness.run(0.1)
        harness.receive(beat())  # the only thing it sends unasked
    asked = {sent.param1 for sent in harness.commands(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)}
    assert mavlink.MAVLINK_MSG_ID_HEARTBEAT in asked  # though this one does flow: it is a new meeting


@pytest.mark.parametrize("mode", [LAND, BRAKE, RTL])
def test_its_mode_is_changed_when_somebody_asks_to_arm_it_where_it_cannot_be_armed_and_not_before(mode: int) -> None:
    harness = met(GUIDED, armed=True)
    harness.setpoints.sent_for_s = 1.0
    harness.run(0.1)
    harness.setpoints.sent_for_s = 0.0
    harness.receive(beat(mode, armed=True), beat(mode))
    harness.run(5.0)
    assert harness.commands(SET_MODE) == []
    harness.receive(beat(mode))
    harness.session.submit(COPTER.arm(harness.snapshot()), harness.now_s)
    assert [sent.param2 for sent in harness.commands(SET_MODE)] == [GUIDED]
    harness.receive(ack(SET_MODE, ACCEPTED))
    assert len(harness.commands(ARM)) == 1


@pytest.mark.parametrize("mode", [3, 18, 99])
def test_a_mode_in_which_arming_may_start_a_flight_is_left_and_observed_to_be(mode: int) -> None:
    harness = met(mode)
    harness.session.submit(COPTER.arm(harness.snapshot()), harness.now_s)
    harness.receive(ack(SET_MODE, ACCEPTED), beat(mode))
    assert harness.link.take("COMMAND_LONG")[-1].command != ARM  # it says that it obeys, but is still there
    harness.run(0.05)
    harness.receive(beat(GUIDED))
    harness.run(0.05)
    assert len(harness.commands(ARM)) == 1


@pytest.mark.parametrize("mode", [LOITER, GUIDED, 0])
def test_a_mode_in_which_it_may_be_armed_is_the_pilots_choice(mode: int) -> None:
    harness = met(mode)
    harness.session.submit(COPTER.arm(harness.snapshot()), harness.now_s)
    (sent,) = [message for message in harness.link.take("COMMAND_LONG") if message.command in (ARM, SET_MODE)]
    assert sent.command == ARM


def test_a_take_off_that_has_begun_is_believed_over_the_refusal_of_its_repetition() -> None:
    harness = met(armed=True)
    done = harness.session.submit(COPTER.take_off(3.0, standing(488.2)), harness.now_s)
    harness.run(0.05)
    harness.receive(beat(GUIDED, armed=True))  # the acknowledgements of both commands are lost
    harness.run(0.2)
    harness.receive(beat(GUIDED, armed=True))  # it is not repeated while nothing is heard
    harness.run(0.1)
    assert len(harness.commands(TAKE_OFF)) == 2
    harness.receive(ack(TAKE_OFF, FAILED))
    harness.run(0.1)
    assert not done.done()
    harness.receive(mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_TAKEOFF))
    harness.run(0.05)
    assert done.result(0) is None
