"""Our packets are those of cflib, for each version of the protocol."""

from __future__ import annotations

import math
import struct
import warnings
from collections.abc import Callable
from typing import Any

import pytest
from cflib.crazyflie.commander import Commander
from cflib.crazyflie.high_level_commander import HighLevelCommander
from cflib.crazyflie.localization import Localization
from cflib.crazyflie.supervisor import Supervisor
from cflib.utils.encoding import decompress_quaternion
from hypothesis import given
from hypothesis import strategies as st

from ual.geometry import Quaternion, Vector3
from ual_daemon.backends.crazyflie import packets
from ual_daemon.backends.crazyflie.encoder import Encoder
from ual_daemon.backends.crazyflie.packets import CrtpPacket
from ual_daemon.backends.values import PositionSetpoint, VelocitySetpoint

PROTOCOLS = pytest.mark.parametrize("protocol", [7, 8, 9, 11, 12])
PLACE, YAW_RAD = Vector3(1.5, -2.25, 0.75), 0.5


class Cflib:
    """Stands in for `cflib.crazyflie.Crazyflie`, and keeps what is sent."""

    def __init__(self, protocol: int) -> None:
        self.platform = self
        self._protocol = protocol
        self.sent: list[bytes] = []

    def get_protocol_version(self) -> int:
        return self._protocol

    def add_port_callback(self, port: int, callback: object) -> None:
        """Nothing answers."""

    def send_packet(self, packet: Any) -> None:
        self.sent.append(bytes((packet.get_header(),)) + bytes(packet.data))


def sent_by_cflib(protocol: int, send: Callable[[Any], None]) -> bytes:
    cflib = Cflib(protocol)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        send(cflib)
    (data,) = cflib.sent
    return data


@PROTOCOLS
def test_velocities(protocol: int) -> None:
    theirs = sent_by_cflib(protocol, lambda cf: Commander(cf).send_velocity_world_setpoint(0.5, 0.25, -0.125, 90.0))
    assert packets.velocity_setpoint(Vector3(0.5, 0.25, -0.125), math.radians(90.0), protocol).encode() == theirs


@PROTOCOLS
def test_positions(protocol: int) -> None:
    theirs = sent_by_cflib(protocol, lambda cf: Commander(cf).send_position_setpoint(*PLACE, math.degrees(YAW_RAD)))
    assert packets.position_setpoint(PLACE, YAW_RAD).encode() == theirs


@PROTOCOLS
def test_the_end_of_setpoints(protocol: int) -> None:
    assert packets.setpoints_stop().encode() == sent_by_cflib(
        protocol, lambda cf: Commander(cf).send_notify_setpoint_stop()
    )


@PROTOCOLS
def test_go_to(protocol: int) -> None:
    theirs = sent_by_cflib(protocol, lambda cf: HighLevelCommander(cf).go_to(*PLACE, YAW_RAD, 2.0))
    assert packets.go_to(PLACE, YAW_RAD, 2.0, protocol).encode() == theirs


@PROTOCOLS
def test_land(protocol: int) -> None:
    theirs = sent_by_cflib(protocol, lambda cf: HighLevelCommander(cf).land(0.25, 2.0, yaw=None))
    assert packets.land(0.25, 2.0).encode() == theirs


@PROTOCOLS
@pytest.mark.parametrize("is_armed", [True, False])
def test_arming(protocol: int, is_armed: bool) -> None:
    theirs = sent_by_cflib(protocol, lambda cf: Supervisor(cf).send_arming_request(is_armed))
    assert packets.arm(protocol, is_armed=is_armed).encode() == theirs


def test_external_poses() -> None:
    orientation = Quaternion.from_yaw(0.5)
    theirs = sent_by_cflib(12, lambda cf: Localization(cf).send_extpose(list(PLACE), list(orientation)))
    assert packets.external_pose(PLACE, orientation).encode() == theirs


def test_external_positions() -> None:
    theirs = sent_by_cflib(12, lambda cf: Localization(cf).send_extpos(list(PLACE)))
    assert packets.external_position(PLACE).encode() == theirs


def test_the_whole_motion() -> None:
    """But for the yaw rate: cflib takes degrees, and the firmware reads milliradians."""
    at, motion, turn = list(PLACE), [0.5, -0.25, 0.125], list(Quaternion.from_yaw(YAW_RAD))
    theirs = sent_by_cflib(
        12, lambda cf: Commander(cf).send_full_state_setpoint(at, motion, motion, turn, 0.0, 0.0, 0.5)
    )
    assert packets.full_state(PLACE, Vector3(*motion), Vector3(*motion), YAW_RAD, 0.5).encode() == theirs


def test_the_whole_motion_is_never_too_large() -> None:
    packet = packets.full_state(Vector3(), Vector3(100.0, 0.0, 0.0), Vector3(0.0, -100.0, 0.0), 0.0, 50.0)
    values = struct.unpack("<9hI3h", packet.data[1:])
    assert (values[3], values[7], values[12]) == (32767, -32767, 32767)


angles = st.floats(-math.pi, math.pi)


@given(angles, st.floats(-1.5, 1.5), angles)
def test_rotations_in_32_bits(roll_rad: float, pitch_rad: float, yaw_rad: float) -> None:
    q = Quaternion.from_euler(roll_rad, pitch_rad, yaw_rad)
    packed = packets.compress(q)
    assert tuple(packets.decompress(packed)) == pytest.approx(tuple(decompress_quaternion(packed)), abs=1e-9)
    alike = abs(sum(a * b for a, b in zip(q, packets.decompress(packed), strict=True)))
    assert alike == pytest.approx(1.0, abs=1e-4)


@given(st.binary(max_size=31))
def test_any_bytes_are_a_packet_or_nothing(data: bytes) -> None:
    packet = CrtpPacket.decode(data)
    assert packet is None or packet.encode()[1:] == data[1:]


def test_a_position_for_the_pid_controller_lies_ahead() -> None:
    """It flies at its gain times the distance: 2 per second, and 6 per second for the heading."""
    encoder = Encoder(7, {"posCtlPid.xKp": 2.0, "posCtlPid.zKp": 4.0, "pid_attitude.yaw_kp": 5.0})
    setpoint = PositionSetpoint(Vector3(1.0, 0.0, 1.0), 0.0, Vector3(0.5, 0.0, 0.4), yaw_rate_rad_s=0.5)
    assert encoder.encode(setpoint) == packets.position_setpoint(Vector3(1.25, 0.0, 1.1), 0.1)


def test_the_pid_controller_is_helped_with_what_is_missing() -> None:
    encoder, goal = Encoder(7, {}), PositionSetpoint(Vector3(1.0, 2.0, 3.0), 0.0)
    assert encoder.encode(goal, Vector3(0.8, 2.0, 3.1)) == packets.position_setpoint(Vector3(1.1, 2.0, 2.9), 0.0)
    far = encoder.encode(goal, Vector3(1.0, -9.0, -9.0))
    assert far == packets.position_setpoint(Vector3(1.0, 2.5, 3.5), 0.0)
    assert encoder.encode(goal, None) == packets.position_setpoint(goal.position, 0.0)


def test_a_position_that_does_not_fit_16_bits_is_sent_as_floats() -> None:
    encoder = Encoder(7, {"stabilizer.controller": 2})
    assert encoder.encode(PositionSetpoint(Vector3(40.0, 0.0, 1.0), 0.0)).data[0] == 7
    assert encoder.encode(PositionSetpoint(Vector3(30.0, 0.0, 1.0), 0.0)).data[0] == 6
    assert encoder.encode(VelocitySetpoint(Vector3(1.0, 0.0, 0.0))).data[0] == 1
