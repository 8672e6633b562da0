import math
from typing import Any

import pytest

from tests.ual_daemon.backends.mavlink.fakes import Talk, ack, attitude, heartbeat, position
from ual.errors import RejectedByAutopilotError, WrongStateError
from ual.geometry import Pose, Vector3
from ual.types import Capability, Limits
from ual_daemon.backends.mavlink.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.messages import mavlink
from ual_daemon.backends.mavlink.vehicle import SILENCE_S
from ual_daemon.backends.values import Control, PositionSetpoint, Sample, Snapshot, VelocitySetpoint
from ual_daemon.geodesy import FlatProjection

COPTER = ArduCopter()
GUIDED, LOITER, LAND, BRAKE = 4, 5, 9, 17
SET_MODE, TAKE_OFF = mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_NAV_TAKEOFF
ACCEPTED, FAILED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED


def beat(mode: int = LOITER, *, armed: bool = False, kind: int = mavlink.MAV_TYPE_QUADROTOR) -> Any:
    return heartbeat(mode, armed=armed, autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, kind=kind)


def met(mode: int = LOITER, *, armed: bool = False) -> Talk:
    """A conversation with an ArduCopter that has answered no question yet."""
    talk = Talk()
    talk.hear(beat(mode, armed=armed))
    return talk


def standing(home_amsl_m: float) -> Snapshot:
    """On the ground 0.2 m above the origin, which is at 488 m."""
    return Snapshot(
        0.0,
        pose=Sample(Pose.at(0.0, 0.0, 0.2), 0.0),
        projection=FlatProjection(47.4, 8.5, 488.0),
        home_altitude_amsl_m=home_amsl_m,
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


def test_a_multirotor_is_flown() -> None:
    info = met().vehicle.info()
    assert info.autopilot == "ArduPilot"
    assert info.capabilities == frozenset(Capability)
    assert info.flies_takeoff_on_setpoints is False


@pytest.mark.parametrize(
    ("kind", "name"),
    [(mavlink.MAV_TYPE_FIXED_WING, "fixed wing"), (mavlink.MAV_TYPE_GROUND_ROVER, "ground rover")],
)
def test_what_is_no_multirotor_is_only_watched(kind: int, name: str) -> None:
    talk = Talk()
    talk.hear(beat(kind=kind))
    info = talk.vehicle.info()
    assert info.autopilot == f"unknown (ardupilotmega, {name})"
    assert info.capabilities == frozenset()


def test_a_velocity_setpoint_has_velocity_and_yaw_rate_only() -> None:
    sent = COPTER.setpoint(VelocitySetpoint(Vector3(1, 2, 3)), 3, 0)
    assert (sent.target_system, sent.coordinate_frame) == (3, mavlink.MAV_FRAME_LOCAL_NED)
    assert sent.type_mask == 0b010111000111  # the yaw rate counts: without it the nose turns into the way it flies
    assert (sent.vx, sent.vy, sent.vz, sent.yaw_rate) == (2, 1, -3, 0)


def test_a_position_setpoint_has_all_but_the_acceleration_which_would_go_on_when_setpoints_end() -> None:
    sent = COPTER.setpoint(PositionSetpoint(Vector3(1, 2, 3), 0.0, Vector3(4, 5, 6), Vector3(7, 8, 9), 0.5), 1, 0)
    assert sent.type_mask == 0b000111000000
    assert (sent.x, sent.y, sent.z, sent.vx, sent.vy, sent.vz) == (2, 1, -3, 5, 4, -6)
    assert (sent.yaw, sent.yaw_rate) == pytest.approx((math.pi / 2, -0.5))


@pytest.mark.parametrize(("home_amsl_m", "above_home_m"), [(488.0, 3.2), (488.2, 3.0), (487.5, 3.7)])
def test_the_height_of_a_take_off_is_above_where_it_stands_not_above_home(
    home_amsl_m: float, above_home_m: float
) -> None:
    climb = COPTER.take_off(3.0, standing(home_amsl_m)).then
    assert climb is not None
    assert climb.id == TAKE_OFF
    assert climb.params[6] == pytest.approx(above_home_m)


def test_it_does_not_take_off_before_home_is_known() -> None:
    with pytest.raises(WrongStateError, match="home"):
        COPTER.take_off(3.0, Snapshot(0.0))


def test_a_take_off_begins_in_guided() -> None:
    talk = met(armed=True)
    done = talk.vehicle.submit(COPTER.take_off(3.0, standing(488.2)), talk.now_s)
    (mode,) = talk.commands(SET_MODE)
    assert (mode.param1, mode.param2) == (1, GUIDED)
    talk.run(0.1)
    assert talk.commands(TAKE_OFF) == []
    talk.hear(ack(SET_MODE, ACCEPTED))
    (climb,) = talk.commands(TAKE_OFF)
    assert climb.param7 == pytest.approx(3.0)
    assert not done.done()
    talk.hear(ack(TAKE_OFF, ACCEPTED))
    assert done.done()
    assert done.exception() is None


def test_a_take_off_that_is_refused_or_not_in_guided_fails_in_the_autopilots_words() -> None:
    talk = met(armed=True)
    done = talk.vehicle.submit(COPTER.take_off(3.0, standing(488.2)), talk.now_s)
    talk.hear(mavlink.MAVLink_statustext_message(4, b"Mode change to GUIDED failed: requires position"))
    talk.hear(ack(SET_MODE, FAILED))
    talk.run(0.2)
    error = done.exception(0)
    assert isinstance(error, RejectedByAutopilotError)
    assert "refused to take off: FAILED; it said: Mode change to GUIDED failed" in str(error)
    assert talk.commands(TAKE_OFF) == []


def test_a_take_off_that_was_withdrawn_is_not_begun() -> None:
    talk = met(armed=True)
    is_withdrawn = False
    talk.vehicle.submit(COPTER.take_off(3.0, standing(488.2)), talk.now_s, lambda: is_withdrawn)
    is_withdrawn = True
    talk.run(0.1)
    talk.hear(ack(SET_MODE, ACCEPTED))
    talk.run(1.0)
    assert talk.commands(TAKE_OFF) == []


def test_its_own_hold_is_brake() -> None:
    assert COPTER.hold().params == (1, BRAKE)  # LOITER would follow the throttle stick, which may be at its bottom


def test_limits_are_its_parameters_in_other_units() -> None:
    assert COPTER.limits({}) == Limits()
    read = {
        "WPNAV_SPEED": 1000.0,
        "WPNAV_SPEED_UP": 250.0,
        "WPNAV_SPEED_DN": 150.0,
        "WPNAV_ACCEL": 250.0,
        "WPNAV_ACCEL_Z": 100.0,
        "ATC_SLEW_YAW": 6000.0,
        "SIM_SPEEDUP": 1.0,
    }
    assert set(read) == set(COPTER.parameters)
    assert COPTER.limits(read) == Limits(10.0, 2.5, 1.5, 1.5, 0.6, math.radians(60.0))  # it needs some to catch up by
    assert COPTER.limits(dict.fromkeys(read, 0.0)) == Limits()


def test_a_parameter_of_the_simulator_tells_that_it_is_one() -> None:
    talk = met()
    assert talk.vehicle.info().is_simulation is False
    talk.hear(mavlink.MAVLink_param_value_message(b"SIM_SPEEDUP", -1.0, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0))
    assert talk.vehicle.info().is_simulation is True


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
def test_its_estimator_is_judged_by_its_flags(flags: int, why: str) -> None:
    talk = met()
    talk.hear(mavlink.MAVLink_ekf_status_report_message(flags, 0, 0, 0, 0, 0))
    found = talk.snapshot().estimator.value
    assert (found.is_good, found.why) == (not why, why)


def test_it_is_asked_for_everything_since_nothing_comes_by_itself() -> None:
    talk = met()
    asked: set[int] = set()
    for _ in range(20):
        talk.run(0.05)
        for command in talk.commands(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL):
            asked.add(int(command.param1))
            talk.hear(ack(command.command, ACCEPTED))
    assert asked == {int(command.params[0]) for command in COPTER.streams(50.0)}
    assert mavlink.MAVLINK_MSG_ID_HEARTBEAT in asked


def test_it_is_asked_anew_when_it_booted_so_fast_that_its_silence_was_not_noticed() -> None:
    talk = met()
    for _ in range(20):
        talk.run(0.05)
        for _ in talk.commands(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL):
            talk.hear(ack(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, ACCEPTED))
    talk.hear(attitude(), position(talk.now_s))
    talk.run(1.0)
    assert talk.commands(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL) == []
    while talk.now_s < 2.0 + SILENCE_S:
        talk.run(0.5)
        talk.hear(beat())  # the only thing it sends unasked
    assert talk.commands(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)


def test_after_a_landing_of_ours_it_is_left_in_a_mode_in_which_it_can_be_armed() -> None:
    talk = met(GUIDED, armed=True)
    talk.setpoints_s = 1.0
    talk.run(0.1)
    talk.setpoints_s = 0.0
    talk.hear(beat(LAND, armed=True))
    talk.run(1.0)
    assert talk.commands(SET_MODE) == []
    talk.hear(beat(LAND))
    talk.run(0.1)
    (mode,) = talk.commands(SET_MODE)
    assert mode.param2 == LOITER


def test_after_a_landing_of_the_pilots_nothing_is_changed() -> None:
    talk = met(LAND, armed=True)
    talk.run(0.1)
    talk.hear(beat(LAND))
    talk.run(1.0)
    assert talk.commands(SET_MODE) == []
