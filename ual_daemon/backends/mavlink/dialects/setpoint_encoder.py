"""From setpoints to the messages that one autopilot takes."""

from __future__ import annotations

from collections.abc import Mapping

from ual_daemon.backends.firmwares.feed_forward import FeedForward
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.wire.frames import Source
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.values import Setpoint


class SetpointEncoder:
    """Encodes the setpoints for one autopilot, the `target`. From any thread.

    `parameters` are those read so far, and may grow. `feed_forward` is added to setpoints; None where the autopilot
    takes none.
    """

    def __init__(
        self, dialect: Dialect, target: Source, parameters: Mapping[str, float], feed_forward: FeedForward | None
    ) -> None:
        self._dialect = dialect
        self._target = target
        self._parameters = parameters
        self._feed_forward = feed_forward

    def encode(self, setpoint: Setpoint, now_s: float) -> tuple[Setpoint, Message]:
        """Returns the setpoint with what was learned of the vehicle, and its message.

        Raises:
            NotSupportedError: UAL does not fly this autopilot.

        """
        time_ms = int(now_s * 1000.0) & 0xFFFFFFFF
        if self._feed_forward is not None:
            setpoint = self._feed_forward.apply(setpoint, now_s)
        return setpoint, self._dialect.encode_setpoint(setpoint, self._target, time_ms, self._parameters)
