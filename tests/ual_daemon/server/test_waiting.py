from __future__ import annotations

import asyncio
from concurrent.futures import Future

import pytest

from ual.errors import TaskAbortedError
from ual_daemon.server.waiting import completion, ended


def test_it_ends_with_the_result_or_the_error() -> None:
    async def run() -> None:
        future: Future[int] = Future()
        waiting = asyncio.create_task(ended(future))
        await asyncio.to_thread(future.set_result, 7)
        assert await waiting == 7
        failed: Future[None] = Future()
        failed.set_exception(TaskAbortedError("replaced"))
        with pytest.raises(TaskAbortedError, match="replaced"):
            await ended(failed)

    asyncio.run(run())


def test_giving_up_leaves_the_future_to_others() -> None:
    async def run() -> None:
        future: Future[None] = Future()
        impatient, patient = asyncio.create_task(ended(future)), asyncio.create_task(ended(future))
        await asyncio.sleep(0)
        impatient.cancel()
        with pytest.raises(asyncio.CancelledError):
            await impatient
        assert not future.cancelled()
        future.set_result(None)
        await patient

    asyncio.run(run())


def test_a_future_may_outlive_the_loop() -> None:
    future: Future[None] = Future()

    async def run() -> None:
        completion(future)

    asyncio.run(run())
    future.set_result(None)
