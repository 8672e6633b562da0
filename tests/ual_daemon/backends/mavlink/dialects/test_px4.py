import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.fakes import Harness, heartbeat
from ual.errors import NotSupportedError
from ual.geometry import Vector3
from ual.types import Capability, Limits
from ual_daemon.backends.firmwares.autopilot import version_text
from ual_daemon.backends.firmwares.px4 import ACCELERATION_SHARE
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.dialects.unknown import Unknown
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Codec, Message, TargetMessage
from ual_daemon.backends.values import Control, PositionSetpoint, Snapshot, VelocitySetpoint

PX4 = Px4()


def custom_mode(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


@pytest.mark.parametrize(
    ("main", "sub", "name", "control"),
    [
        (1, 0, "MANUAL", Control.OTHER),
        (2, 0, "ALTCTL", Control.OTHER),
        (3, 0, "POSCTL", Control.OTHER),
        (3, 2, "POSCTL.SLOW", Control.OTHER),
        (4, 2, "AUTO.TAKEOFF", Control.TAKE_OFF),
        (4, 3, "AUTO.LOITER", Control.OTHER),
        (4, 4, "AUTO.MISSION", Control.OTHER),
        (4, 5, "AUTO.RTL", Control.OTHER),
        (4, 6, "AUTO.LAND", Control.LAND),
        (4, 9, "AUTO.PRECLAND", Control.LAND),
        (4, 11, "AUTO.EXTERNAL1", Control.OTHER),
        (4, 19, "AUTO.COURSE", Control.OTHER),
        (6, 0, "OFFBOARD", Control.REFERENCES),
        (7, 0, "STABILIZED", Control.OTHER),
        (4, 99, "AUTO.99", Control.OTHER),
        (200, 0, "MODE200", Control.OTHER),
    ],
)
def test_modes(main: int, sub: int, name: str, control: Control) -> None:
    mode = PX4.mode(custom_mode(main, sub))
    assert (mode.name, mode.control) == (name, control)


def test_a_position_setpoint_carries_motion_and_heading_in_local_ned() -> None:
    setpoint = PositionSetpoint(Vector3(1, 2, 3), 0.0, Vector3(4, 5, 6), Vector3(7, 8, 9), yaw_rate_rad_s=0.5)
    sent = PX4.encode_setpoint(setpoint, MessageSource(7, 1), 1234)
    assert (sent.target_system, sent.target_component, sent.time_boot_ms) == (7, 1, 1234)
    assert sent.coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED
    assert sent.type_mask == 0
    assert (sent.x, sent.y, sent.z) == (2, 1, -3)
    assert (sent.vx, sent.vy, sent.vz) == (5, 4, -6)
    assert (sent.afx, sent.afy, sent.afz) == (8, 7, -9)
    assert (sent.yaw, sent.yaw_rate) == pytest.approx((math.pi / 2, -0.5))


def test_a_velocity_setpoint_carries_velocity_and_yaw_rate_only() -> None:
    sent = PX4.encode_setpoint(VelocitySetpoint(Vector3(1, 2, 3), yaw_rate_rad_s=0.5), MessageSource(1, 1), 0)
    assert sent.type_mask == 0b010111000111
    assert (sent.vx, sent.vy, sent.vz, sent.yaw_rate) == (2, 1, -3, -0.5)


@given(
    st.lists(st.sampled_from([0.0, -0.0, 1.0]) | st.floats(width=32), min_size=11, max_size=11),
    st.integers(0, 0xFFFFFFFF),
    st.integers(0, 255),
    st.sampled_from([0, 1, 8]),
)
def test_setpoints_are_framed_as_pymavlink_frames_them(
    values: list[float], time_ms: int, sequence: int, frame: int
) -> None:
    sender, codec = mavlink.MAVLink(None, srcSystem=7, srcComponent=191), Codec(191)
    codec.join(7)
    sender.seq = codec._number = sequence
    ids = (time_ms, 7, 1, frame, 0b110111111000)
    theirs = mavlink.MAVLink_set_position_target_local_ned_message(*ids, *values).pack(sender)
    assert codec.encode(TargetMessage(*ids, *values)) == theirs


CAREFUL = Limits(1.6, 1.2, 1.0, 3.0 * ACCELERATION_SHARE, 1.2, math.radians(45.0))


def test_limits_are_the_parameters_and_the_lowest_that_ship_until_they_are_read() -> None:
    assert PX4.limits({}) == CAREFUL
    assert PX4.cruise_speed_m_s({}) == 5.0
    assert PX4.limits({"MPC_ACC_UP_MAX": 4.0}).vertical_acceleration_m_s2 == 1.2  # the other may be lower
    read = {
        "MPC_XY_VEL_MAX": 12.0,
        "MPC_Z_VEL_MAX_UP": 3.0,
        "MPC_Z_VEL_MAX_DN": 1.5,
        "MPC_ACC_HOR": 3.0,
        "MPC_ACC_UP_MAX": 4.0,
        "MPC_ACC_DOWN_MAX": 2.5,
        "MPC_YAWRAUTO_MAX": 180.0,
    }
    gains = {"MPC_XY_VEL_P_ACC", "MPC_XY_VEL_D_ACC", "MPC_Z_VEL_P_ACC", "MPC_Z_VEL_D_ACC"}
    others = {"MPC_XY_CRUISE", "COM_OF_LOSS_T"} | gains
    assert set(read) | others == {name for name in PX4.parameters if not name.startswith("GF_")}
    assert PX4.limits(read) == Limits(
        12.0, 3.0, 1.5, 3.0 * ACCELERATION_SHARE, 2.5 * ACCELERATION_SHARE, math.radians(180.0)
    )


def test_a_velocity_setpoint_with_an_acceleration_carries_that_too() -> None:
    setpoint = VelocitySetpoint(Vector3(1, 2, 3), 0.5, Vector3(0.1, 0.2, 0.3))
    sent = PX4.encode_setpoint(setpoint, MessageSource(1, 1), 0)
    assert sent.type_mask == 0b010000000111
    assert (sent.vx, sent.vy, sent.vz) == (2.0, 1.0, -3.0)
    assert (sent.afx, sent.afy, sent.afz) == (0.2, 0.1, -0.3)


def test_it_follows_a_velocity_as_its_gains_say() -> None:
    assert PX4.velocity_responses({}).horizontal.time_s == pytest.approx(1.2 / 1.8)
    assert PX4.velocity_responses({}).vertical.time_s == pytest.approx(0.25)
    read = {"MPC_XY_VEL_P_ACC": 3.0, "MPC_XY_VEL_D_ACC": 0.5, "MPC_Z_VEL_P_ACC": 5.0, "MPC_Z_VEL_D_ACC": 0.1}
    responses = PX4.velocity_responses(read)
    assert responses.horizontal.time_s == pytest.approx(0.5)
    assert responses.vertical.time_s == pytest.approx(0.22)
    assert not responses.horizontal.holds_place


def test_a_limit_of_zero_or_less_is_none() -> None:
    assert PX4.limits(dict.fromkeys(PX4.parameters, 0.0)) == CAREFUL
    assert PX4.limits(dict.fromkeys(PX4.parameters, -1.0)) == CAREFUL


def version_message(uid: int, version: int = 0x011100FF) -> Message:
    return mavlink.MAVLink_autopilot_version_message(0, version, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, uid)


def test_px4s_simulator_is_reported_by_its_unique_id() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    assert harness.session.info().is_simulation is False
    first = 5283920058631409237 - 6  # as recorded of system 7
    harness.receive(version_message(first))
    info = harness.session.info()
    assert (info.autopilot, info.autopilot_version, info.is_simulation) == ("PX4", "1.17.0", True)
    harness.receive(version_message(0x0001000200030004))
    assert harness.session.info().is_simulation is False


def test_hardware_in_the_loop_is_a_simulation() -> None:
    harness = Harness()
    beat = heartbeat()
    beat.base_mode |= mavlink.MAV_MODE_FLAG_HIL_ENABLED
    harness.receive(beat)
    assert harness.session.info().is_simulation is True


@pytest.mark.parametrize(
    ("number", "text"),
    [(0x011100FF, "1.17.0"), (0x010F0380, "1.15.3 beta"), (0x01100000, "1.16.0 dev"), (0x011000C0, "1.16.0 rc")],
)
def test_versions_are_reported_for_people(number: int, text: str) -> None:
    assert version_text(number) == text


def test_an_unknown_autopilot_is_received_but_not_controlled() -> None:
    harness = Harness()
    harness.receive(heartbeat(5, armed=True, autopilot=mavlink.MAV_AUTOPILOT_GENERIC))
    snapshot, info = harness.snapshot(), harness.session.info()
    assert snapshot.control.armed.value is True
    assert (snapshot.control.mode.value.name, snapshot.control.mode.value.control) == (
        "number 5",
        Control.OTHER,
    )  # told as "mode number 5"
    assert info.autopilot == "unknown (generic, quadrotor)"
    assert info.capabilities == frozenset()
    assert info.capabilities < PX4.capabilities == frozenset(Capability)


@pytest.mark.parametrize(
    "fly",
    [
        lambda dialect: dialect.arm(Snapshot(0.0)),
        lambda dialect: dialect.disarm(),
        lambda dialect: dialect.take_off(3.0, Snapshot(0.0)),
        lambda dialect: dialect.land(),
        lambda dialect: dialect.take_control(),
        lambda dialect: dialect.hold(),
        lambda dialect: dialect.encode_setpoint(VelocitySetpoint(Vector3()), MessageSource(1, 1), 0),
    ],
)
def test_flying_an_unknown_autopilot_is_not_supported(fly: Callable[[Dialect], object]) -> None:
    with pytest.raises(NotSupportedError, match=r"only watches an autopilot that is unknown \(autopilot 99\)"):
        fly(Unknown(99))
