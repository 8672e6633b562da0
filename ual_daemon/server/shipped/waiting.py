"""Waits on the event loop for what a shipped service has begun."""

from __future__ import annotations

import asyncio
from concurrent.futures import Future
from typing import TypeVar

from ual_daemon.extensions.shipped.vehicle import late, withdrawn

T = TypeVar("T")


async def ended(future: Future[T], limit_s: float, what: str) -> T:
    """Returns the result. What the caller gives up is cancelled.

    Raises:
        UalTimeoutError: It was not there in time.
        UalError: As the future ends, or the backend has withdrawn it.

    """
    waited = asyncio.wrap_future(future)
    try:
        # Not `wait_for`: its time-out looks like one that the future ends with.
        done, _ = await asyncio.wait([waited], timeout=limit_s)
    finally:
        future.cancel()
    if not done:
        raise late(what, limit_s)
    if waited.cancelled():
        raise withdrawn(what)
    return await waited
