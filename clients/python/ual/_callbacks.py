"""Calls back with the newest sample, on threads that subscriptions share as long as none of them holds up the others.

A thread for each subscription would have to be woken for each sample: with a hundred of them that takes milliseconds.
One for all would be at the mercy of the slowest. So they begin on one thread, a *lane*; when a sample comes and finds
the lane busy for longer than `PATIENCE_S`, the callback that it is in keeps it, and the others go on on a new one.

Whoever has a sample and may wait calls back himself (`Listener.offer`, then `Listener.call`), which spares waking a
lane. That is for quick callbacks: those that took longer than `PATIENCE_S` lately have a lane all the same.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from queue import Empty, SimpleQueue

from ual.types import Telemetry

_log = logging.getLogger(__name__)

PATIENCE_S = 0.005
_QUICK_AGAIN_COUNT = 10
"""After so many quick calls in a row a callback that was slow counts as quick again."""


class Callbacks:
    """The callbacks of one program's subscriptions. May be used from any thread."""

    def __init__(self) -> None:
        self.calling: set[int] = set()
        """The threads that call back now."""
        self._lock = threading.Lock()
        self._shared: _Lane | None = None

    def open(self, callback: Callable[[Telemetry], None]) -> Listener:
        """Calls back with what is put into the listener."""
        with self._lock:
            lane = self._shared = self._shared or _Lane()
            listener = Listener(callback, lane, self)
            lane.listeners.add(listener)
        return listener

    # --- For the listeners --------------------------------------------------------------------------------------------

    def queue(self, listener: Listener) -> None:
        """It has something to be called back with."""
        with self._lock:  # so that nobody moves it to another lane meanwhile
            listener.lane.add(listener)

    def relieve(self, lane: _Lane) -> None:
        """Gives a new lane to all who wait for the callback that a lane is in."""
        with self._lock:
            slow = lane.current
            if slow is None or lane.listeners <= {slow}:
                return
            relief = _Lane()
            if lane is self._shared:
                self._shared = relief
            relief.listeners = lane.listeners - {slow}
            lane.listeners &= {slow}
            for listener in relief.listeners:
                listener.lane = relief
            for waiting in lane.take_all():
                relief.add(waiting)
            if not lane.listeners:  # what it is in ends, or goes on elsewhere
                lane.end()

    def leave(self, listener: Listener) -> None:
        """It has ended."""
        with self._lock:
            lane = listener.lane
            lane.listeners.discard(listener)
            if not lane.listeners:
                lane.end()
                if lane is self._shared:
                    self._shared = None


class Listener:
    """One callback, the newest sample for it, and how many were lost before. One thread puts or offers at a time."""

    def __init__(self, callback: Callable[[Telemetry], None], lane: _Lane, group: Callbacks) -> None:
        self.lane = lane
        self._callback = callback
        self._group = group
        self._lock = threading.Lock()
        self._newest: Telemetry | None = None
        self._missed_count = 0
        self._is_busy = False
        """Whether it waits in a lane, or is called: it is never in two places."""
        self._called_by: int | None = None
        self._on_probation_count = 0
        """How many quick calls must come before it counts as quick."""
        self._is_closed = False
        self._has_returned = threading.Event()

    def put(self, sample: Telemetry) -> None:
        """Takes a new sample, and has a lane call back with it."""
        if self.lane.is_held_up():
            self._group.relieve(self.lane)
        with self._lock:
            self._take(sample)
            is_new, self._is_busy = not self._is_busy, True
        if is_new:
            self._group.queue(self)

    def offer(self, sample: Telemetry) -> None:
        """Takes a new sample, and waits for somebody to `call`; has a lane call back where that took long lately, or is
        in one already.
        """
        if self._on_probation_count or self._is_busy:
            self.put(sample)
            return
        with self._lock:
            self._take(sample)

    def call(self) -> None:
        """Calls back with the newest sample, unless that is done already, or somebody else is about to."""
        with self._lock:
            if self._is_busy or self._newest is None:
                return
            self._is_busy = True
        self.run()

    def run(self) -> None:
        """Calls back, for whoever has made it busy."""
        with self._lock:
            sample, self._newest = self._newest, None
            missed_count, self._missed_count = self._missed_count, 0
            if sample is None or self._is_closed:
                self._is_busy = False
                return
            self._called_by = thread_id = threading.get_ident()
        self._group.calling.add(thread_id)
        begin_s = time.monotonic()
        try:
            self._callback(replace(sample, missed_count=sample.missed_count + missed_count) if missed_count else sample)
        except BaseException:  # noqa: BLE001 (whatever it is, it is the callback's: SystemExit, too, ends no other's thread)
            _log.exception("the callback of a telemetry subscription failed; the subscription goes on")
        self._group.calling.discard(thread_id)
        if time.monotonic() - begin_s > PATIENCE_S:
            self._on_probation_count = _QUICK_AGAIN_COUNT
        elif self._on_probation_count:
            self._on_probation_count -= 1
        with self._lock:
            self._called_by = None
            if self._is_closed:
                self._has_returned.set()
            goes_on = self._is_busy = self._newest is not None and not self._is_closed
        if goes_on:
            self._group.queue(self)

    def _take(self, sample: Telemetry) -> None:
        if self._newest is not None:
            self._missed_count += self._newest.missed_count + 1
        self._newest = sample

    def close(self) -> None:
        """Ends it. Called from none of the group's callbacks: once it has returned, the callback runs no more."""
        with self._lock:
            self._is_closed = True
            is_called = self._called_by is not None
        # Two callbacks that close each other, or both the client, would wait for each other for ever.
        if is_called and threading.get_ident() not in self._group.calling:
            self._has_returned.wait()
        self._group.leave(self)


class _Lane:
    """A thread that calls back, one listener after the other. `listeners` belongs to the group, and its lock."""

    def __init__(self) -> None:
        self.listeners: set[Listener] = set()
        self.current: Listener | None = None
        self._busy_since_s: float | None = None
        self._waiting: SimpleQueue[Listener | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="ual telemetry callback", daemon=True)
        self._thread.start()

    def add(self, listener: Listener) -> None:
        """It has something to be called back with."""
        self._waiting.put(listener)

    def is_held_up(self) -> bool:
        """Whether it has not been idle for longer than anybody should have to wait."""
        since_s = self._busy_since_s
        return since_s is not None and time.monotonic() - since_s > PATIENCE_S

    def take_all(self) -> list[Listener]:
        """Those that wait, who then do not wait here any more."""
        found = []
        with suppress(Empty):
            while (listener := self._waiting.get_nowait()) is not None:
                found.append(listener)
        return found

    def end(self) -> None:
        """Ends the thread, once the call that it is in returns."""
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
