"""The vehicle's updates, brought from its thread to the event loop and handed to whoever reads there.

One hop for each update that is due for somebody; updates that come faster than the loop runs become one. A reader that
is slow finds the newest sample and the number of those it lost; it holds up nobody.
"""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cached_property

from ual import convert
from ual.types import State, Telemetry
from ual.v1 import ual_pb2 as pb
from ual_daemon.vehicle import Vehicle


class Sample:
    """One sample; its message is made once for all readers."""

    def __init__(self, telemetry: Telemetry) -> None:
        self.telemetry = telemetry

    @cached_property
    def message(self) -> pb.StreamTelemetryResponse:
        """The message for a reader that lost nothing."""
        message = pb.StreamTelemetryResponse()
        convert.write_telemetry(self.telemetry, message.telemetry)
        return message


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
    """Holds the newest sample for one reader until it is read, at most `rate_hz` of them (0: each)."""

    def __init__(self, rate_hz: float, first: Sample) -> None:
        self._period_s = 1.0 / rate_hz if rate_hz > 0.0 else 0.0
        self._loop = asyncio.get_running_loop()
        self._due_s = self._loop.time() + self._period_s
        self._newest: Sample | None = first
        self._sequence = first.telemetry.sequence
        self._missed_count = 0
        self._waiting: asyncio.Future[None] | None = None

    @property
    def due_s(self) -> float:
        """When it takes the next sample, by the loop's time."""
        return self._due_s

    def offer(self, sample: Sample) -> None:
        """Takes the sample, unless the rate leaves it out."""
        now_s = self._loop.time()
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
        if self._waiting is not None and not self._waiting.done():
            self._waiting.set_result(None)

    async def read(self) -> tuple[Sample, int]:
        """The newest sample, once there is one that was not read, and how many were lost since the one before."""
        if self._newest is None:
            self._waiting = self._loop.create_future()
            await self._waiting
        assert self._newest is not None
        sample, self._newest = self._newest, None
        missed_count, self._missed_count = self._missed_count, 0
        return sample, missed_count


class Updates:
    """The updates of one vehicle, on the loop that runs when this is made. `on_state` is called there, too.

    Vehicles of one process share their `hops`.
    """

    def __init__(self, vehicle: Vehicle, on_state: Callable[[State], None], hops: Hops | None = None) -> None:
        self._vehicle = vehicle
        self._hops = hops or Hops()
        self._on_state = on_state
        self._loop = asyncio.get_running_loop()
        self._readers: set[Reader] = set()
        self._state = State.UNINITIALIZED
        self._changed = asyncio.Event()
        # Written by one thread, the vehicle's or the loop's, and read by the other: single references, so that no lock
        # is needed.
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

    @contextmanager
    def reader(self, rate_hz: float = 0.0) -> Iterator[Reader]:
        """A reader, whose first sample is there at once."""
        reader = Reader(rate_hz, Sample(self._vehicle.telemetry()))
        self._readers.add(reader)
        self._plan()
        try:
            yield reader
        finally:
            self._readers.discard(reader)
            self._plan()

    def _plan(self) -> None:
        self._due_s = min((reader.due_s for reader in self._readers), default=math.inf)

    def _is_due(self) -> bool:
        return self._loop.time() >= self._due_s

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
        if not self._is_hop_under_way:
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
        self._plan()
