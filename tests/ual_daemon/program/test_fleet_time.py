"""Changes of time by several processes at once: all make them in one order, and nobody waits for ever."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import cast

import pytest

from tests.waiting import LIMIT_S, until
from ual.errors import UalError, WrongStateError
from ual.interface import Simulation
from ual_daemon.program import fleet_time
from ual_daemon.program.fleet_time import ASK, MAKE, FleetTime, Relay


class World:
    """The time of one worker: it keeps each change that is made."""

    def __init__(self) -> None:
        self.changes: list[float] = []
        self.refusal: UalError | None = None

    def set_speed_factor(self, speed_factor: float) -> None:
        if self.refusal is not None:
            raise self.refusal
        self.changes.append(speed_factor)

    def step(self, duration_s: float) -> None:
        self.changes.append(duration_s)


class Worker:
    """A worker of a fleet that is one process here; what it tells reaches the relay one word after the other."""

    def __init__(self, fleet: Fleet) -> None:
        self.world, self.is_running, self.is_deaf = World(), True, False
        self.time = FleetTime(
            cast("Simulation", self.world), lambda *words: fleet.on_words(self, *words), lambda: fleet.is_over
        )

    def tell(self, *words: object) -> None:
        if not self.is_deaf:
            answer: Callable[..., None] = self.time.on_make if words[0] == MAKE else self.time.on_made
            answer(*words[1:])


class Fleet:
    def __init__(self, count: int) -> None:
        self.workers = [Worker(self) for _ in range(count)]
        self.relay = Relay(self.workers)
        self.is_over = False
        self._one_at_a_time = threading.Lock()

    def on_words(self, worker: Worker, word: str, *rest: object) -> None:
        take: Callable[..., None] = self.relay.on_ask if word == ASK else self.relay.on_made
        with self._one_at_a_time:
            take(worker, *rest)

    def end(self, worker: Worker) -> None:
        with self._one_at_a_time:
            worker.is_running = False
            self.relay.on_end(worker)


def test_all_make_the_changes_of_all_in_one_order() -> None:
    fleet = Fleet(3)
    with ThreadPoolExecutor(3) as callers:
        for calls in [
            [callers.submit(worker.time.set_speed_factor, float(i)) for worker in fleet.workers] for i in range(50)
        ]:
            for call in calls:
                call.result(LIMIT_S)
    first, *others = [worker.world.changes for worker in fleet.workers]
    assert len(first) == 150
    assert others == [first, first]


def test_the_one_that_queried_gets_the_refusal() -> None:
    fleet = Fleet(2)
    for worker in fleet.workers:
        worker.world.refusal = WrongStateError("not now")
    with pytest.raises(WrongStateError, match=r"^not now"):
        fleet.workers[0].time.set_speed_factor(1.0)
    fleet.workers[0].world.refusal = None
    with pytest.raises(WrongStateError, match="another process of this fleet has refused it: not now"):
        fleet.workers[0].time.set_speed_factor(2.0)
    fleet.workers[0].time.step(0.5)
    assert fleet.workers[1].world.changes == [0.5]


def test_one_that_ends_is_not_waited_for() -> None:
    fleet = Fleet(2)
    first, second = fleet.workers
    second.is_deaf = True
    with ThreadPoolExecutor(1) as callers:
        call = callers.submit(first.time.step, 0.5)
        until(lambda: first.world.changes == [0.5])
        assert not call.done()
        fleet.end(second)
        call.result(LIMIT_S)
        callers.submit(first.time.step, 0.25).result(LIMIT_S)


def test_at_the_end_nothing_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_time, "_END_CHECK_S", 0.01)
    fleet = Fleet(2)
    fleet.workers[1].is_deaf = True
    with ThreadPoolExecutor(1) as callers:
        call = callers.submit(fleet.workers[0].time.step, 0.5)
        until(lambda: fleet.workers[0].world.changes == [0.5])
        fleet.is_over = True
        with pytest.raises(WrongStateError, match="this fleet ends"):
            call.result(LIMIT_S)
