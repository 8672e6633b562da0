"""Requests streams, single messages and parameters from an autopilot, again until it has sent them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Future

from ual.errors import UalTimeoutError
from ual_daemon.backends.engine.command_runner import CommandRunner
from ual_daemon.backends.mavlink.dialects.command_long import CommandLong, LongCommand, request_message
from ual_daemon.backends.mavlink.dialects.data_streams import group_rates_hz
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.session.telemetry import AutopilotTelemetry
from ual_daemon.backends.mavlink.wire.messages import mavlink, message_name

ROUND_S = 1.0
FAST_ROUNDS_COUNT = 10
"""Rounds after which requests become rarer: the autopilot may not have the data that is still missing (no fix yet)."""
SLOW_ROUND_S = 10.0
FAST_PARAMETER_ROUNDS_COUNT = 5
"""Rounds after which the missing parameters are requested at intervals that double each time. An autopilot does not
answer that it has no parameter of the name, as a real ArduPilot has no SIM_SPEEDUP.
"""
DROPPED_SHARE = 0.6
"""A stream may come at less than this part of the best rate seen, with the losses of the link taken into account. Then
another program has lowered it (REQUEST_DATA_STREAM of a ground station on the same link), and it is requested again."""
REFUSED_COUNT = 3
"""Requests for single streams, none of them accepted, after which whole groups are requested."""
FLOWS_SHARE, SPARSE_FLOWS_SHARE = 0.25, 0.05
"""A stream flows if at least this part of the requested rate comes. The second one is for messages that are sent on a
change and else seldom (`Dialect.sparse_messages`). Acknowledgements do not show which of these requests they are for.
On a bad link one that comes twice can be taken for that of another request, so only the flow counts."""


class SetupRequests:
    """Requests to an autopilot that was found, or that has booted.

    Not thread-safe: belongs to the thread that receives.
    """

    def __init__(
        self,
        dialect: Dialect,
        telemetry: AutopilotTelemetry,
        commands: CommandRunner[CommandLong],
        request_parameter: Callable[[str], None],
        streams: Iterable[LongCommand],
        loss: Callable[[float], float] = lambda _: 0.0,
        on_missing: Callable[[tuple[str, ...]], None] = lambda _: None,
        request_group: Callable[[int, int], None] = lambda *_: None,
    ) -> None:
        """`loss` returns the part of the messages that the link loses now (0 to 1). `on_missing` takes the names of the
        parameters that were requested several times and have not come. `request_group` requests a group of streams at a
        rate in Hz, where the autopilot does not know the request for single ones.
        """
        self.refused: dict[str, str] = {}
        """The streams that were refused, or not answered, and do not come: their names, and the results."""
        self._dialect = dialect
        self._telemetry = telemetry
        self._commands = commands
        self._request_parameter = request_parameter
        self._request_group = request_group
        self._streams: dict[LongCommand, Future[None] | None] = dict.fromkeys(streams)
        self._unanswered: set[LongCommand] = set()
        self._takes_single_requests = False
        self._rounds_count = 0
        self._round_s = 0.0
        self._next_s: float | None = None
        self._counts_at_start = self._counts_before_round = telemetry.message_counts.copy()
        self._loss = loss
        self._on_missing = on_missing
        self._best_hz: dict[int, float] = {}
        """The best rate of each stream, by the id of its message."""
        self._parameter_rounds_count = 0
        self._next_parameters_s: float | None = None

    @property
    def has_awaited_parameters(self) -> bool:
        """Whether the parameters were requested several times by now."""
        return self._parameter_rounds_count >= FAST_PARAMETER_ROUNDS_COUNT

    @property
    def missing(self) -> tuple[str, ...]:
        """The human-readable names of parameters that were requested several times and have not come."""
        if not self.has_awaited_parameters:
            return ()
        return self._dialect.missing_parameters(self._telemetry.parameters)

    def tick(self, now_s: float) -> None:
        """Requests what is missing; to be called often."""
        if self._next_s is None or now_s >= self._next_s:
            self._request_messages(now_s)
            self._rounds_count += 1
            self._round_s = ROUND_S if self._rounds_count < FAST_ROUNDS_COUNT else SLOW_ROUND_S
            self._next_s = now_s + self._round_s
        if self._next_parameters_s is None or now_s >= self._next_parameters_s:
            self._request_parameters()
            self._parameter_rounds_count += 1
            if self._parameter_rounds_count == FAST_PARAMETER_ROUNDS_COUNT:
                self._report_missing()
            doublings_count = max(0, self._parameter_rounds_count - FAST_PARAMETER_ROUNDS_COUNT)
            self._next_parameters_s = now_s + ROUND_S * 2.0**doublings_count

    def change_streams(self, streams: Iterable[LongCommand]) -> None:
        """Requests these from now on, instead of those before."""
        self._streams = dict.fromkeys(streams)
        self._unanswered.clear()
        self._best_hz.clear()
        self._rounds_count, self._next_s = 0, None

    def _request_messages(self, now_s: float) -> None:
        self._note_refused()
        for command, future in self._streams.items():
            is_answered = _is_answered(future)
            is_refused = is_answered and future is not None and future.exception() is not None
            is_settled = is_answered and (is_refused or self._flows(command)) and not self._has_dropped(command, now_s)
            if not (is_settled or self._commands.is_pending(command)):
                if future is not None and not is_answered:
                    self._unanswered.add(command)
                self._streams[command] = self._commands.submit(command, now_s)
        self._request_groups()
        counts = self._counts_before_round = self._telemetry.message_counts.copy()
        for message_id in self._dialect.wanted_messages:
            request = request_message(message_id)
            has_come = counts[message_id] > self._counts_at_start[message_id]
            is_settled = has_come and message_id not in self._dialect.changing_messages
            if not (is_settled or self._commands.is_pending(request)):
                self._commands.submit(request, now_s)

    def _note_refused(self) -> None:
        """Notes what became of the requests for streams."""
        self.refused = {}
        for command, future in self._streams.items():
            result = self._result(command, future)
            if future is not None and result == "":
                self._takes_single_requests = True
            elif result and not self._flows(command):
                self.refused[message_name(round(command.request.params[0]))] = result

    def _result(self, command: LongCommand, future: Future[None] | None) -> str | None:
        """Returns how a request for a stream was answered: empty if accepted, None if it is not answered yet."""
        if future is None or not _is_answered(future):
            return "no answer" if command in self._unanswered else None
        error = future.exception()
        return "" if error is None else str(getattr(error, "metadata", {}).get("result", error))

    def _request_groups(self) -> None:
        """Requests groups of streams from an autopilot that has taken none of several requests for single ones."""
        if self._takes_single_requests or len(self.refused) < REFUSED_COUNT:
            return
        silent = [command for command in self._streams if not self._flows(command)]
        for group, rate_hz in group_rates_hz(silent).items():
            self._request_group(group, rate_hz)

    def _flows(self, command: LongCommand) -> bool:
        """Returns whether the requested stream came in the last round, or need not come."""
        message_id, interval_us = round(command.request.params[0]), command.request.params[1]
        if message_id in self._dialect.optional_messages:
            return True
        came_count = self._came_count(message_id)
        if message_id == mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION:  # either of them will do
            came_count += self._came_count(mavlink.MAVLINK_MSG_ID_ATTITUDE)
        share = SPARSE_FLOWS_SHARE if message_id in self._dialect.sparse_messages else FLOWS_SHARE
        return came_count >= share * self._round_s / (interval_us * 1e-6)

    def _came_count(self, message_id: int) -> int:
        return self._telemetry.message_counts[message_id] - self._counts_before_round[message_id]

    def _has_dropped(self, command: LongCommand, now_s: float) -> bool:
        """Returns whether the stream came far more slowly in the last round than it did before."""
        message_id = round(command.request.params[0])
        if self._round_s <= 0.0 or message_id in self._dialect.sparse_messages:
            return False
        counts = self._telemetry.message_counts
        rate_hz = (counts[message_id] - self._counts_before_round[message_id]) / self._round_s
        best_hz = self._best_hz[message_id] = max(rate_hz, self._best_hz.get(message_id, 0.0))
        return rate_hz < DROPPED_SHARE * best_hz * (1.0 - self._loss(now_s))

    def _report_missing(self) -> None:
        missing = self.missing
        if missing:
            self._on_missing(missing)

    def _request_parameters(self) -> None:
        for name in self._dialect.absent_parameters(self._telemetry.parameters):
            self._request_parameter(name)


def _is_answered(future: Future[None] | None) -> bool:
    """Returns whether a request was accepted or refused, and not given up."""
    return future is not None and future.done() and not isinstance(future.exception(), UalTimeoutError)
