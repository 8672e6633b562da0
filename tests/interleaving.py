"""Runs threads one at a time, and switches between them before each line of some files, as a test says."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, count
from types import FrameType
from typing import Any

from tests.conftest import LIMIT_S


class _Worker:
    """A thread that goes on by one line whenever it is told to."""

    def __init__(self, do: Callable[[], None], files: frozenset[str]) -> None:
        self._do, self._files = do, files
        self._go, self._stopped = threading.Semaphore(0), threading.Semaphore(0)
        self.is_done = self.is_blocked = False
        self.lines_count = 0
        self.error: BaseException | None = None
        self.thread = threading.Thread(target=self._run, daemon=True)

    def _run(self) -> None:
        self._go.acquire()
        sys.settrace(self._trace)
        try:
            self._do()
        except BaseException as error:  # noqa: BLE001  raised by `run`
            self.error = error
        finally:
            sys.settrace(None)
            self.is_done = True
            self._stopped.release()

    def _trace(self, frame: FrameType, event: str, _: Any) -> Callable[..., Any] | None:
        if frame.f_code.co_filename not in self._files:
            return None
        if event == "line":
            self.pause()
        return self._trace

    def pause(self) -> None:
        """Lets the others go on, and waits until it is told to go on."""
        self._stopped.release()
        self._go.acquire()

    def go_on(self) -> None:
        self.lines_count += 1
        self._go.release()
        assert self._stopped.acquire(timeout=LIMIT_S), "the thread waits for another one, which cannot go on"


class Interleaving:
    """Threads that are interleaved line by line. Give `lock` to the code, in the place of its own lock."""

    def __init__(self, files: Iterable[str]) -> None:
        self._files = frozenset(files)
        self._workers: list[_Worker] = []
        self.lock = _Lock(self)

    def run(self, actions: Sequence[Callable[[], None]], schedule: Iterable[int]) -> list[int]:
        """Runs each action on a thread of its own. The schedule says which one goes on; after its end, all in turn.

        Raises the first error of an action. Returns how many lines each has run.
        """
        self._workers = [_Worker(each, self._files) for each in actions]
        for worker in self._workers:
            worker.thread.start()
        numbers: Iterator[int] = chain(schedule, count())
        while alive := [worker for worker in self._workers if not (worker.is_done or worker.is_blocked)]:
            alive[next(numbers) % len(alive)].go_on()
        assert all(worker.is_done for worker in self._workers), "each waits for another one"
        for worker in self._workers:
            worker.thread.join(LIMIT_S)
            if worker.error is not None:
                raise worker.error
        return [worker.lines_count for worker in self._workers]

    def wait(self) -> None:
        """Makes the calling thread wait until the lock is free."""
        (me,) = (worker for worker in self._workers if worker.thread is threading.current_thread())
        me.is_blocked = True
        me.pause()

    def wake(self) -> None:
        """Lets those go on that wait for the lock."""
        for worker in self._workers:
            worker.is_blocked = False


class _Lock:
    """A lock that lets another thread go on while it is held."""

    def __init__(self, interleaving: Interleaving) -> None:
        self._interleaving = interleaving
        self._is_held = False

    def __enter__(self) -> None:
        while self._is_held:
            self._interleaving.wait()
        self._is_held = True

    def __exit__(self, *_: object) -> None:
        self._is_held = False
        self._interleaving.wake()
