"""From setpoints to the messages that one autopilot takes."""

from __future__ import annotations

from collections.abc import Mapping

from ual_daemon.backends.firmwares.feed_forward import FeedForward
from ual_daemon.backends.firmwares.numbers import ACCELERATED_VELOCITY_MASK, VELOCITY_MASK
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, VelocityTarget
from ual_daemon.backends.values import Setpoint, VelocitySetpoint


class SetpointEncoder:
    """Encodes the setpoints for one autopilot, the `target`. From any thread.

    `parameters` are those read so far, and may grow. `feed_forward` is added to setpoints; None where the autopilot
    takes none.
    """

    def __init__(
        self, dialect: Dialect, target: MessageSource, parameters: Mapping[str, float], feed_forward: FeedForward | None
    ) -> None:
        self._dialect = dialect
        self._target = target
        self._parameters = parameters
        self._feed_forward = feed_forward
        self._is_plain = dialect.takes_plain_velocities

    def velocity(self, setpoint: Setpoint, now_s: float) -> tuple[tuple[float, float, float], VelocityTarget] | None:
        """Returns a velocity as `encode` does, in numbers; None for any other setpoint, or where it is not as plain.

        Written out, as each setpoint of a stream of velocities passes here. NED has x and y exchanged, and z downwards.
        """
        if setpoint.__class__ is not VelocitySetpoint or setpoint.acceleration is not None or not self._is_plain:
            return None
        v, time_ms, feed_forward = setpoint.velocity, int(now_s * 1000.0) & 0xFFFFFFFF, self._feed_forward
        (system_id, component_id), x, y, z, turn = self._target, v.x, v.y, v.z, -setpoint.yaw_rate_rad_s
        if feed_forward is None:
            return (x, y, z), (time_ms, system_id, component_id, VELOCITY_MASK, y, x, -z, 0.0, 0.0, 0.0, turn)
        x, y, ax, ay = feed_forward.answered(x, y, now_s)
        return (x, y, z), (time_ms, system_id, component_id, ACCELERATED_VELOCITY_MASK, y, x, -z, ay, ax, -0.0, turn)

    def encode(self, setpoint: Setpoint, now_s: float) -> tuple[Setpoint, Message]:
        """Returns the setpoint with what was learned of the vehicle, and its message.

        Raises:
            NotSupportedError: UAL does not fly this autopilot.

        """
        time_ms = int(now_s * 1000.0) & 0xFFFFFFFF
        if self._feed_forward is not None:
            setpoint = self._feed_forward.apply(setpoint, now_s)
        return setpoint, self._dialect.encode_setpoint(setpoint, self._target, time_ms, self._parameters)
