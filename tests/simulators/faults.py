"""Bad links: they lose, delay, duplicate, reorder or damage what is sent, or carry nothing. Seeded."""

from __future__ import annotations

import heapq
import itertools
import math
import random
from collections.abc import Iterator
from dataclasses import dataclass

from tests.simulators.ports import Port


@dataclass(frozen=True, slots=True)
class Faults:
    """The faults of one direction of a link. `loss`, `duplication` and `corruption` are probabilities (0 to 1).

    A datagram takes `delay_s`, and up to `jitter_s` more, so that a later one can overtake it; bytes of a stream never
    overtake each other. With `is_silent` nothing passes. A radio carries `rate_bytes_s`, and drops what its
    buffer does not hold. With `cut_bytes` it carries a stream of bytes, and makes datagrams of so many of them.
    """

    loss: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    duplication: float = 0.0
    corruption: float = 0.0
    is_silent: bool = False
    rate_bytes_s: float = math.inf
    cut_bytes: int = 0


GOOD = Faults()
BUFFER_BYTES = 500
"""Of a radio."""


class Variant:
    """One direction."""

    def __init__(self, noise: random.Random, *, keeps_order: bool) -> None:
        self._noise = noise
        self._keeps_order = keeps_order
        self._newest_s = 0.0
        self._count = itertools.count()
        self._queue: list[tuple[float, int, bytes]] = []
        self._free_s = 0.0
        self._uncut = b""

    @property
    def is_empty(self) -> bool:
        """Whether nothing is in transit."""
        return not self._queue

    def put(self, data: bytes, now_s: float, faults: Faults) -> None:
        if not faults.cut_bytes:
            self._put(data, now_s, faults)
            return
        self._uncut += data
        while len(self._uncut) >= faults.cut_bytes:
            self._put(self._uncut[: faults.cut_bytes], now_s, faults)
            self._uncut = self._uncut[faults.cut_bytes :]

    def _put(self, data: bytes, now_s: float, faults: Faults) -> None:
        noise = self._noise
        if faults.is_silent or noise.random() < faults.loss:
            return
        if noise.random() < faults.corruption:
            damaged = bytearray(data)
            damaged[noise.randrange(len(data))] ^= noise.randrange(1, 256)
            data = bytes(damaged)
        if faults.rate_bytes_s < math.inf:
            begin_s = max(now_s, self._free_s)
            if noise.random() * BUFFER_BYTES < (begin_s - now_s) * faults.rate_bytes_s:  # the fuller, the more is lost
                return
            now_s = self._free_s = begin_s + len(data) / faults.rate_bytes_s
        for _ in range(2 if noise.random() < faults.duplication else 1):
            time_s = now_s + faults.delay_s + noise.uniform(0.0, faults.jitter_s)
            if self._keeps_order:
                time_s = self._newest_s = max(time_s, self._newest_s)
            heapq.heappush(self._queue, (time_s, next(self._count), data))

    def take(self, now_s: float) -> Iterator[bytes]:
        while self._queue and self._queue[0][0] <= now_s:
            yield heapq.heappop(self._queue)[2]


class BadLink(Port):
    """A link with faults in both directions. The faults may be changed at any time."""

    def __init__(self, port: Port, seed: int, down: Faults = GOOD, up: Faults = GOOD) -> None:
        self.down = down
        """From the autopilot."""
        self.up = up
        """To the autopilot."""
        self._port = port
        self._down = Variant(random.Random(seed), keeps_order=port.is_stream)
        self._up = Variant(random.Random(seed + 1), keeps_order=port.is_stream)
        self.is_stream = port.is_stream

    def receive(self, now_s: float) -> list[bytes]:
        for data in self._port.receive(now_s):
            self._up.put(data, now_s, self.up)
        for data in self._down.take(now_s):
            self._port.send(data, now_s)
        if self._port.sessions_count != self.sessions_count:
            self.sessions_count = self._port.sessions_count
        return list(self._up.take(now_s))

    def send(self, data: bytes, now_s: float) -> None:
        self._down.put(data, now_s, self.down)

    def descriptors(self) -> list[int]:
        return self._port.descriptors()

    def restart(self) -> None:
        self._port.restart()

    def close(self) -> None:
        self._port.close()
