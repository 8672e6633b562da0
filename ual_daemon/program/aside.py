"""Work off the event loop at the daemon's end, where the system may have no memory for a thread any more."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from ual_daemon import logs

T = TypeVar("T")

_log = logging.getLogger(__name__)


async def aside(work: Callable[[], object]) -> None:
    """Does something that may block on a thread of its own; where none can be started, here: it must be done."""
    loop, done = asyncio.get_running_loop(), asyncio.get_running_loop().create_future()

    def run() -> None:
        try:
            work()
        except BaseException as error:  # noqa: BLE001  raised where it is waited for
            loop.call_soon_threadsafe(done.set_exception, error)
        else:
            loop.call_soon_threadsafe(done.set_result, None)

    try:
        threading.Thread(target=run, name="ending", daemon=True).start()
    except RuntimeError as error:
        _note(error)
        work()
    else:
        await done


def outcome(main: Coroutine[Any, Any, T]) -> T:
    """Runs a program's coroutine and returns what it returned, also where the loop cannot end as it should.

    At its end asyncio starts a thread, only to wait for those of its executor.
    """
    outcomes: list[T] = []

    async def run() -> None:
        outcomes.append(await main)

    try:
        asyncio.run(run())
    except RuntimeError as error:
        if not outcomes:
            raise
        _note(error)
    return outcomes[0]


def _note(error: RuntimeError) -> None:
    logs.event(_log, logging.WARNING, "no_thread", why=error, effect="the end goes on without it")
