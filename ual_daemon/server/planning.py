"""Plans paths on threads of their own, in bounded number, so that nothing that flies, serves or ends waits for a plan.

A plan is pure computation in Python: each one that is under way takes a share of the interpreter from the flight. So
more than a few at once are refused, not queued. The threads do not keep the process alive: a shutdown does not wait for
plans that nobody will fly.
"""

from __future__ import annotations

import contextvars
import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from ual.errors import ResourceExhaustedError
from ual_daemon import logs

T = TypeVar("T")

MOST_AT_ONCE = 2
"""For one UAV."""

_log = logging.getLogger(__name__)
_computing = threading.Lock()
"""One plan of the process computes at a time: two would not be ready sooner, and take more from the flight."""


class Planning:
    """The plans that are computed for the callers of one UAV. Any thread may call."""

    def __init__(self) -> None:
        self._free = threading.BoundedSemaphore(MOST_AT_ONCE)

    def begin(self, what: str, plan: Callable[[], T]) -> Future[T]:
        """Begins to plan. The future ends with the result of `plan`, or with its error; it cannot be cancelled.

        Raises:
            ResourceExhaustedError: So many plans are under way that this one has to be refused.

        """
        if not self._free.acquire(blocking=False):
            error = ResourceExhaustedError(
                f"{what}: {MOST_AT_ONCE} paths are being planned for this UAV already, which is the limit; try again "
                "when one of them is ready",
                {"limit": str(MOST_AT_ONCE)},
            )
            logs.refused(_log, what, error)
            raise error
        future: Future[T] = Future()
        future.set_running_or_notify_cancel()
        run = contextvars.copy_context().run  # with the caller's address, for the log
        threading.Thread(target=run, args=(self._plan, plan, future), name="planning", daemon=True).start()
        return future

    def _plan(self, plan: Callable[[], T], future: Future[T]) -> None:
        try:
            with _computing:
                result = plan()
        except BaseException as error:  # noqa: BLE001  it belongs to whoever waits
            self._free.release()
            future.set_exception(error)
        else:
            self._free.release()
            future.set_result(result)
