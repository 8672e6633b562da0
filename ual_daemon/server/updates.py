"""The vehicle's updates, brought from its thread to the event loop and handed to whoever reads there.

One hop for each update, and only while it matters to somebody; updates that come faster than the loop runs become
one. A reader that is slow finds the newest sample and the number of those it lost; it holds up nobody.
"""

from __future__ import annotations

import asyncio
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
        return pb.StreamTelemetryResponse(telemetry=convert.telemetry_to_proto(self.telemetry))


class Reader:
    """Holds the newest sample for one reader until it is read, at most `rate_hz` of them (0: each)."""

    def __init__(self, rate_hz: float, first: Sample) -> None:
        self._period_s = 1.0 / rate_hz if rate_hz > 0.0 else 0.0
        self._loop = asyncio.get_running_loop()
        self._due_s = self._loop.time() + self._period_s
        self._newest: Sample | None = first
        self._sequence = first.telemetry.sequence
        self._missed_count = 0
        self._filled = asyncio.Event()
        self._filled.set()

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
        self._filled.set()

    async def read(self) -> tuple[Sample, int]:
        """The newest sample, once there is one that was not read, and how many were lost since the one before."""
        await self._filled.wait()
        self._filled.clear()
        assert self._newest is not None
        sample, self._newest = self._newest, None
        missed_count, self._missed_count = self._missed_count, 0
        return sample, missed_count


class Updates:
    """The updates of one vehicle, on the loop that runs when this is made. `on_state` is called there, too."""

    def __init__(self, vehicle: Vehicle, on_state: Callable[[State], None]) -> None:
        self._vehicle = vehicle
        self._on_state = on_state
        self._loop = asyncio.get_running_loop()
        self._readers: set[Reader] = set()
        self._state = State.UNINITIALIZED
        # Written by the vehicle's thread, read by the loop: single references, so that no lock is needed.
        self._newest: Telemetry | None = None
        self._is_hop_under_way = False
        self._unsubscribe = vehicle.subscribe(self._on_update)

    def close(self) -> None:
        """Ends the updates; readers get no more."""
        self._unsubscribe()

    @contextmanager
    def reader(self, rate_hz: float = 0.0) -> Iterator[Reader]:
        """A reader, whose first sample is there at once."""
        reader = Reader(rate_hz, Sample(self._vehicle.telemetry()))
        self._readers.add(reader)
        try:
            yield reader
        finally:
            self._readers.discard(reader)

    def _on_update(self, telemetry: Telemetry) -> None:
        if not self._readers and telemetry.state is self._state:
            return
        self._newest = telemetry
        if not self._is_hop_under_way:
            self._is_hop_under_way = True
            with suppress(RuntimeError):  # the loop is closed: nobody listens any more
                self._loop.call_soon_threadsafe(self._deliver)

    def _deliver(self) -> None:
        # First this: an update that comes from here on starts the next hop.
        self._is_hop_under_way = False
        telemetry = self._newest
        assert telemetry is not None
        if telemetry.state is not self._state:
            self._state = telemetry.state
            self._on_state(telemetry.state)
        sample = Sample(telemetry)
        for reader in self._readers:
            reader.offer(sample)
