"""Waits with a limit. It needs no ROS."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable


async def ends_within(asked: Awaitable[object], limit_s: float) -> bool:
    """Returns whether an awaitable ends within a time. Raises what it raises.

    A cancel is never lost here. In `asyncio.wait_for` of Python before 3.12 one is lost that comes with the end: then
    a cancelled goal would fly.
    """
    asking = asyncio.ensure_future(asked)
    try:
        done, _ = await asyncio.wait((asking,), timeout=limit_s)
        if done:
            asking.result()
        return bool(done)
    finally:
        asking.cancel()
