"""Waits with a limit: a cancel is never lost."""

from __future__ import annotations

import asyncio

import pytest

from tests.waiting import LIMIT_S
from ual.shared.waiting import ends_within


def test_a_wait_that_is_cancelled_as_it_ends_is_cancelled() -> None:
    async def program() -> None:
        asked: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        waiting = asyncio.create_task(ends_within(asked, LIMIT_S))
        await asyncio.sleep(0)  # it has begun
        asked.set_result(None)
        waiting.cancel()
        await asyncio.wait((waiting,))
        assert waiting.cancelled()

    asyncio.run(program())


def test_what_is_abandoned_has_ended() -> None:
    async def program() -> None:
        assert not await ends_within(asyncio.Event().wait(), 0.01)
        assert len(asyncio.all_tasks()) == 1
        waiting = asyncio.create_task(ends_within(asyncio.Event().wait(), None))
        await asyncio.sleep(0)  # it has begun
        waiting.cancel()
        await asyncio.wait((waiting,))
        assert len(asyncio.all_tasks()) == 1

    asyncio.run(program())


def test_what_fails_in_time_raises() -> None:
    async def requests_made() -> None:
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        asyncio.run(ends_within(requests_made(), LIMIT_S))
