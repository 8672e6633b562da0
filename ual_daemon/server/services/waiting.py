"""Waits on the event loop for what a shipped service has begun."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from concurrent.futures import Future
from typing import TypeVar

from ual.contract.methods import METHODS
from ual_daemon.services.answers import Pause, Steps
from ual_daemon.services.vehicle import late, withdrawn

T = TypeVar("T")


async def answer(future: Future[T], method: str) -> T:
    """Returns what a method has begun, as long as the contract says; see `ended`."""
    return await ended(future, METHODS[method].limit_s, method)


async def answers(stream: Steps[T], method: str) -> AsyncIterator[T]:
    """Yields the results of a stream. Raises as `answer`, for each future."""
    result: object = None
    try:
        while True:
            step = stream.send(result)
            result = None
            if isinstance(step, Future):
                result = await answer(step, method)
            elif isinstance(step, Pause):
                await asyncio.sleep(step.seconds)
            else:
                yield step
    except StopIteration:
        return
    finally:
        stream.close()


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
