"""Common part of every call: its caller, its UAV, and its end at shutdown."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import grpc

from ual.access.roles import Role
from ual.errors import (
    InvalidArgumentError,
    PermissionDeniedError,
    ResourceExhaustedError,
    UalError,
    UnauthenticatedError,
)
from ual.wire import rpc_errors
from ual_daemon import logs
from ual_daemon.server.access import caller
from ual_daemon.server.access.caller import OF_THIS_COMPUTER, Caller
from ual_daemon.server.access.needed import needed_role
from ual_daemon.server.access.policy import Access
from ual_daemon.server.dispatch import SHUTTING_DOWN, CallAnswer, Handler, ServedMethod, StatusError
from ual_daemon.server.headroom import FLIES_ON, OF_THIS_PROCESS, Headroom
from ual_daemon.server.motion_gate import MotionGate
from ual_daemon.server.standstill import BEAT_S, Standstill
from ual_daemon.server.transport.base import ServedCall

NAMESPACE_KEY = "ual-ns"
MOST_CALLS_PER_METHOD = 100
"""Calls and streams of one method that run for one UAV and one caller (by the name of its token or certificate). For
each method by itself: a hundred readers of the telemetry must not keep out the caller that lands the UAV.
"""

MOST_CALLS_WITHOUT_REQUEST = 100
"""Calls for one UAV whose request has not come yet. Beyond that the oldest is ended, not the newest refused: a client
that sends both together, as each does, must get in.
"""
MOST_METADATA_BYTES = 16384
"""Names and values of one call. gRPC has a limit for each frame of them only."""
REQUEST_S = 10.0
"""Seconds for which a call may wait for its request; up to twice as long, since it is checked at this period."""

_log = logging.getLogger(__name__)


class CallFigures(NamedTuple):
    """Present calls: callers with calls in progress that wait or are streams, and streams by method. `failures` counts
    the calls that were refused or have failed since the start, by reason.
    """

    callers_count: int
    streams: Counter[str]
    failures: Counter[str]


class Calls:
    """Answers the calls for one UAV, with the servicers that are registered. Belongs to the event loop that runs now.

    It is a registry for generated code (``add_..._to_server``), and `take` takes the calls of a server. `log_name` is
    the UAV's name in the log. Once the shutdown has begun, methods that begin with one of `shutdown_refuses` are
    refused, except those in `shutdown_keeps`: these go on until `end_waiting`. `standstill` is beaten by the loop.
    """

    def __init__(
        self,
        ns: str,
        shutdown_refuses: tuple[str, ...],
        log_name: str = "",
        shutdown_keeps: frozenset[str] = frozenset(),
        access: Access | None = None,
        standstill: Standstill | None = None,
        motion_gate: MotionGate | None = None,
        headroom: Headroom = OF_THIS_PROCESS,
    ) -> None:
        self.headroom = headroom
        """Refuses what needs more memory than is left."""
        headroom.add(self)
        self.standstill = standstill or Standstill()
        """Refuses what may have waited unread, where it moves something."""
        self.motion_gate = motion_gate
        """Refuses motions, where something is needed for them."""
        self._ns = ns
        self._log_name = log_name
        self._has_ended_waiting = False
        self._shutdown_refuses = shutdown_refuses
        self._shutdown_keeps = shutdown_keeps
        self._access = access or Access()
        self._loop = asyncio.get_running_loop()
        self._methods: dict[str, ServedMethod] = {}
        self._roles: dict[str, Role] = {}
        self._lock = threading.Lock()
        self._answers: set[CallAnswer] = set()
        self._running: Counter[tuple[str, str]] = Counter()
        self._without_request: dict[CallAnswer, float] = {}
        self._refused_without_request: tuple[str, ResourceExhaustedError] | None = None
        self._refused_count = 0
        self._failures: Counter[str] = Counter()
        self._loop.call_later(REQUEST_S, self._end_late)
        self._loop.call_later(BEAT_S, self._beat)
        self.is_shutting_down = False

    def add_generic_rpc_handlers(self, handlers: Sequence[grpc.GenericRpcHandler]) -> None:
        """Does nothing: these are the same methods again, in the form of gRPC before 1.67."""

    def add_registered_method_handlers(self, service: str, handlers: Mapping[str, Handler]) -> None:
        """Registers the methods of a service, but those that its servicer does not implement."""
        for name, handler in handlers.items():
            method = ServedMethod(handler)
            if not method.is_generated:
                self._methods[f"/{service}/{name}"] = method

    def add_roles(self, service: str, roles: Mapping[str, Role]) -> None:
        """Says which role methods of a service need that `needed_role` does not know."""
        self._roles.update({f"/{service}/{name}": role for name, role in roles.items()})

    def needed_role(self, method: str) -> Role:
        """Returns the role that a method needs."""
        return self._roles.get(method) or needed_role(method)

    def on_call(self, call: ServedCall) -> None:
        """Begins to answer a call, on the transport's thread."""
        if not call.peer():  # gRPC does not know any more whose it was: not to be taken for a stranger's
            call.finish(code=grpc.StatusCode.CANCELLED, details="its caller gave it up")
            return
        try:
            who = self._access.identify(call)
            call.identity = who.name
            self._require_role(who, call.method)
        except UalError as error:  # before it is said whether there is such a method
            self._refuse(call, error)
            return
        method = self._methods.get(call.method)
        if method is None:
            call.finish(code=grpc.StatusCode.UNIMPLEMENTED, details=f"there is no method {call.method:.100}")
        else:
            method.kind(self, method, call, who).begin()

    def _require_role(self, who: Caller, method: str) -> None:
        who.require(self.needed_role(method), method.rpartition("/")[2])

    def _refuse(self, call: ServedCall, error: UalError) -> None:
        self.set_context(call, None)
        logs.refused(_log, call.method, error)
        self.set_context(None, None)
        self.on_failure(error.reason)
        status = rpc_errors.to_grpc_status(error)
        call.finish(None, status.code, status.details, status.trailing_metadata)

    @property
    def figures(self) -> CallFigures:
        """Present calls, and the count of failed ones."""
        with self._lock:
            answers, failures = list(self._answers), self._failures.copy()
        streams = Counter(answer.method_name.rpartition("/")[2] for answer in answers if answer.is_stream)
        return CallFigures(len({answer.call.peer() for answer in answers}), streams, failures)

    @property
    def running_count(self) -> int:
        """Calls in progress that a shutdown has to end."""
        return len(self._answers)

    @property
    def without_request_count(self) -> int:
        """Calls that wait for their request."""
        return len(self._without_request)

    def begin_shutdown(self) -> None:
        """Ends the streams, and refuses new calls that fly. To be called on the event loop, as is `end_waiting`."""
        self.is_shutting_down = True
        self._end(lambda answer: answer.is_stream and answer.method_name not in self._shutdown_keeps)

    def end_waiting(self) -> None:
        """Ends the calls that still wait, and from now on those that would begin to."""
        self._has_ended_waiting = True
        self._end(lambda answer: not answer.is_stream or answer.method_name in self._shutdown_keeps)

    def _end(self, is_meant: Callable[[CallAnswer], bool]) -> None:
        with self._lock:
            ending = [answer for answer in self._answers if is_meant(answer)]
        for answer in ending:
            answer.end()

    def _beat(self) -> None:
        self._loop.call_later(BEAT_S, self._beat)
        self.standstill.beat()

    def _end_late(self) -> None:
        """Ends the calls whose request is late, and logs how many have ended without one. Ends the calls and streams of
        callers that are not known any more, or may not do this any more.
        """
        self._loop.call_later(REQUEST_S, self._end_late)
        self._end_unknown()
        over_s = self._loop.time() - REQUEST_S
        with self._lock:
            late = [answer for answer, since_s in self._without_request.items() if since_s <= over_s]
        for answer in late:
            self._end_without_request(answer, f"the request did not come within {REQUEST_S:g} s")
        refused, self._refused_without_request = self._refused_without_request, None
        count, self._refused_count = self._refused_count, 0
        if refused is not None:  # one line for all: a flood of them must not cost a line each
            logs.refused(_log, *refused, repeated=count - 1)

    def _end_unknown(self) -> None:
        with self._lock:
            running = list(self._answers)
        for answer in running:
            try:
                self._require_role(self._access.identify(answer.call), answer.method_name)
            except (UnauthenticatedError, PermissionDeniedError) as error:
                answer.end(error)

    def _end_without_request(self, answer: CallAnswer, why: str) -> None:
        self.has_request(answer)
        error = ResourceExhaustedError(f"{answer.method_name}: {why}", {"limit": str(MOST_CALLS_WITHOUT_REQUEST)})
        self._refused_without_request = self._refused_without_request or (answer.method_name, error)
        self._refused_count += 1
        answer.fail(error)

    # --- For the answers ----------------------------------------------------------------------------------------------

    def join(self, answer: CallAnswer) -> None:
        """Adds an answer that is in progress: a shutdown ends it.

        Raises:
            ResourceExhaustedError: It is a stream, and too many of its method are in progress.

        """
        if answer.is_stream:
            self.require_room(answer.method_name, answer.caller)
        answer.call.peer()  # remembered from here on: the call may end before it is requested
        with self._lock:
            self._answers.add(answer)
            self._running[answer.method_name, answer.caller.name] += 1
        if self._has_ended_waiting and not answer.is_stream:  # it began before, but was not known yet
            answer.end()

    def leave(self, answer: CallAnswer) -> None:
        """Removes an answer that has ended."""
        with self._lock:
            if answer in self._answers:
                self._answers.discard(answer)
                key = answer.method_name, answer.caller.name
                self._running[key] -= 1
                if not self._running[key]:
                    del self._running[key]

    def await_request(self, answer: CallAnswer) -> None:
        """Adds an answer whose request has to come yet. If its caller has too many, the oldest of them ends."""
        oldest = None
        with self._lock:
            self._without_request[answer] = self._loop.time()
            if len(self._without_request) > MOST_CALLS_WITHOUT_REQUEST:
                of_caller = [each for each in self._without_request if each.caller.name == answer.caller.name]
                oldest = of_caller[0] if len(of_caller) > MOST_CALLS_WITHOUT_REQUEST else None
        if oldest is not None:
            self._end_without_request(oldest, f"{MOST_CALLS_WITHOUT_REQUEST} later calls wait for their request, too")

    def has_request(self, answer: CallAnswer) -> None:
        """Removes an answer whose request has come, or will not come any more."""
        with self._lock:  # others go through all of them
            self._without_request.pop(answer, None)

    def require_room(self, method: str, who: Caller) -> None:
        """Refuses a call of a method of which too many of the same caller are in progress.

        Raises:
            ResourceExhaustedError: They are.

        """
        if self._running.get((method, who.name), 0) < MOST_CALLS_PER_METHOD:
            return
        of_caller = f" of {who.name}" if who.is_named else ""
        error = ResourceExhaustedError(
            f"{MOST_CALLS_PER_METHOD} calls of {method}{of_caller} are under way for {self._ns}, which is the limit: "
            "end one of them",
            {"limit": str(MOST_CALLS_PER_METHOD)},
        )
        logs.refused(_log, method, error)
        raise error

    def require_accepted(self, call: ServedCall) -> None:
        """Refuses a call for another UAV, one that there is no memory for, and after the shutdown has begun one that
        flies.

        Raises:
            InvalidArgumentError: The caller means another UAV.
            ResourceExhaustedError: The metadata are too large, or too little memory is left.
            StatusError: The daemon is shutting down.

        """
        if self.is_shutting_down and self._is_refused_at_shutdown(call.method):
            raise StatusError(grpc.StatusCode.UNAVAILABLE, SHUTTING_DOWN)
        size = 0
        for key, value in call.metadata:
            size += len(key) + len(value)
            if key == NAMESPACE_KEY and value != self._ns:
                raise InvalidArgumentError(
                    f"this daemon flies {self._ns}, not {value!s:.64}", {"field": NAMESPACE_KEY, "namespace": self._ns}
                )
        if size > MOST_METADATA_BYTES:
            limit = f"metadata: {size} bytes, and at most {MOST_METADATA_BYTES} are accepted"
            raise ResourceExhaustedError(limit, {"limit": str(MOST_METADATA_BYTES)})
        if call.method not in FLIES_ON:
            self.headroom.require_room(call.method)

    def _is_refused_at_shutdown(self, method: str) -> bool:
        return method.startswith(self._shutdown_refuses) and (
            self._has_ended_waiting or method not in self._shutdown_keeps
        )

    def on_failure(self, reason: str) -> None:
        """Counts a call that is refused or has failed."""
        with self._lock:
            self._failures[reason] += 1

    def set_context(self, call: ServedCall | None, who: Caller | None) -> None:
        """Sets the caller and the UAV for what this thread or task does from now on."""
        logs.caller.set(None if call is None else partial(_described, call))
        caller.current.set(who or OF_THIS_COMPUTER)
        if self._log_name:
            logs.uav.set(self._log_name)

    def on_loop(self, callback: Callable[..., object], *arguments: object) -> bool:
        """Calls it on the event loop, soon. Returns False if that is closed."""
        try:
            self._loop.call_soon_threadsafe(callback, *arguments)
        except RuntimeError:
            return False
        return True


def _described(call: ServedCall) -> str:
    """Returns the address of a caller, and its name, if it has identified itself."""
    named = call.identity not in ("", caller.LOCAL, caller.NOBODY)
    return f"{call.identity}@{call.peer()}" if named else call.peer()
