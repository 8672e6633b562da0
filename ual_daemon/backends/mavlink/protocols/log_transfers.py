"""The logs of the autopilot by LOG_REQUEST_LIST and LOG_REQUEST_DATA, where it has no MAVFTP.

https://mavlink.io/en/messages/common.html#LOG_REQUEST_LIST. PX4 numbers its logs again for each list, and gives data
only after a list. ArduPilot sends to one program at a time, and to none while it is armed.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, NamedTuple, TypeVar

from typing_extensions import override

from ual.errors import LinkLostError, RejectedByAutopilotError, ResourceExhaustedError, UalError, UalTimeoutError
from ual_daemon.backends import futures
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.exchange import Exchange
from ual_daemon.backends.mavlink.protocols.protocol import Handler, Protocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

T = TypeVar("T")

_log = logging.getLogger(__name__)

BLOCK = 90
"""The most data that a LOG_DATA has."""
DATA_SILENCE_S = 1.0
"""Seconds without new data after which missing data is requested again."""
PROGRESS_TIMEOUT_S = 10.0
"""Seconds without new data after which an exchange ends."""
IDLE_LOG_S = 2.0
"""Seconds after which the autopilot is informed that nothing is wanted any more."""
MOST_LOGS = 2000
COUNTS_COUNT = 4
"""Different counts of logs that may be reported while they are listed: one may be added."""
MOST_WAITING_READS = 100
MOST_GENTLE_BLOCKS = 10
"""Blocks that are requested at once while it may be flying; then nothing for as long as they took."""
GENTLE_DOWNLOAD_BYTES_S = 48_000.0
_LAST_ENTRY_ID = 0xFFFF


class LogEntry(NamedTuple):
    """A log as it is listed. `time_utc_s` is 0 where it is not known, `size` None where no answer about it came."""

    id: int
    size: int | None
    time_utc_s: int


class _Requests(NamedTuple):
    entries: Callable[[int, int], object]
    data: Callable[[int, int, int], object]
    is_gentle: Callable[[], bool]
    explain: Callable[[UalError, float], UalError]


class _LogExchange(Exchange[T]):
    """An exchange about logs. It ends once nothing new has come for long."""

    def __init__(self, future: Future[T], requests: _Requests) -> None:
        super().__init__(future)
        self._requests = requests
        self._new_s = math.nan
        self._next_s = -math.inf
        self.is_answered = False

    @override
    def tick(self, now_s: float) -> None:
        if math.isnan(self._new_s):
            self._new_s = now_s
        if now_s - self._new_s > PROGRESS_TIMEOUT_S:
            self.fail(self._requests.explain(self._unanswered(), now_s))
        elif now_s >= self._next_s:
            self._next_s = now_s + DATA_SILENCE_S
            self._request(now_s)

    def on_entry(self, message: Message, now_s: float) -> None:
        """Takes a LOG_ENTRY."""

    def on_data(self, message: Message, now_s: float) -> None:
        """Takes a LOG_DATA."""

    def _note_new(self, now_s: float) -> None:
        self.is_answered = True
        self._new_s, self._next_s = now_s, now_s + DATA_SILENCE_S

    def _request(self, now_s: float) -> None:
        raise NotImplementedError

    def _unanswered(self) -> UalError:
        raise NotImplementedError


class _Listing(_LogExchange[list[LogEntry]]):
    def __init__(self, future: Future[list[LogEntry]], requests: _Requests) -> None:
        super().__init__(future, requests)
        self._found: dict[int, LogEntry] = {}
        self._count: int | None = None
        self._counts_count = 0
        self._last = 0
        """The number of the last log, as the autopilot says. PX4 counts from 0, ArduPilot from 1."""

    @override
    def tick(self, now_s: float) -> None:
        if self._found and now_s - self._new_s > PROGRESS_TIMEOUT_S:  # else one that never comes would hide all others
            self._end_listed()
        else:
            super().tick(now_s)

    @override
    def on_entry(self, message: Message, now_s: float) -> None:
        if math.isnan(self._new_s):
            return
        if message.num_logs > MOST_LOGS:
            text = f"it says that it has {message.num_logs} logs, over {MOST_LOGS}"
            self.fail(ResourceExhaustedError(text, {"limit": str(MOST_LOGS)}))
            return
        count: int = message.num_logs
        if count != self._count:
            self._counts_count += 1
            self._count = count
            self._found.clear()
        if self._counts_count > COUNTS_COUNT:
            self.fail(UalTimeoutError("the number of its logs changes all the time: try again"))
        self._last = message.last_log_num
        if count and message.id not in self._found and len(self._found) < MOST_LOGS:
            self._found[message.id] = LogEntry(message.id, message.size, message.time_utc)
            self._note_new(now_s)
        if len(self._found) >= count:
            self._end_listed()

    def _end_listed(self) -> None:
        missing = [LogEntry(each, None, 0) for each in self._numbers() if each not in self._found]
        if missing:
            _log.warning("of these logs the autopilot tells nothing: %s", ", ".join(str(each.id) for each in missing))
        self._end([*(each for _, each in sorted(self._found.items())), *missing])

    def _numbers(self) -> range:
        """The numbers that the logs should have."""
        count, least = self._count or 0, min(self._found, default=0)
        first = self._last - count + 1
        return range(first, first + count) if 0 <= first <= least else range(least, least + count)

    @override
    def _request(self, now_s: float) -> None:
        missing = self._first_missing()
        self._requests.entries(missing, _LAST_ENTRY_ID)

    def _first_missing(self) -> int:
        """The first number that has not come."""
        return next((each for each in self._numbers() if each not in self._found), 0)

    @override
    def _unanswered(self) -> UalError:
        return UalTimeoutError("the autopilot does not answer to the request for its logs, or has none")


class _LogReading(_LogExchange[bytes]):
    """Reads a part of a log: a run of blocks that are missing at a time."""

    def __init__(self, future: Future[bytes], requests: _Requests, log_id: int, offset: int, size: int) -> None:
        super().__init__(future, requests)
        self._id = log_id
        self._offset = offset
        self._data = bytearray(size)
        self._missing = dict.fromkeys(range(0, size, BLOCK))
        self._run: range = range(0)
        self._run_s = 0.0

    @override
    def tick(self, now_s: float) -> None:
        super().tick(now_s)
        if not self._missing:
            self._end(bytes(self._data))

    @override
    def on_data(self, message: Message, now_s: float) -> None:
        at = message.ofs - self._offset
        if message.id != self._id or at not in self._missing or math.isnan(self._new_s):
            return
        least = min(BLOCK, len(self._data) - at)
        if message.count < least:
            return
        self._data[at : at + least] = bytes(message.data[:least])
        del self._missing[at]
        self._note_new(now_s)
        if not self._missing:
            self._end(bytes(self._data))
        elif self._run and at == self._run[-1]:
            took_s = now_s - self._run_s
            self._next_s = now_s + (self._pause_s(took_s) if self._requests.is_gentle() else 0.0)

    def _pause_s(self, took_s: float) -> float:
        return max(took_s, len(self._run) * BLOCK / GENTLE_DOWNLOAD_BYTES_S - took_s)

    @override
    def _request(self, now_s: float) -> None:
        if not self._missing:
            return
        first = next(iter(self._missing))
        last = first
        most = MOST_GENTLE_BLOCKS if self._requests.is_gentle() else len(self._missing)
        while last + BLOCK in self._missing and (last - first) // BLOCK + 1 < most:
            last += BLOCK
        self._run, self._run_s = range(first, last + 1, BLOCK), now_s
        self._requests.data(self._id, self._offset + first, min(last + BLOCK, len(self._data)) - first)

    @override
    def _unanswered(self) -> UalError:
        return UalTimeoutError(f"log {self._id}: nothing of it has come for {PROGRESS_TIMEOUT_S:g} s")


class LogTransfers(Protocol):
    """Belongs to the thread that receives. One exchange at a time, in the order in which they were requested.

    Args:
        send: Sends a message.
        is_up: Says whether the link is up at a time.
        is_gentle: Says whether it may be flying.

    """

    def __init__(
        self, send: Callable[[Message], object], is_up: Callable[[float], bool], is_gentle: Callable[[], bool]
    ) -> None:
        self.is_waiting = False
        self._send = send
        self._is_up = is_up
        self._is_gentle = is_gentle
        self._target: MessageSource | None = None
        self._requests: _Requests | None = None
        self._waiting: deque[_LogExchange[Any]] = deque()
        self._running: _LogExchange[Any] | None = None
        self._used_s: float | None = None
        """Time at which data was read last; None once the autopilot was informed that no more is wanted."""

    @property
    @override
    def handlers(self) -> dict[int, Handler]:
        return {
            mavlink.MAVLINK_MSG_ID_LOG_ENTRY: self.on_entry,
            mavlink.MAVLINK_MSG_ID_LOG_DATA: self.on_data,
            mavlink.MAVLINK_MSG_ID_STATUSTEXT: self.on_text,
        }

    @property
    @override
    def is_urgent(self) -> bool:
        return self._running is not None

    @override
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        self.drop("another autopilot was found")
        self._target = target
        self._requests = _Requests(
            lambda first, last: self._send(mavlink.MAVLink_log_request_list_message(*target, first, last)),
            lambda log_id, offset, count: self._send(
                mavlink.MAVLink_log_request_data_message(*target, log_id, offset, count)
            ),
            self._is_gentle,
            self._explain,
        )

    @override
    def release(self) -> None:
        if self._used_s is not None and self._target is not None:
            self._used_s = None
            self._send(mavlink.MAVLink_log_request_end_message(*self._target))

    @override
    def drop(self, why: str) -> None:
        error = LinkLostError(f"its logs were not read: {why}")
        for exchange in (*self._waiting, *([] if self._running is None else [self._running])):
            exchange.fail(error)
        self._waiting.clear()
        self._running, self._used_s = None, None

    @override
    def tick(self, now_s: float) -> None:
        while self._running is None or self._running.is_over:
            if not self._waiting:
                self._running = None
                break
            self._running = self._waiting.popleft()
        if self._running is not None:
            self._running.tick(now_s)
            self._used_s = now_s
        elif self._used_s is not None and now_s - self._used_s > IDLE_LOG_S:
            self.release()

    def list(self, future: Future[list[LogEntry]]) -> None:
        """Lists the logs."""
        self._add(future, lambda requests: _Listing(future, requests))

    def read(self, log_id: int, offset: int, size: int, future: Future[bytes]) -> None:
        """Reads a part of a log that it has."""
        self._add(future, lambda requests: _LogReading(future, requests, log_id, offset, size))

    def on_entry(self, message: Message, now_s: float) -> None:
        """Takes a LOG_ENTRY."""
        if self._running is not None:
            self._running.on_entry(message, now_s)

    def on_data(self, message: Message, now_s: float) -> None:
        """Takes a LOG_DATA."""
        if self._running is not None:
            self._running.on_data(message, now_s)
            if self._running.is_over:
                self.tick(now_s)

    def on_text(self, message: Message, _now_s: float) -> None:
        """Takes a STATUSTEXT, in which ArduPilot says why it gives no logs."""
        running = self._running
        if running is not None and not running.is_answered and _is_refusal(message.text):
            text = f"the autopilot gives no logs now; it says: {message.text}"
            running.fail(RejectedByAutopilotError(text, {"result": message.text}))

    def _add(self, future: Future[T], make: Callable[[_Requests], _LogExchange[T]]) -> None:
        if self._requests is None:
            futures.fail(future, LinkLostError("no autopilot was found"))
        elif len(self._waiting) >= MOST_WAITING_READS:
            text = f"{MOST_WAITING_READS} reads of logs wait already, which is the limit"
            futures.fail(future, ResourceExhaustedError(text, {"limit": str(MOST_WAITING_READS)}))
        else:
            self._waiting.append(make(self._requests))
            self.is_waiting = True

    def _explain(self, error: UalError, now_s: float) -> UalError:
        """Returns what it means that nothing has come."""
        if not self._is_up(now_s):
            return LinkLostError(f"{error.message}; nothing comes from the autopilot", error.metadata)
        running = self._running
        if self._is_gentle() and running is not None and not running.is_answered:
            text = f"{error.message}; ArduPilot gives none while it is armed: disarm first"
            return type(error)(text, error.metadata)
        return error


def _is_refusal(text: str) -> bool:
    return text.startswith(("Disarm for log download", "Log download in progress"))
