"""Waits on the event loop for futures that other threads complete."""

from __future__ import annotations

import asyncio
import threading
from concurrent.futures import Future
from contextlib import suppress
from typing import Any, TypeVar
from weakref import WeakKeyDictionary, WeakSet

R = TypeVar("R")
T = TypeVar("T")


_lock = threading.Lock()
_waiters: WeakKeyDictionary[Future[Any], WeakSet[asyncio.Future[None]]] = WeakKeyDictionary()
"""Waiters of each future. One that gives up costs nothing any more, neither memory nor time when the future ends."""


def completion(future: Future[Any]) -> asyncio.Future[None]:
    """Returns a future of the running loop that is done when the given one is, whatever its result.

    Unlike `asyncio.wrap_future`, cancelling it leaves the given future as it is: others may wait for that, too.
    """
    done: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    with _lock:
        is_first = future not in _waiters
        _waiters.setdefault(future, WeakSet()).add(done)
    if is_first:
        future.add_done_callback(_notify)
    elif future.done():  # perhaps before this one waited
        _mark_soon(done)
    return done


def _notify(future: Future[Any]) -> None:
    with _lock:
        waiting = list(_waiters[future])
    for done in waiting:
        _mark_soon(done)


def _mark_soon(done: asyncio.Future[None]) -> None:
    with suppress(RuntimeError):  # the loop is closed: nobody waits any more
        done.get_loop().call_soon_threadsafe(_mark, done)


def _mark(done: asyncio.Future[None]) -> None:
    if not done.done():
        done.set_result(None)


async def ended(future: Future[T]) -> T:
    """Waits for the future. Returns its result, or raises its error. If the caller is cancelled, the future goes on."""
    await completion(future)
    return future.result()


async def after(future: Future[None], response: R) -> R:
    """Waits for the future. Returns the response, or raises the future's error."""
    await ended(future)
    return response
