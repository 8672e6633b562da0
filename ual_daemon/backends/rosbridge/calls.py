"""Services that are called: each call ends with its answer, or with an error that names the service."""

from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any, NamedTuple

from ual_daemon.backends.rosbridge.operations import Message

_LEFT = (
    "transport error completing",
    "returned no response",
    "node shutdown interrupted",
    "Timeout exceeded while waiting for service response",
    "Service call exception",
)
"""Parts of rosbridge's texts about a call that has left while its answer was lost: the first three with ROS 1."""


class ServiceError(Exception):
    """A service was not executed: `words` says why, in the words of the other side."""

    def __init__(self, service: str, text: str) -> None:
        super().__init__(f"{service}: {text}")
        self.service = service
        self.text = text


class ServiceTimeoutError(ServiceError):
    """A service has not answered, in time or at all. Whether it was executed is not known."""


class _Call(NamedTuple):
    service: str
    answer: Future[Message]
    ends_s: float


class PendingCalls:
    """The calls that are not answered yet. Any thread may call; futures end on the link's thread."""

    def __init__(self) -> None:
        self._open: dict[str, _Call] = {}
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()
        self._unanswered_since_s = math.inf
        self._is_concurrent = False

    def begin(self, service: str, now_s: float, timeout_s: float) -> tuple[str, Future[Message]]:
        """Returns the id of a new call, and the future of its answer."""
        answer: Future[Message] = Future()
        ident = f"ual {next(self._numbers)}"
        with self._lock:
            self._open[ident] = _Call(service, answer, now_s + timeout_s)
            self._unanswered_since_s = min(self._unanswered_since_s, now_s)
        return ident, answer

    def unanswered_s(self, now_s: float) -> float:
        """Returns for how long services were called and none has answered, in seconds; 0 if nothing was called."""
        return max(0.0, now_s - self._unanswered_since_s)

    @property
    def hold_up(self) -> bool:
        """Whether a call that is made now may wait behind another one: one is in progress, and no later one has ever
        been answered before an earlier one.
        """
        with self._lock:
            return not self._is_concurrent and (bool(self._open) or self._unanswered_since_s < math.inf)

    def is_open(self, ident: str) -> bool:
        """Returns whether the answer of a call is still wanted."""
        with self._lock:
            call = self._open.get(ident)
        return call is not None and not call.answer.cancelled()

    def answer(self, operation: Mapping[str, Any]) -> None:
        """Takes an answer; one that is late, or of nobody's call, is dropped."""
        ident = str(operation.get("id"))
        with self._lock:
            self._unanswered_since_s = math.inf
            self._is_concurrent = self._is_concurrent or (ident in self._open and next(iter(self._open)) != ident)
        call = self._take(ident)
        if call is None:
            return
        values = operation.get("values")
        if operation.get("result", True) and isinstance(values, dict | None):
            _end(call, values or {})
        else:
            _end(call, _read_error(call.service, str(values)))

    def expire(self, now_s: float) -> tuple[str, ...]:
        """Ends the calls whose time is over, or whose caller has given up, and returns their ids."""
        with self._lock:
            late = tuple(each for each, call in self._open.items() if now_s > call.ends_s or call.answer.cancelled())
        for ident in late:
            call = self._take(ident)
            if call is not None:
                _end(call, ServiceTimeoutError(call.service, "the service has not answered"))
        return late

    def refuse(self, ident: str, text: str, error: type[ServiceError] = ServiceError) -> None:
        """Ends a call that was not sent, or with another `error` one of which that is not known."""
        call = self._take(ident)
        if call is not None:
            _end(call, error(call.service, text))

    def fail_all(self, text: str) -> None:
        """Ends all calls: the connection is lost."""
        with self._lock:
            self._unanswered_since_s, self._is_concurrent = math.inf, False
            calls, self._open = list(self._open.values()), {}
        for call in calls:
            _end(call, ServiceTimeoutError(call.service, text))

    def _take(self, ident: str) -> _Call | None:
        with self._lock:
            return self._open.pop(ident, None)


def _read_error(service: str, text: str) -> ServiceError:
    if any(each in text for each in _LEFT):
        return ServiceTimeoutError(service, text)
    return ServiceError(service, text or "refused without a reason")


def _end(call: _Call, result: Message | ServiceError) -> None:
    if not call.answer.set_running_or_notify_cancel():
        return
    if isinstance(result, ServiceError):
        call.answer.set_exception(result)
    else:
        call.answer.set_result(result)
