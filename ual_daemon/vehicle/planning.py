"""Plans paths on threads of their own, in bounded number, so that nothing that flies, serves or ends waits for a plan.

A plan is pure computation in Python: each one that is in progress takes a share of the interpreter from the flight. So
more than a few at once are refused, not queued. The threads do not keep the process alive: a shutdown does not wait for
plans that nobody will fly.
"""

from __future__ import annotations

import contextvars
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import NamedTuple, TypeVar

from ual.errors import ResourceExhaustedError
from ual_daemon import logs

T = TypeVar("T")

MOST_PLANS_AT_ONCE = 2
"""For one UAV."""

_log = logging.getLogger(__name__)
_computing = threading.Lock()
"""One plan of the process computes at a time: two would not be ready sooner, and take more from the flight."""


class PlanFigures(NamedTuple):
    """Plans in progress, plans that have ended, and the sum of their durations in s, their wait included."""

    running_count: int = 0
    ended_count: int = 0
    ended_s: float = 0.0

    def begun(self) -> PlanFigures:
        """Returns the figures with one more in progress."""
        return self._replace(running_count=self.running_count + 1)

    def ended(self, duration_s: float) -> PlanFigures:
        """Returns the figures after one has ended."""
        return PlanFigures(self.running_count - 1, self.ended_count + 1, self.ended_s + duration_s)


class Planning:
    """The plans that are computed for the callers of one UAV. Any thread may call."""

    def __init__(self) -> None:
        self._free = threading.BoundedSemaphore(MOST_PLANS_AT_ONCE)
        self._lock = threading.Lock()
        self._figures = PlanFigures()

    @property
    def figures(self) -> PlanFigures:
        """Counts and durations of the plans."""
        return self._figures

    def begin(self, what: str, plan: Callable[[], T]) -> Future[T]:
        """Begins to plan. The future ends with the result of `plan`, or with its error; it cannot be cancelled.

        Raises:
            ResourceExhaustedError: So many plans, or threads, are in progress that this one has to be refused.

        """
        if not self._free.acquire(blocking=False):
            error = ResourceExhaustedError(
                f"{what}: {MOST_PLANS_AT_ONCE} paths are being planned for this UAV already, which is the limit; try "
                "again when one of them is ready",
                {"limit": str(MOST_PLANS_AT_ONCE)},
            )
            logs.refused(_log, what, error)
            raise error
        with self._lock:
            self._figures = self._figures.begun()
        future: Future[T] = Future()
        future.set_running_or_notify_cancel()
        run = contextvars.copy_context().run  # with the caller's address, for the log
        thread = threading.Thread(target=run, args=(self._plan, plan, future), name="planning", daemon=True)
        try:
            thread.start()
        except RuntimeError as error:
            self._end(time.monotonic())
            raise ResourceExhaustedError(f"{what}: this computer starts no more threads ({error})") from None
        return future

    def _plan(self, plan: Callable[[], T], future: Future[T]) -> None:
        began_s = time.monotonic()
        try:
            with _computing:
                result = plan()
        except BaseException as error:  # noqa: BLE001  it belongs to whoever waits
            self._end(began_s)
            future.set_exception(error)
        else:
            self._end(began_s)
            future.set_result(result)

    def _end(self, began_s: float) -> None:
        with self._lock:
            self._figures = self._figures.ended(time.monotonic() - began_s)
        self._free.release()
