"""The metrics of a fleet that several processes fly: the supervisor asks all workers, and serves what they answer."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from concurrent.futures import TimeoutError as NotInTimeError  # Python 3.10 has two of them
from typing import Protocol

from ual_daemon.program.metrics.catalogue import MetricSample

ASK = "metrics"
"""The supervisor's word for it."""
ANSWER_TIMEOUT_S = 2.0
"""Seconds without an answer after which a worker does not count as up."""


class MeteredWorker(Protocol):
    """A worker, as the supervisor sees it."""

    @property
    def names(self) -> Sequence[str]:
        """Its UAVs."""

    @property
    def is_running(self) -> bool:
        """Whether it has not ended."""

    def tell(self, *words: object) -> None:
        """Sends words to it."""


def packed(number: int, samples: Sequence[MetricSample]) -> bytes:
    """Returns the answer of a worker to the question of that number."""
    return json.dumps([number, samples]).encode()


class WorkersMetrics:
    """Asks the workers. `samples` is for the exporter's thread, the rest belongs to the event loop that runs now."""

    def __init__(self, workers: Sequence[MeteredWorker], own: Callable[[], Sequence[MetricSample]] = tuple) -> None:
        """`own` returns the values of the supervisor itself."""
        self._workers = workers
        self._own = own
        self._loop = asyncio.get_running_loop()
        self._number = 0
        self._found: dict[int, list[MetricSample]] = {}
        """Samples of each worker's answer, by the worker's number."""
        self._request: Future[list[MetricSample]] = Future()

    def samples(self) -> list[MetricSample]:
        """Returns the values of all workers, and which UAVs are not up. Waits `ANSWER_TIMEOUT_S` at most."""
        request: Future[list[MetricSample]] = Future()
        try:
            self._loop.call_soon_threadsafe(self._ask, request)
            return request.result(2.0 * ANSWER_TIMEOUT_S)
        except (RuntimeError, NotInTimeError):  # the loop is closed, or closes: the fleet ends
            return []

    def _ask(self, request: Future[list[MetricSample]]) -> None:
        self._number += 1
        self._request, self._found = request, {}
        for worker in self._workers:
            worker.tell(ASK, self._number)
        self._loop.call_later(ANSWER_TIMEOUT_S, self._finish, request)
        self._finish_if_complete()

    def on_answer(self, worker: MeteredWorker, answer: bytes) -> None:
        """Takes the answer of a worker, unless it is one to an earlier question."""
        number, samples = json.loads(answer)
        if number == self._number:
            self._found[self._workers.index(worker)] = [MetricSample(*each) for each in samples]
            self._finish_if_complete()

    def _finish_if_complete(self) -> None:
        if all(i in self._found or not worker.is_running for i, worker in enumerate(self._workers)):
            self._finish(self._request)

    def _finish(self, request: Future[list[MetricSample]]) -> None:
        if request.done():
            return
        silent = [name for i, worker in enumerate(self._workers) if i not in self._found for name in worker.names]
        down = [MetricSample("ual_up", "", {"ns": name}, 0.0) for name in silent]
        request.set_result([*(each for found in self._found.values() for each in found), *down, *self._own()])
