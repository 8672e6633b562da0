"""Futures that only the flight ends."""

from __future__ import annotations

from concurrent.futures import Future

from ual.errors import UalError


def running_future() -> Future[None]:
    """Returns a future that a waiting caller cannot cancel, because it counts as running."""
    future: Future[None] = Future()
    future.set_running_or_notify_cancel()
    return future


def end_future(future: Future[None], error: UalError | None) -> None:
    """Ends a future, with an error or (None) as done. Runs its callbacks, so hold no lock."""
    if error is None:
        future.set_result(None)
    else:
        future.set_exception(error)
