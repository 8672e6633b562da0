"""What is the same for every call: who calls, for which UAV, and how calls end at shutdown."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import grpc

from ual.errors import InvalidArgumentError, ResourceExhaustedError
from ual_daemon import logs
from ual_daemon.server.dispatch import SHUTTING_DOWN, Answer, Handler, Method, StatusError
from ual_daemon.server.transport.base import Call

NAMESPACE_KEY = "ual-ns"
MOST_OF_ONE_METHOD = 100
"""Calls and streams of one method that are under way for one UAV. For each method by itself: a hundred readers of the
telemetry must not keep out who lands the UAV."""

_log = logging.getLogger(__name__)


class Calls:
    """Answers the calls for one UAV, with the servicers that are registered. Belongs to the event loop that runs now.

    It is a registry for generated code (``add_..._to_server``), and `take` takes the calls of a server. `log_name` is
    the UAV's name in the log. Once the shutdown has begun, methods that begin with one of `shutdown_refuses` are
    refused.
    """

    def __init__(self, ns: str, shutdown_refuses: tuple[str, ...], log_name: str = "") -> None:
        self._ns = ns
        self._log_name = log_name
        self._has_ended_waiting = False
        self._shutdown_refuses = shutdown_refuses
        self._loop = asyncio.get_running_loop()
        self._methods: dict[str, Method] = {}
        self._lock = threading.Lock()
        self._answers: set[Answer] = set()
        self._running: Counter[str] = Counter()
        self.is_shutting_down = False

    def add_generic_rpc_handlers(self, handlers: Sequence[grpc.GenericRpcHandler]) -> None:
        """Does nothing: these are the same methods again, in the form of gRPC before 1.67."""

    def add_registered_method_handlers(self, service: str, handlers: Mapping[str, Handler]) -> None:
        """Registers the methods of a service, but those that its servicer does not implement."""
        for name, handler in handlers.items():
            method = Method(handler)
            if not method.is_generated:
                self._methods[f"/{service}/{name}"] = method

    def take(self, call: Call) -> None:
        """Begins to answer a call, on the transport's thread."""
        method = self._methods.get(call.method)
        if method is None:
            call.finish(code=grpc.StatusCode.UNIMPLEMENTED, details=f"there is no method {call.method:.100}")
        else:
            method.kind(self, method, call).begin()

    @property
    def running_count(self) -> int:
        """How many calls are under way that a shutdown has to end."""
        return len(self._answers)

    def begin_shutdown(self) -> None:
        """Ends the streams, and refuses new calls that fly. To be called on the event loop, as is `end_waiting`."""
        self.is_shutting_down = True
        self._end(streams=True)

    def end_waiting(self) -> None:
        """Ends the calls that still wait, and from now on those that would begin to."""
        self._has_ended_waiting = True
        self._end(streams=False)

    def _end(self, *, streams: bool) -> None:
        with self._lock:
            ending = [answer for answer in self._answers if answer.is_stream is streams]
        for answer in ending:
            answer.end()

    # --- For the answers ----------------------------------------------------------------------------------------------

    def join(self, answer: Answer) -> None:
        """Adds an answer that is under way: a shutdown ends it.

        Raises:
            ResourceExhaustedError: It is a stream, and too many of its method are under way.

        """
        if answer.is_stream:
            self.require_room(answer.method_name)
        with self._lock:
            self._answers.add(answer)
            self._running[answer.method_name] += 1
        if self._has_ended_waiting and not answer.is_stream:  # it began before, but was not known yet
            answer.end()

    def leave(self, answer: Answer) -> None:
        """Removes an answer that has ended."""
        with self._lock:
            if answer in self._answers:
                self._answers.discard(answer)
                self._running[answer.method_name] -= 1

    def require_room(self, method: str) -> None:
        """Refuses a call of a method of which too many are under way.

        Raises:
            ResourceExhaustedError: They are.

        """
        if self._running[method] < MOST_OF_ONE_METHOD:
            return
        error = ResourceExhaustedError(
            f"{MOST_OF_ONE_METHOD} calls of {method} are under way for {self._ns}, which is the limit: end one of them",
            {"limit": str(MOST_OF_ONE_METHOD)},
        )
        logs.refused(_log, method, error)
        raise error

    def require_accepted(self, call: Call) -> None:
        """Refuses a call for another UAV, and after the shutdown has begun one that flies.

        Raises:
            InvalidArgumentError: The caller means another UAV.
            StatusError: The daemon is shutting down.

        """
        if self.is_shutting_down and call.method.startswith(self._shutdown_refuses):
            raise StatusError(grpc.StatusCode.UNAVAILABLE, SHUTTING_DOWN)
        for key, value in call.metadata:
            if key == NAMESPACE_KEY and value != self._ns:
                raise InvalidArgumentError(
                    f"this daemon flies {self._ns}, not {value!s:.64}", {"field": NAMESPACE_KEY, "namespace": self._ns}
                )

    def set_log_context(self, call: Call | None) -> None:
        """Names this UAV, and the caller, in what this thread or task logs from now on."""
        logs.caller.set(None if call is None else call.peer)
        if self._log_name:
            logs.uav.set(self._log_name)

    def on_loop(self, callback: Callable[..., object], *arguments: object) -> bool:
        """Calls it on the event loop, soon. Returns False if that is closed."""
        try:
            self._loop.call_soon_threadsafe(callback, *arguments)
        except RuntimeError:
            return False
        return True
