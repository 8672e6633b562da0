"""The services of MAVROS that take long: each job in its turn, and what their errors mean.

A plugin serves one request at a time, and waits for the autopilot meanwhile. It refuses another one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, NamedTuple, TypeVar

from ual.errors import LinkLostError, NotSupportedError, ResourceExhaustedError, UalError, UalTimeoutError
from ual_daemon.backends import futures
from ual_daemon.backends.chain import caught, pass_on, then_wait
from ual_daemon.backends.engine.contained import defect
from ual_daemon.backends.mavros.session import MavrosSession
from ual_daemon.backends.rosbridge import Message, RosGeneration
from ual_daemon.backends.rosbridge.calls import ServiceError, ServiceTimeoutError

T = TypeVar("T")

MOST_WAITING_JOBS = 100
"""Jobs that may wait for their turn."""
BUSY_RETRY_S = 1.0
"""The time from a refusal of a plugin that is busy to the next attempt."""
_MISSING, _BUSY = "does not exist", "responded with an error"


class MavrosAccess(NamedTuple):
    """The way to MAVROS.

    Attributes:
        session: Returns the session, in reach or not; None before there was one.
        session_in_reach: Returns the session that is in reach, or why none is.
        give_it: Returns a future that something ends on the link's thread.
        call: Calls a service of MAVROS, or one of another node by its whole name, with a time limit in seconds.
        ros: Returns the generation of ROS; None while that is not known.
        node: Returns the whole name of MAVROS' node.

    """

    session: Callable[[], MavrosSession | None]
    session_in_reach: Callable[[str], MavrosSession | UalError]
    give_it: Callable[[str, Callable[[Future[Any]], None]], Future[Any]]
    call: Callable[[str, Message, float], Future[Message]]
    ros: Callable[[], RosGeneration | None]
    node: Callable[[], str]


class _Job(NamedTuple):
    what: str
    begin: Callable[[], Future[Any]]
    future: Future[Any]


class Services:
    """Calls services, one job at a time. `give` is for any thread, the rest for the link's."""

    def __init__(self, access: MavrosAccess) -> None:
        self.access = access
        self._waiting: deque[_Job] = deque()
        self._running: _Job | None = None
        self._pauses: list[tuple[float, Future[None]]] = []
        self._now_s = 0.0

    def give(self, what: str, begin: Callable[[], Future[T]]) -> Future[T]:
        """Returns the future of a job, which `begin` begins in its turn. `what` says human-readably what it does."""
        session = self.access.session_in_reach(what)
        if isinstance(session, UalError):
            return futures.failed(session)
        return self.access.give_it(what, lambda future: self._add(_Job(what, begin, future)))

    def tick(self, now_s: float) -> None:
        """Begins what is due; to be called often."""
        self._now_s = now_s
        due = [pause for end_s, pause in self._pauses if now_s >= end_s]
        self._pauses = [each for each in self._pauses if now_s < each[0]]
        for pause in due:
            futures.end(pause)
        while (self._running is None or self._running.future.done()) and self._waiting:
            self._begin(self._waiting.popleft())

    def pause(self, duration_s: float) -> Future[None]:
        """Returns a future that ends after a while."""
        pause: Future[None] = Future()
        self._pauses.append((self._now_s + duration_s, pause))
        return pause

    def call(self, service: str, arguments: Message, limit_s: float, what: str, doubt: str = "") -> Future[Message]:
        """Calls a service. The future ends with its values, or with a `UalError`.

        `what` is what it is called for. `doubt` says, human-readable, what is not known where it has not answered.
        """
        answer = self.access.call(service, arguments, limit_s)
        return caught(answer, lambda error: futures.failed(explained(error, what, doubt)))

    def call_free(
        self,
        service: str,
        arguments: Message,
        limit_s: float,
        what: str,
        doubt: str = "",
        tries_count: int = 5,
        refusal: Callable[[], UalError | None] = lambda: None,
    ) -> Future[Message]:
        """As `call`, again after a while where the plugin is busy. `refusal` is called before each."""
        error = refusal()
        if error is not None:
            return futures.failed(error)

        def again(failure: BaseException) -> Future[Message]:
            if not isinstance(failure, BusyError):
                return futures.failed(failure)
            if tries_count <= 1:
                return futures.failed(UalTimeoutError(failure.message, failure.metadata))
            return then_wait(
                self.pause(BUSY_RETRY_S),
                lambda _: self.call_free(service, arguments, limit_s, what, doubt, tries_count - 1, refusal),
            )

        return caught(self.call(service, arguments, limit_s, what, doubt), again)

    def _add(self, job: _Job) -> None:
        if len(self._waiting) >= MOST_WAITING_JOBS:
            text = f"{MOST_WAITING_JOBS} jobs of MAVROS wait already, which is the limit"
            futures.fail(job.future, ResourceExhaustedError(text, {"limit": str(MOST_WAITING_JOBS)}))
        else:
            self._waiting.append(job)

    def _begin(self, job: _Job) -> None:
        if job.future.cancelled():
            return
        self._running = job
        session = self.access.session_in_reach(job.what)
        if isinstance(session, UalError):
            futures.fail(job.future, session)
            return
        try:
            running = job.begin()
        except UalError as error:
            futures.fail(job.future, error)
            return
        except Exception as error:  # noqa: BLE001 - logged, and raised to the caller
            futures.fail(job.future, defect(job.what, error))
            return
        pass_on(running, job.future)


class BusyError(UalError):
    """A plugin has another request in progress. Not for callers of UAL."""


def explained(error: BaseException, what: str, doubt: str) -> BaseException:
    """Returns what the error of a service means."""
    if not isinstance(error, ServiceError):
        return error
    tail = f"; {doubt}" if doubt else ""
    if _MISSING in error.text:
        text = f"cannot {what}: MAVROS offers no {error.service}: its plugin is on MAVROS' deny list, or MAVROS is gone"
        return NotSupportedError(text, {"service": error.service})
    if _BUSY in error.text:
        text = f"cannot {what}: {error.service} has another request under way, of another program or MAVROS' own"
        return BusyError(text, {"service": error.service})
    if isinstance(error, ServiceTimeoutError):
        return UalTimeoutError(f"cannot {what}: {error}{tail}", {"service": error.service})
    return LinkLostError(f"cannot {what}: {error}{tail}", {"service": error.service})
