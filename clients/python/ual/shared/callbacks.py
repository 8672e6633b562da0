"""Calls subscribers back with the newest sample, on threads that they share unless one of them is slow.

One thread for each subscription would mean one wake-up for each of them with every sample: with a hundred subscriptions
that takes milliseconds. One thread for all would be delayed by the slowest callback. So all subscriptions begin on one
worker thread. When a new sample finds that worker busy for longer than `SLOW_CALL_S`, the callback that it runs keeps
that worker, and the other subscriptions move to a new one.

A thread that has a sample and time to spare calls back itself (`Listener.offer`, then `Listener.call`), which saves
waking a worker. This is for quick callbacks: one that took longer than `SLOW_CALL_S` lately is called by a worker.
"""

from __future__ import annotations

import inspect
import logging
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from queue import Empty, SimpleQueue

from ual.errors import InvalidArgumentError
from ual.types import Telemetry

_log = logging.getLogger(__name__)

SLOW_CALL_S = 0.005
"""A callback that takes longer than this is slow."""
_QUICK_CALLS_COUNT = 10
"""Quick calls in a row after which a slow callback counts as quick again."""


class Callbacks:
    """The callbacks of all subscriptions of one client. May be used from any thread."""

    def __init__(self) -> None:
        self.calling_thread_ids: set[int] = set()
        """The threads that are running a callback now."""
        self._lock = threading.Lock()
        self._shared: _CallbackWorker | None = None

    def open(self, callback: Callable[[Telemetry], None]) -> Listener:
        """Returns a listener, which calls back with each sample that is put into it.

        Raises:
            InvalidArgumentError: It cannot be called, or it is a coroutine function, which nothing would await.

        """
        if not callable(callback):
            raise InvalidArgumentError(f"callback: {callback!r:.100} cannot be called", {"field": "callback"})
        if inspect.iscoroutinefunction(callback):
            raise InvalidArgumentError(
                "callback: a coroutine function is never awaited here; use ual.aio.Uav", {"field": "callback"}
            )
        with self._lock:
            worker = self._shared = self._shared or _CallbackWorker()
            listener = Listener(callback, worker, self)
            worker.listeners.add(listener)
        return listener

    # --- For the listeners --------------------------------------------------------------------------------------------

    def schedule(self, listener: Listener) -> None:
        """Has the listener's worker call back."""
        with self._lock:  # keeps the listener from moving to another worker meanwhile
            listener.worker.add(listener)

    def separate_slow(self, worker: _CallbackWorker) -> None:
        """Leaves the worker to the callback that it is running, and moves its other listeners to a new worker."""
        with self._lock:
            slow = worker.current
            if slow is None or worker.listeners <= {slow}:
                return
            new = _CallbackWorker()
            if worker is self._shared:
                self._shared = new
            new.listeners = worker.listeners - {slow}
            worker.listeners &= {slow}
            for listener in new.listeners:
                listener.worker = new
            for waiting in worker.take_all():
                new.add(waiting)
            if not worker.listeners:  # the slow listener was closed, or has moved to another worker
                worker.end()

    def remove(self, listener: Listener) -> None:
        """Forgets a listener that was closed, and ends its worker if no other listener uses it."""
        with self._lock:
            worker = listener.worker
            worker.listeners.discard(listener)
            if not worker.listeners:
                worker.end()
                if worker is self._shared:
                    self._shared = None


class Listener:
    """One callback, the newest sample for it, and how many samples were missed before that one.

    Only one thread at a time may call `put` or `offer`.
    """

    def __init__(self, callback: Callable[[Telemetry], None], worker: _CallbackWorker, group: Callbacks) -> None:
        self.worker = worker
        self._callback = callback
        self._group = group
        self._lock = threading.Lock()
        self._newest: Telemetry | None = None
        self._missed_count = 0
        self._is_busy = False
        """Whether it waits in a worker's queue or is being called. This keeps it from being in two threads."""
        self._called_by: int | None = None
        self._quick_calls_needed = 0
        """Quick calls in a row that it needs to count as quick."""
        self._logged_failure = ""
        self._failures_count = 0
        self._is_closed = False
        self._has_returned = threading.Event()

    def put(self, sample: Telemetry) -> None:
        """Takes a new sample and has a worker call back with it."""
        if self.worker.is_delayed():
            self._group.separate_slow(self.worker)
        with self._lock:
            self._on_sample(sample)
            is_new, self._is_busy = not self._is_busy, True
        if is_new:
            self._group.schedule(self)

    def offer(self, sample: Telemetry) -> None:
        """Takes a new sample, for a thread that then calls `call`. A worker calls back instead if the callback was slow
        lately, or if a worker has it already.
        """
        if self._quick_calls_needed or self._is_busy:
            self.put(sample)
            return
        with self._lock:
            self._on_sample(sample)

    def call(self) -> None:
        """Calls back with the newest sample, unless that is done already or another thread is about to do it."""
        with self._lock:
            if self._is_busy or self._newest is None:
                return
            self._is_busy = True
        self.run()

    def run(self) -> None:
        """Calls back. Only for the thread that has set `_is_busy`, and for workers."""
        with self._lock:
            sample, self._newest = self._newest, None
            missed_count, self._missed_count = self._missed_count, 0
            if sample is None or self._is_closed:
                self._is_busy = False
                return
            self._called_by = thread_id = threading.get_ident()
        self._group.calling_thread_ids.add(thread_id)
        begin_s = time.monotonic()
        try:
            self._callback(replace(sample, missed_count=sample.missed_count + missed_count) if missed_count else sample)
        except BaseException as error:  # noqa: BLE001 (even a SystemExit must not end a thread that others use)
            self._log_failure(error)
        self._group.calling_thread_ids.discard(thread_id)
        if time.monotonic() - begin_s > SLOW_CALL_S:
            self._quick_calls_needed = _QUICK_CALLS_COUNT
        elif self._quick_calls_needed:
            self._quick_calls_needed -= 1
        with self._lock:
            self._called_by = None
            if self._is_closed:
                self._has_returned.set()
            has_more = self._is_busy = self._newest is not None and not self._is_closed
        if has_more:
            self._group.schedule(self)

    def _log_failure(self, error: BaseException) -> None:
        """Logs a failure of the callback once: at 50 Hz the same one would fill the log."""
        self._failures_count += 1
        text = repr(error)
        if text != self._logged_failure:
            self._logged_failure = text
            _log.exception("the callback of a telemetry subscription failed; the subscription goes on")

    def _on_sample(self, sample: Telemetry) -> None:
        if self._newest is not None:
            self._missed_count += self._newest.missed_count + 1
        self._newest = sample

    def close(self) -> None:
        """Ends it. Waits for the callback to return, unless it is called from a callback of the same group; after that
        the callback does not run again.
        """
        with self._lock:
            self._is_closed = True
            is_called = self._called_by is not None
        # Two callbacks that close each other, or that both close the client, would wait for each other forever.
        if is_called and threading.get_ident() not in self._group.calling_thread_ids:
            self._has_returned.wait()
        self._group.remove(self)
        if self._failures_count > 1:
            _log.warning("the callback of a telemetry subscription failed %d times", self._failures_count)


class _CallbackWorker:
    """A thread that runs callbacks, one after the other. The group's lock guards `listeners`."""

    def __init__(self) -> None:
        self.listeners: set[Listener] = set()
        self.current: Listener | None = None
        self._busy_since_s: float | None = None
        self._waiting: SimpleQueue[Listener | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="ual telemetry callback", daemon=True)
        self._thread.start()

    def add(self, listener: Listener) -> None:
        """Queues a listener that has a sample."""
        self._waiting.put(listener)

    def is_delayed(self) -> bool:
        """Returns whether it has been busy, without a pause, for longer than `SLOW_CALL_S`."""
        since_s = self._busy_since_s
        return since_s is not None and time.monotonic() - since_s > SLOW_CALL_S

    def take_all(self) -> list[Listener]:
        """Empties the queue and returns the listeners that were in it."""
        found = []
        with suppress(Empty):
            while (listener := self._waiting.get_nowait()) is not None:
                found.append(listener)
        return found

    def end(self) -> None:
        """Ends the thread once the callback that it is running returns."""
        self._waiting.put(None)

    def _run(self) -> None:
        while (listener := self._waiting.get()) is not None:
            if self._busy_since_s is None:
                self._busy_since_s = time.monotonic()
            self.current = listener
            listener.run()
            self.current = None
            if self._waiting.empty():
                self._busy_since_s = None
