"""Futures of commands: they end with the autopilot's answer, unless they were withdrawn (cancelled) before."""

from __future__ import annotations

from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from typing import Any

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
    if error is not None:
        return fail(future, error)
    if not future.set_running_or_notify_cancel():
        return False
    future.set_result(None)
    return True


def fail(future: Future[Any], error: BaseException) -> bool:
    """Ends a future of any result with an error, as `end` does."""
    if not future.set_running_or_notify_cancel():
        return False
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
