"""Sends the vehicle's telemetry to its readers, and publishes its states on the event loop.

The vehicle's own thread sends to a few readers, as soon as it has made a sample. If there are more, if the process
flies many UAVs, or if the transport sends from the event loop anyway, that would take this thread too long. Then the
event loop sends, and updates that come faster than it runs are merged. A slow reader gets the newest sample and the
number of those that it missed; it delays nobody.
"""

from __future__ import annotations

import asyncio
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, TypeAlias

from ual.shared.waiting import ends_within
from ual.types import State, Telemetry
from ual.v1 import ual_pb2 as pb
from ual_daemon.server.packing import TelemetryPacker

if TYPE_CHECKING:
    from ual_daemon.choice import ServedVehicle

_OWN_THREAD_COUNT = 4
"""Most readers to which the vehicle's thread sends itself: 0.1 ms each."""

Send: TypeAlias = Callable[[bytes, Callable[[bool], None]], None]
"""Sends a message, and calls back with whether it went out. Only then may the next be sent. See `ServedCall.send`."""


class PackedTelemetry:
    """One sample. Its message is packed once for all readers, when the first needs it."""

    def __init__(self, telemetry: Telemetry, packer: TelemetryPacker) -> None:
        self.sequence = telemetry.sequence
        self._telemetry = telemetry
        self._packer = packer
        self._packed = b""

    def packed(self, missed_count: int = 0) -> bytes:
        """Returns a ``StreamTelemetryResponse`` for a reader that missed so many samples before this one."""
        packed = self._packed = self._packed or self._packer.response(self._telemetry)
        if not missed_count:
            return packed
        # Protobuf reads two concatenated messages as one with the fields of both.
        return packed + pb.StreamTelemetryResponse(missed_count=missed_count).SerializeToString()


class LoopCalls:
    """Calls back on the event loop that runs when this is made, for other threads and in their order.

    With `gather_s` callbacks wait that long, and run together. A thread that wakes the loop releases Python's lock, and
    may have to wait long to get it back. A process that flies many UAVs can afford that once in a step, but not for
    each UAV.
    """

    def __init__(self, gather_s: float = 0.0) -> None:
        self._loop = asyncio.get_running_loop()
        self._gather_s = gather_s
        self._waiting: deque[Callable[[], None]] = deque()
        self._is_scheduled = False

    @property
    def gathers(self) -> bool:
        """Whether callbacks wait for each other."""
        return self._gather_s > 0.0

    def call(self, callback: Callable[[], None]) -> None:
        """Calls back on the loop, soon. Does nothing if that is closed."""
        self._waiting.append(callback)
        if not self._is_scheduled:
            self._is_scheduled = True
            with suppress(RuntimeError):  # the loop is closed: nobody reads any more
                self._loop.call_soon_threadsafe(self._begin)

    def _begin(self) -> None:
        if self._gather_s:
            self._loop.call_later(self._gather_s, self._run)
        else:
            self._run()

    def _run(self) -> None:
        # First this: a callback that is added from here on is scheduled again.
        self._is_scheduled = False
        while self._waiting:
            self._waiting.popleft()()


class TelemetryReader:
    """Sends one reader the newest sample, when the one before it is out, at most at `rate_hz` (0: every sample)."""

    def __init__(
        self, rate_hz: float, first: PackedTelemetry, send: Send, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._period_s = 1.0 / rate_hz if rate_hz > 0.0 else 0.0
        self._send = send
        self._clock = clock
        self._lock = threading.Lock()
        self._due_s = clock() + self._period_s
        self._newest: PackedTelemetry | None = None
        self._sequence = first.sequence
        self._missed_count = 0
        self.missed_count = 0
        """Announced samples that the reader has missed."""
        self._is_sending = True
        send(first.packed(), self._on_sent)

    @property
    def due_s(self) -> float:
        """Time at which the reader takes the next sample, by its clock, in s."""
        return self._due_s

    def offer(self, sample: PackedTelemetry) -> None:
        """Sends the sample, or keeps it to be sent next, unless the rate skips it."""
        now_s = self._clock()
        with self._lock:
            sequence = sample.sequence
            if now_s < self._due_s or sequence <= self._sequence:
                return
            if self._period_s:
                self._missed_count += self._newest is not None
            else:  # each sample was due: those that were never offered count, too
                self._missed_count += sequence - self._sequence - (self._newest is None)
            # From when it was due, not from now: else each sample would be late by up to one update.
            self._due_s = max(self._due_s + self._period_s, now_s)
            self._sequence = sequence
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
        self.missed_count += missed_count
        return sample.packed(missed_count)


class Updates:
    """The updates of one vehicle. Belongs to the event loop that runs when this is made, where `on_state` is called.

    Vehicles of one process share their `loop_calls`. With `is_sent_on_loop` only the event loop sends.
    """

    def __init__(
        self,
        vehicle: ServedVehicle,
        on_state: Callable[[State], None],
        loop_calls: LoopCalls | None = None,
        clock: Callable[[], float] = time.monotonic,
        *,
        is_sent_on_loop: bool = False,
    ) -> None:
        self._vehicle = vehicle
        self._loop_calls = loop_calls or LoopCalls()
        self._on_state = on_state
        self._clock = clock
        self._loop = asyncio.get_running_loop()
        self._lock = threading.Lock()
        self._packer = TelemetryPacker()
        self._readers: tuple[TelemetryReader, ...] = ()
        self._missed_before = 0
        """By readers that have ended."""
        self._state = State.UNINITIALIZED
        self._changed = asyncio.Event()
        self._own_thread_count = 0 if is_sent_on_loop or self._loop_calls.gathers else _OWN_THREAD_COUNT
        # Single references, replaced as a whole: read without the lock.
        self._due_s = math.inf
        self._newest: Telemetry | None = None
        self._is_delivery_scheduled = False
        self._end_state = vehicle.listen_to_state(self._on_change)
        self._loop.call_soon(self._publish_state)  # it may be open already
        self._unsubscribe = vehicle.subscribe(self._on_update, self._is_due)

    def close(self) -> None:
        """Ends the updates. Readers get no more samples."""
        self._end_state()
        self._unsubscribe()

    @property
    def state(self) -> State:
        """The state that was published last."""
        return self._state

    @property
    def missed_count(self) -> int:
        """Samples that slow readers have missed since the start."""
        with self._lock:
            return self._missed_before + sum(reader.missed_count for reader in self._readers)

    async def change(self, timeout_s: float | None = None) -> None:
        """Waits until a state is published, at most for so long."""
        await ends_within(self._changed.wait(), timeout_s)

    def read(self, rate_hz: float, send: Send) -> Callable[[], None]:
        """Sends samples to a reader from now on, the first at once; see `TelemetryReader`. Returns a function that ends
        it.
        """
        first = PackedTelemetry(self._vehicle.telemetry(), self._packer)
        reader = TelemetryReader(rate_hz, first, send, self._clock)
        with self._lock:
            self._readers = (*self._readers, reader)
            self._plan()

        def end() -> None:
            with self._lock:
                if reader in self._readers:
                    self._missed_before += reader.missed_count
                self._readers = tuple(other for other in self._readers if other is not reader)
                self._plan()

        return end

    def _plan(self) -> None:
        self._due_s = min((reader.due_s for reader in self._readers), default=math.inf)

    def _is_due(self) -> bool:
        return self._clock() >= self._due_s

    def _on_change(self, state: State) -> None:
        self._loop_calls.call(self._publish_state)

    def _publish_state(self) -> None:
        self._state = self._vehicle.state()
        self._on_state(self._state)
        # An event for each change, as one event would have to be cleared while some have not seen it.
        self._changed.set()
        self._changed = asyncio.Event()

    def _on_update(self, telemetry: Telemetry) -> None:
        self._newest = telemetry
        if len(self._readers) <= self._own_thread_count:
            self._deliver()
        elif not self._is_delivery_scheduled:
            self._is_delivery_scheduled = True
            self._loop_calls.call(self._deliver)

    def _deliver(self) -> None:
        # First this: an update that comes from here on is delivered by the next call.
        self._is_delivery_scheduled = False
        telemetry = self._newest
        assert telemetry is not None
        sample = PackedTelemetry(telemetry, self._packer)
        for reader in self._readers:
            reader.offer(sample)
        with self._lock:
            self._plan()
