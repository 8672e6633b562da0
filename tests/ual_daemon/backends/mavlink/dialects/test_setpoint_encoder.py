"""The short way of a velocity to its bytes: they are those of the long way."""

from __future__ import annotations

import math
import random

import pytest
from pymavlink.dialects.v20 import all as mavlink

from ual.geometry import Pose, Quaternion, Vector3
from ual_daemon.backends.firmwares.feed_forward import FeedForward
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.dialects.setpoint_encoder import SetpointEncoder
from ual_daemon.backends.mavlink.dialects.unknown import Unknown
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Codec
from ual_daemon.backends.mavlink.wire.signing import Signer
from ual_daemon.backends.values import PositionSetpoint, VelocitySetpoint

TARGET = MessageSource(7, 1)


@pytest.mark.parametrize("has_key", [False, True])
@pytest.mark.parametrize(("dialect", "learns"), [(Px4(), True), (Px4(), False), (ArduCopter(), False)])
def test_a_velocity_has_the_same_bytes_on_both_directions(dialect: Dialect, learns: bool, has_key: bool) -> None:
    chance, parameters = random.Random(4), dict[str, float]()
    feed_forwards = [FeedForward(0.2, parameters) if learns else None for _ in range(2)]
    short, long = (SetpointEncoder(dialect, TARGET, parameters, each) for each in feed_forwards)
    codecs = [Codec(191, Signer(bytes(32), lambda: 1.8e9) if has_key else None) for _ in range(2)]
    for codec in codecs:
        codec.join(7)
    now_s = 4294967.0  # its milliseconds are about to wrap
    for number in range(2000):
        now_s += chance.choice((0.0, 0.01, 0.02, 0.05, 3.0))
        if number == 500:
            parameters["MPC_XY_VEL_P_ACC"] = 2.4
        size = chance.choice((0.0, 0.01, 1.0, 8.0, 40.0))
        velocity = Vector3(*(chance.gauss(0.0, size) for _ in range(3)))
        for each in feed_forwards:
            if each is not None and number % 3 == 0:
                each.learn(now_s, Pose(velocity * now_s, Quaternion.from_euler(0.1, 0.05, 0.3)), velocity)
        setpoint = VelocitySetpoint(velocity, chance.choice((0.0, 0.4)))
        plain = short.velocity(setpoint, now_s)
        assert plain is not None
        flown, message = long.encode(setpoint, now_s)
        assert codecs[0].encode_velocity(plain[1]) == codecs[1].encode(message)
        assert plain[0] == tuple(flown.velocity)


def test_only_a_velocity_alone_takes_the_short_path() -> None:
    encoder = SetpointEncoder(Px4(), TARGET, {}, None)
    still = Vector3()
    assert encoder.velocity(VelocitySetpoint(still), 1.0) is not None
    assert encoder.velocity(VelocitySetpoint(still, 0.0, still), 1.0) is None
    assert encoder.velocity(PositionSetpoint(still, 0.0), 1.0) is None
    assert SetpointEncoder(Unknown(0), TARGET, {}, None).velocity(VelocitySetpoint(still), 1.0) is None


def test_the_short_path_has_the_bytes_of_pymavlink() -> None:
    encoder, theirs = SetpointEncoder(Px4(), TARGET, {}, FeedForward(0.3)), mavlink.MAVLink(None, 7, 191)
    codec = Codec(191)
    codec.join(7)
    plain = encoder.velocity(VelocitySetpoint(Vector3(1.0, -2.0, 0.5), 0.25), 12.0)
    assert plain is not None
    time_ms, system, component, mask, *motion, yaw_rate = plain[1]
    message = mavlink.MAVLink_set_position_target_local_ned_message(
        time_ms, system, component, mavlink.MAV_FRAME_LOCAL_NED, mask, 0.0, 0.0, 0.0, *motion, 0.0, yaw_rate
    )
    assert codec.encode_velocity(plain[1]) == message.pack(theirs)
    assert motion[:3] == [pytest.approx(plain[0][1]), pytest.approx(plain[0][0]), -0.5]
    assert math.isclose(yaw_rate, -0.25)
