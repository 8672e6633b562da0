"""Futures of commands: they end with the autopilot's answer, unless they were withdrawn (cancelled) before."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from ual.errors import LinkLostError, RejectedByAutopilotError, UalError, UalTimeoutError

T = TypeVar("T")


def done() -> Future[None]:
    """Returns a future that has ended well."""
    future: Future[None] = Future()
    future.set_result(None)
    return future


def failed(error: BaseException) -> Future[Any]:
    """Returns a future, of any result, that has ended with an error."""
    future: Future[Any] = Future()
    future.set_exception(error)
    return future


def refused(text: str) -> Future[Any]:
    """Returns a future, of any result, that has ended with a refusal for a reason."""
    return failed(RejectedByAutopilotError(f"refused: {text}", {"text": text}))


def end(future: Future[None], error: BaseException | None = None) -> bool:
    """Ends a future, with an error or as done. Returns False if it was withdrawn. Runs callbacks, so hold no lock."""
    if error is not None:
        return fail(future, error)
    if not future.set_running_or_notify_cancel():
        return False
    future.set_result(None)
    return True


def finish(future: Future[T], result: T) -> bool:
    """Ends a future with a result. Returns False if it was withdrawn. Runs callbacks, so hold no lock."""
    if not future.set_running_or_notify_cancel():
        return False
    future.set_result(result)
    return True


def fail(future: Future[Any], error: BaseException) -> bool:
    """Ends a future of any result with an error, as `end` does."""
    if not future.set_running_or_notify_cancel():
        return False
    future.set_exception(error)
    return True


class OpenFutures:
    """The futures that a UAV has given and not ended yet: none of them outlives it. From any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        # Weak: those of commands that others have replaced stay open, and are forgotten with the last waiter.
        self._open: WeakKeyDictionary[Future[Any], str] = WeakKeyDictionary()
        self._is_closed = False

    def give(self, what: str, begin: Callable[[Future[T]], object]) -> Future[T]:
        """Returns a future that `begin` has something end. `what` is human-readable: "take a photo"."""
        future: Future[T] = Future()
        with self._lock:
            if self._is_closed:
                return failed(LinkLostError(f"cannot {what}: this UAV is closed"))
            self._open[future] = what
        future.add_done_callback(self._forget)
        begin(future)
        return future

    def close(self) -> None:
        """Ends them with an error. To be called once nothing else ends them."""
        with self._lock:
            self._is_closed, left = True, list(self._open.items())
        for future, what in left:
            if not future.done():
                fail(future, LinkLostError(f"cannot {what}: this UAV was closed meanwhile, and it may still be done"))

    def _forget(self, ended: Future[Any]) -> None:
        with self._lock:
            self._open.pop(ended, None)


def may_be_done(ended: Future[Any]) -> bool:
    """Returns whether what was ordered is done, or may be: only an answer, or none, tells that it is not."""
    return ended.cancelled() or ended.exception() is None or isinstance(ended.exception(), UalTimeoutError)


def wait(
    future: Future[T], limit_s: float, late: str, withdrawn: str = "the command was withdrawn by the backend"
) -> T:
    """Waits for a result, and withdraws what has not ended after the limit.

    Raises:
        UalTimeoutError: It had not ended by then; it says `late`.
        UalError: As the future ends, or `withdrawn` if it was cancelled meanwhile.

    """
    # Not by `result`, whose time-out looks like one that the future ends with, as Python 3.11 has one `TimeoutError`.
    # `concurrent.futures.wait` does not see that a future was cancelled.
    ended = threading.Event()
    future.add_done_callback(lambda _: ended.set())
    try:
        is_ended = ended.wait(limit_s)
    finally:
        future.cancel()
    if not is_ended:
        raise UalTimeoutError(late)
    if future.cancelled():
        raise UalError(withdrawn)
    return future.result()
