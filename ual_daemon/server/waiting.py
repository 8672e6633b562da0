"""Waiting, on the event loop, for what ends elsewhere."""

from __future__ import annotations

import asyncio
from concurrent.futures import Future
from contextlib import suppress
from typing import Any, TypeVar

T = TypeVar("T")


def completion(future: Future[Any]) -> asyncio.Future[None]:
    """Done when the future is, however that ended.

    Unlike `asyncio.wrap_future` it cannot cancel the future: a caller that no longer waits must not end what others
    wait for.
    """
    loop = asyncio.get_running_loop()
    done: asyncio.Future[None] = loop.create_future()

    def mark() -> None:
        if not done.done():
            done.set_result(None)

    def tell(_: Future[Any]) -> None:
        with suppress(RuntimeError):  # the loop is closed: nobody waits any more
            loop.call_soon_threadsafe(mark)

    future.add_done_callback(tell)
    return done


async def ended(future: Future[T]) -> T:
    """The result of the future, or its error. Giving up waiting leaves the future as it is."""
    await completion(future)
    return future.result()
