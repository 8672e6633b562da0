"""What to ask an autopilot after meeting it: streams, single messages, parameters; again until it has answered."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from ual_daemon.backends.mavlink.commands import Command, Commands, request_message
from ual_daemon.backends.mavlink.dialect import Dialect
from ual_daemon.backends.mavlink.telemetry import Telemetry

ROUND_S = 1.0
PATIENCE_COUNT = 10
"""After so many rounds it is asked less often: what it has not said by then it may not have (no fix yet)."""
PATIENT_ROUND_S = 10.0


class Interview:
    """One meeting with an autopilot. Not thread-safe: belongs to the thread that receives."""

    def __init__(
        self,
        dialect: Dialect,
        telemetry: Telemetry,
        commands: Commands,
        read_parameter: Callable[[str], None],
        pose_rate_hz: float,
    ) -> None:
        self._dialect = dialect
        self._telemetry = telemetry
        self._commands = commands
        self._read_parameter = read_parameter
        self._streams: dict[Command, Future[None] | None] = dict.fromkeys(dialect.streams(pose_rate_hz))
        self._rounds_count = 0
        self._next_s: float | None = None

    def tick(self, now_s: float) -> None:
        """Asks for what is missing; to be called often."""
        if self._next_s is not None and now_s < self._next_s:
            return
        self._rounds_count += 1
        self._next_s = now_s + (ROUND_S if self._rounds_count < PATIENCE_COUNT else PATIENT_ROUND_S)
        for command, future in self._streams.items():
            if future is None or not (future.done() or self._commands.is_under_way(command)):
                self._streams[command] = self._commands.submit(command, now_s)
        for message_id in self._dialect.wanted_messages:
            request = request_message(message_id)
            if message_id not in self._telemetry.seen and not self._commands.is_under_way(request):
                self._commands.submit(request, now_s)
        for name in self._dialect.parameters:
            if name not in self._telemetry.parameters:
                self._read_parameter(name)
