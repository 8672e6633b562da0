"""Futures of commands: they end with the autopilot's answer, unless they were withdrawn (cancelled) before."""

from __future__ import annotations

from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError

from ual.errors import UalTimeoutError


def done() -> Future[None]:
    """Returns a future that has ended well."""
    future: Future[None] = Future()
    future.set_result(None)
    return future


def failed(error: BaseException) -> Future[None]:
    """Returns a future that has ended with an error."""
    future: Future[None] = Future()
    future.set_exception(error)
    return future


def end(future: Future[None], error: BaseException | None = None) -> bool:
    """Ends a future, with an error or as done. Returns False if it was withdrawn. Runs callbacks, so hold no lock."""
    if not future.set_running_or_notify_cancel():
        return False
    if error is None:
        future.set_result(None)
    else:
        future.set_exception(error)
    return True


def wait(future: Future[None], limit_s: float, late: str) -> None:
    """Waits for the end of a command, and withdraws it after the limit.

    Raises:
        UalTimeoutError: It had not ended by then; says `late`.
        UalError: It was refused.
    """
    try:
        future.result(limit_s)
    except FutureTimeoutError:
        future.cancel()
        raise UalTimeoutError(late) from None
