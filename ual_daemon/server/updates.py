"""The vehicle's updates, sent to whoever reads them, and its states, told on the event loop.

A few readers get a sample from the vehicle's own thread, as soon as it is made. Where there are more, or a process
flies many UAVs, sending would take that thread too long: the event loop does it then, and updates that come faster than
it runs become one. A reader that is slow gets the newest sample and the number of those it lost; it holds up nobody.
"""

from __future__ import annotations

import asyncio
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from typing import TypeAlias

from ual import _convert
from ual.types import State, Telemetry
from ual.v1 import ual_pb2 as pb
from ual_daemon.vehicle.vehicle import Vehicle

_OWN_THREAD_COUNT = 4
"""To so many readers the vehicle's thread sends by itself: 0.1 ms each."""

Send: TypeAlias = Callable[[bytes, Callable[[bool], None]], None]
"""Sends a message, and tells when it is out (or that it never will be); only then may the next be sent."""


class Sample:
    """One sample; its message is made, and packed, once for all readers."""

    def __init__(self, telemetry: Telemetry) -> None:
        self.telemetry = telemetry

    @cached_property
    def packed(self) -> bytes:
        """A ``StreamTelemetryResponse`` for a reader that lost nothing."""
        message = pb.StreamTelemetryResponse()
        _convert.write_telemetry(self.telemetry, message.telemetry)
        return message.SerializeToString()

    def packed_after(self, missed_count: int) -> bytes:
        """The same for a reader that lost so many before."""
        if not missed_count:
            return self.packed
        # Two messages of which one follows the other are read as one with the fields of both.
        return self.packed + pb.StreamTelemetryResponse(missed_count=missed_count).SerializeToString()


class Hops:
    """Brings calls from other threads to the event loop that runs when this is made, in their order.

    With `gather_s` calls that come so soon after each other go over together. A thread that wakes the loop lets go of
    Python's lock, and may have to wait long to get it back: what flies many UAVs can afford that once in a step, but
    not for each of them.
    """

    def __init__(self, gather_s: float = 0.0) -> None:
        self._loop = asyncio.get_running_loop()
        self._gather_s = gather_s
        self._waiting: deque[Callable[[], None]] = deque()
        self._is_under_way = False

    @property
    def gathers(self) -> bool:
        """Whether calls go over together."""
        return self._gather_s > 0.0

    def call(self, callback: Callable[[], None]) -> None:
        """Calls it on the loop, soon; not at all once that is closed."""
        self._waiting.append(callback)
        if not self._is_under_way:
            self._is_under_way = True
            with suppress(RuntimeError):  # the loop is closed: nobody listens any more
                self._loop.call_soon_threadsafe(self._begin)

    def _begin(self) -> None:
        if self._gather_s:
            self._loop.call_later(self._gather_s, self._run)
        else:
            self._run()

    def _run(self) -> None:
        # First this: what comes from here on starts the next hop.
        self._is_under_way = False
        while self._waiting:
            self._waiting.popleft()()


class Reader:
    """Sends the newest sample to one reader when the one before it is out, at most `rate_hz` of them (0: each)."""

    def __init__(self, rate_hz: float, first: Sample, send: Send, clock: Callable[[], float] = time.monotonic) -> None:
        self._period_s = 1.0 / rate_hz if rate_hz > 0.0 else 0.0
        self._send = send
        self._clock = clock
        self._lock = threading.Lock()
        self._due_s = clock() + self._period_s
        self._newest: Sample | None = None
        self._sequence = first.telemetry.sequence
        self._missed_count = 0
        self._is_sending = True
        send(first.packed, self._on_sent)

    @property
    def due_s(self) -> float:
        """When it takes the next sample, by its clock."""
        return self._due_s

    def offer(self, sample: Sample) -> None:
        """Takes the sample, unless the rate leaves it out."""
        now_s = self._clock()
        with self._lock:
            if now_s < self._due_s or sample.telemetry.sequence <= self._sequence:
                return
            if self._period_s:
                self._missed_count += self._newest is not None
            else:  # each sample was due: count those, too, that never came here
                self._missed_count += sample.telemetry.sequence - self._sequence - (self._newest is None)
            # From when it was due, not from now: else every sample would be late by up to an update.
            self._due_s = max(self._due_s + self._period_s, now_s)
            self._sequence = sample.telemetry.sequence
            self._newest = sample
            if self._is_sending:
                return
            self._is_sending = True
            message = self._take()
        self._send(message, self._on_sent)

    def _on_sent(self, is_out: bool) -> None:
        with self._lock:
            if self._newest is None or not is_out:
                self._is_sending = False
                return
            message = self._take()
        self._send(message, self._on_sent)

    def _take(self) -> bytes:
        assert self._newest is not None
        sample, self._newest = self._newest, None
        missed_count, self._missed_count = self._missed_count, 0
        return sample.packed_after(missed_count)


class Updates:
    """The updates of one vehicle. Belongs to the loop that runs when this is made, where `on_state` is called.

    Vehicles of one process share their `hops`.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        on_state: Callable[[State], None],
        hops: Hops | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._vehicle = vehicle
        self._hops = hops or Hops()
        self._on_state = on_state
        self._clock = clock
        self._loop = asyncio.get_running_loop()
        self._lock = threading.Lock()
        self._readers: tuple[Reader, ...] = ()
        self._state = State.UNINITIALIZED
        self._changed = asyncio.Event()
        self._own_thread_count = 0 if self._hops.gathers else _OWN_THREAD_COUNT
        # Single references, replaced as a whole: read without the lock.
        self._due_s = math.inf
        self._newest: Telemetry | None = None
        self._is_hop_under_way = False
        self._end_state = vehicle.listen_to_state(self._on_change)
        self._loop.call_soon(self._tell_state)  # it may be open already
        self._unsubscribe = vehicle.subscribe(self._on_update, self._is_due)

    def close(self) -> None:
        """Ends the updates; readers get no more."""
        self._end_state()
        self._unsubscribe()

    @property
    def state(self) -> State:
        """The state as it was told last."""
        return self._state

    async def change(self, timeout_s: float | None = None) -> None:
        """Waits until a state is told, or for so long."""
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._changed.wait(), timeout_s)

    def read(self, rate_hz: float, send: Send) -> Callable[[], None]:
        """Sends samples to a reader from now on, the first at once; see `Reader`. Returns what ends it."""
        reader = Reader(rate_hz, Sample(self._vehicle.telemetry()), send, self._clock)
        with self._lock:
            self._readers = (*self._readers, reader)
            self._plan()

        def end() -> None:
            with self._lock:
                self._readers = tuple(other for other in self._readers if other is not reader)
                self._plan()

        return end

    def _plan(self) -> None:
        self._due_s = min((reader.due_s for reader in self._readers), default=math.inf)

    def _is_due(self) -> bool:
        return self._clock() >= self._due_s

    def _on_change(self, state: State) -> None:
        self._hops.call(self._tell_state)

    def _tell_state(self) -> None:
        self._state = self._vehicle.state()
        self._on_state(self._state)
        # An event for each change, as one event would have to be cleared while some have not seen it.
        self._changed.set()
        self._changed = asyncio.Event()

    def _on_update(self, telemetry: Telemetry) -> None:
        self._newest = telemetry
        if len(self._readers) <= self._own_thread_count:
            self._deliver()
        elif not self._is_hop_under_way:
            self._is_hop_under_way = True
            self._hops.call(self._deliver)

    def _deliver(self) -> None:
        # First this: an update that comes from here on starts the next hop.
        self._is_hop_under_way = False
        telemetry = self._newest
        assert telemetry is not None
        sample = Sample(telemetry)
        for reader in self._readers:
            reader.offer(sample)
        with self._lock:
            self._plan()
