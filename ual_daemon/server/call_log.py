"""Observes calls: the caller, the method, the request, the answer or refusal, and how long it took.

It stands between the transport and `Calls`, so that every call is seen, whatever answers it, and costs nothing where
nobody observes.
"""

from __future__ import annotations

import itertools
import time
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, Protocol

import grpc
from typing_extensions import override

from ual.shared.guard import WorkGuard
from ual_daemon.server.transport.base import Metadata, ServedCall

_USER_AGENT = "user-agent"


@dataclass(frozen=True, slots=True)
class CallRecord:
    """A call that goes on (`has_ended` is False), or that has ended.

    `request` is its first message, `response` the one with which it ended, both packed; the counts say how many there
    were. `code` and `details` are gRPC's status, and `metadata` what was sent with it (the error's details). Times are
    the computer's monotonic clock, in nanoseconds. `identity` is the name of the caller's token or certificate.
    """

    number: int
    method: str
    caller: str
    identity: str
    agent: str
    began_ns: int
    at_ns: int
    has_ended: bool
    request: bytes | None
    requests_count: int
    response: bytes | None = None
    responses_count: int = 0
    code: str = ""
    details: str = ""
    metadata: Metadata = ()


class CallObserver(Protocol):
    """Observer of the calls for a UAV. It is called on the threads that serve, and must not block."""

    @abstractmethod
    def on_request(self, method: str) -> object:
        """Called before the first request of a call is handled. What it returns is handed back with each record."""

    @abstractmethod
    def on_call(self, record: CallRecord, before: object) -> None:
        """Called when a call goes on, and when it has ended. `before` is None for one that had no request."""


_numbers = itertools.count(1)
_guard: Final = WorkGuard("calls")


def observed(take: Callable[[ServedCall], None], observers: Sequence[CallObserver]) -> Callable[[ServedCall], None]:
    """Returns what takes calls in the place of `take`, and has each of them observed.

    A call that does not end at once is observed twice: when it has begun, and when it has ended.
    """
    return lambda call: take(ObservedCall(call, observers))


class ObservedCall(ServedCall):
    """A call that is observed. Everything is done by the call itself."""

    def __init__(self, call: ServedCall, observers: Sequence[CallObserver]) -> None:
        self.method = call.method
        self.metadata = call.metadata
        self.is_finished = False
        self.is_cancelled = False
        self._call = call
        self._observers = observers
        self._before: list[object] = [None] * len(observers)
        self._number = next(_numbers)
        self._began_ns = time.monotonic_ns()
        self._caller = call.peer()
        self._request: bytes | None = None
        self._requests_count = 0
        self._responses_count = 0
        self._has_ended = False

    @override
    def peer(self) -> str:
        return self._caller

    @override
    def certificate_name(self) -> str | None:
        return self._call.certificate_name()

    @override
    def watch(self, on_cancel: Callable[[], object]) -> None:
        self._call.watch(partial(self._on_cancel, on_cancel))

    @override
    def receive(self, then: Callable[[bytes | None], object]) -> None:
        self._call.receive(partial(self._on_message, then))

    @override
    def begin(self) -> None:
        self._call.begin()

    @override
    def send(self, message: bytes, then: Callable[[bool], object]) -> None:
        self._responses_count += 1
        self._call.send(message, then)

    @override
    def finish(
        self,
        message: bytes | None = None,
        code: grpc.StatusCode = grpc.StatusCode.OK,
        details: str = "",
        metadata: Metadata = (),
    ) -> None:
        self.is_finished = True
        self._end(message, code.name, details, metadata)
        self._call.finish(message, code, details, metadata)

    def _on_cancel(self, on_cancel: Callable[[], object]) -> None:
        self.is_cancelled = True
        self._end(None, grpc.StatusCode.CANCELLED.name, "the caller gave up, vanished, or its deadline passed", ())
        on_cancel()

    def _on_message(self, then: Callable[[bytes | None], object], message: bytes | None) -> None:
        if message is not None:
            self._requests_count += 1
        is_first = self._requests_count == 1 and message is not None
        if is_first:
            self._request = message
            for number, observer in enumerate(self._observers):
                try:
                    self._before[number] = observer.on_request(self.method)
                except Exception as error:  # noqa: BLE001  as in `_observe`
                    _guard.note(error)
        then(message)
        if is_first and not self._has_ended:
            self._observe(self._record(has_ended=False))

    def _observe(self, record: CallRecord) -> None:
        for observer, before in zip(self._observers, self._before, strict=True):
            try:
                observer.on_call(record, before)
            except Exception as error:  # noqa: BLE001  the call must be answered, and other observers hear of it
                _guard.note(error)

    def _end(self, response: bytes | None, code: str, details: str, metadata: Metadata) -> None:
        if self._has_ended:
            return
        self._has_ended = True
        responses_count = self._responses_count + (response is not None)
        self._observe(
            self._record(
                has_ended=True,
                response=response,
                responses_count=responses_count,
                code=code,
                details=details,
                metadata=metadata,
            )
        )

    def _record(self, *, has_ended: bool, **outcome: Any) -> CallRecord:  # noqa: ANN401  the fields with defaults
        agent = next((str(value) for key, value in self.metadata if key == _USER_AGENT), "")
        return CallRecord(
            self._number,
            self.method,
            self._caller,
            self.identity,
            agent,
            self._began_ns,
            time.monotonic_ns(),
            has_ended,
            self._request,
            self._requests_count,
            **outcome,
        )
