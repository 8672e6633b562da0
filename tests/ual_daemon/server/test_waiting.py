from __future__ import annotations

import asyncio
from collections.abc import Callable
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


def test_the_end_of_what_many_have_waited_for_notifies_only_those_who_still_wait(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A client that waits for a task in short pieces leaves thousands behind, all on the thread that flies."""
    notified: list[object] = []

    async def run() -> None:
        loop = asyncio.get_running_loop()
        soon = loop.call_soon_threadsafe

        def note(callback: Callable[..., object], *arguments: object) -> asyncio.Handle:
            notified.append(callback)
            return soon(callback, *arguments)

        monkeypatch.setattr(loop, "call_soon_threadsafe", note)
        future: Future[None] = Future()
        for _ in range(1000):
            await asyncio.wait((completion(future),), timeout=0.0)
        patient = asyncio.create_task(ended(future))
        await asyncio.sleep(0)
        future.set_result(None)
        await patient
        await completion(future)  # one that comes too late has not to wait

    asyncio.run(run())
    assert len(notified) <= 10
