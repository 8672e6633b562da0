"""Waits on the event loop for futures that other threads complete."""

from __future__ import annotations

import asyncio
from concurrent.futures import Future
from contextlib import suppress
from typing import Any, TypeVar

R = TypeVar("R")
T = TypeVar("T")


def completion(future: Future[Any]) -> asyncio.Future[None]:
    """Returns a future of the running loop that is done when the given one is, whatever its result.

    Unlike `asyncio.wrap_future`, cancelling it leaves the given future as it is: others may wait for that, too.
    """
    loop = asyncio.get_running_loop()
    done: asyncio.Future[None] = loop.create_future()

    def mark() -> None:
        if not done.done():
            done.set_result(None)

    def notify(_: Future[Any]) -> None:
        with suppress(RuntimeError):  # the loop is closed: nobody waits any more
            loop.call_soon_threadsafe(mark)

    future.add_done_callback(notify)
    return done


async def ended(future: Future[T]) -> T:
    """Waits for the future. Returns its result, or raises its error. If the caller is cancelled, the future goes on."""
    await completion(future)
    return future.result()


async def after(future: Future[None], response: R) -> R:
    """Waits for the future. Returns the response, or raises the future's error."""
    await ended(future)
    return response
