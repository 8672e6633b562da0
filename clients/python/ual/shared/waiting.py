"""Waits on an event loop with a limit."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable


async def ends_within(awaited: Awaitable[object], limit_s: float | None) -> bool:
    """Returns whether an awaitable ends within a time; None: without a limit. Raises what it raises.

    What is given up has ended when this returns. A cancel is never lost here. In `asyncio.wait_for` of Python before
    3.12 one is lost that comes with the end: then a cancelled program would fly on.
    """
    asking = asyncio.ensure_future(awaited)
    try:
        done, _ = await asyncio.wait((asking,), timeout=limit_s)
        if done:
            asking.result()
        return bool(done)
    finally:
        if not asking.done():
            asking.cancel()
            await asyncio.wait((asking,))
