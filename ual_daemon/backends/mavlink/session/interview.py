"""What to ask an autopilot after meeting it: streams, single messages, parameters; again until it has answered."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from ual_daemon.backends.mavlink.autopilots.dialect import Dialect
from ual_daemon.backends.mavlink.session.commands import Command, Commands, request_message
from ual_daemon.backends.mavlink.session.telemetry import Telemetry

ROUND_S = 1.0
PATIENCE_COUNT = 10
"""After so many rounds it is asked less often: what it has not said by then it may not have (no fix yet)."""
PATIENT_ROUND_S = 10.0
PARAMETER_PATIENCE_COUNT = 5
"""After so many rounds the parameters that it has not told are asked for at intervals that double each time: nothing
says that it has none of the name, which is so with a real ArduPilot and SIM_SPEEDUP."""
FLOWS_SHARE, SPARSE_FLOWS_SHARE = 0.25, 0.05
"""A stream of which less comes than this part of what was asked for does not flow; the second is for messages that are
sent when something changes, and else seldom (`Dialect.sparse_messages`). Acknowledgements of such requests cannot be
told apart, so that on a bad link one that comes twice can be taken for another request's."""


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
        self._round_s = 0.0
        self._next_s: float | None = None
        self._seen = self._seen_before = telemetry.seen.copy()
        self._parameter_rounds_count = 0
        self._next_parameters_s: float | None = None

    def tick(self, now_s: float) -> None:
        """Asks for what is missing; to be called often."""
        if self._next_s is None or now_s >= self._next_s:
            self._ask_messages(now_s)
            self._rounds_count += 1
            self._round_s = ROUND_S if self._rounds_count < PATIENCE_COUNT else PATIENT_ROUND_S
            self._next_s = now_s + self._round_s
        if self._next_parameters_s is None or now_s >= self._next_parameters_s:
            self._ask_parameters()
            self._parameter_rounds_count += 1
            self._next_parameters_s = now_s + ROUND_S * 2.0 ** max(
                0, self._parameter_rounds_count - PARAMETER_PATIENCE_COUNT
            )

    def _ask_messages(self, now_s: float) -> None:
        for command, future in self._streams.items():
            is_settled = future is not None and future.done() and (self._flows(command) or future.exception())
            if not (is_settled or self._commands.is_under_way(command)):
                self._streams[command] = self._commands.submit(command, now_s)
        self._seen = self._telemetry.seen.copy()
        for message_id in self._dialect.wanted_messages:
            request = request_message(message_id)
            is_told = self._telemetry.seen[message_id] > self._seen_before[message_id]
            is_settled = is_told and message_id not in self._dialect.changing_messages
            if not (is_settled or self._commands.is_under_way(request)):
                self._commands.submit(request, now_s)

    def _flows(self, command: Command) -> bool:
        """Whether what was asked to be streamed has come in the last round."""
        message_id, interval_us = round(command.params[0]), command.params[1]
        came_count = self._telemetry.seen[message_id] - self._seen[message_id]
        share = SPARSE_FLOWS_SHARE if message_id in self._dialect.sparse_messages else FLOWS_SHARE
        return came_count >= share * self._round_s / (interval_us * 1e-6)

    def _ask_parameters(self) -> None:
        for name in self._dialect.parameters:
            if name not in self._telemetry.parameters:
                self._read_parameter(name)
