from __future__ import annotations

import asyncio
import json
from collections.abc import Sequence

import pytest

from tests.waiting import until_async
from ual_daemon.program.metrics import workers
from ual_daemon.program.metrics.catalogue import MetricSample
from ual_daemon.program.metrics.workers import ASK, WorkersMetrics, packed


class Worker:
    """A worker that answers when the test wants."""

    def __init__(self, *names: str, is_running: bool = True) -> None:
        self.names: Sequence[str] = names
        self.is_running = is_running
        self.told: list[tuple[object, ...]] = []

    def tell(self, *words: object) -> None:
        self.told.append(words)


def up(ns: str, value: float = 1.0) -> MetricSample:
    return MetricSample("ual_up", "", {"ns": ns}, value)


async def requests_made(metrics: WorkersMetrics, some: Sequence[Worker], *answering: Worker) -> list[MetricSample]:
    """Returns the served samples when some of the workers answer the next question."""
    before = [len(worker.told) for worker in some]
    found = asyncio.create_task(asyncio.to_thread(metrics.samples))
    await until_async(lambda: [len(worker.told) for worker in some] != before, "the question")
    for worker in answering:
        word, number = worker.told[-1]
        assert word == ASK
        assert isinstance(number, int)
        metrics.on_answer(worker, packed(number, [up(name) for name in worker.names]))
    return await found


def test_the_answers_of_all_stand_together() -> None:
    async def run() -> None:
        some = [Worker("uav_1", "uav_2"), Worker("uav_3")]
        assert await requests_made(WorkersMetrics(some), some, *reversed(some)) == [
            up("uav_3"),
            up("uav_1"),
            up("uav_2"),
        ]

    asyncio.run(run())


def test_uavs_of_a_process_that_has_ended_are_down() -> None:
    async def run() -> None:
        some = [Worker("uav_1"), Worker("uav_2", is_running=False)]
        assert await requests_made(WorkersMetrics(some), some, some[0]) == [up("uav_1"), up("uav_2", 0.0)]

    asyncio.run(run())


def test_uavs_of_a_process_that_does_not_answer_are_down(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "ANSWER_TIMEOUT_S", 0.2)

    async def run() -> None:
        some = [Worker("uav_1"), Worker("uav_2")]
        metrics = WorkersMetrics(some)
        assert await requests_made(metrics, some, some[0]) == [up("uav_1"), up("uav_2", 0.0)]
        metrics.on_answer(some[1], json.dumps([1, [["ual_up", "", {"ns": "late"}, 1.0]]]).encode())
        assert await requests_made(metrics, some, *some) == [up("uav_1"), up("uav_2")]

    asyncio.run(run())


def test_when_the_fleet_has_ended_there_is_nothing() -> None:
    async def make() -> WorkersMetrics:
        return WorkersMetrics([Worker("uav_1")])

    assert asyncio.run(make()).samples() == []
