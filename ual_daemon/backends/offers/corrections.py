"""Interface of a backend's corrections of satellites (RTK); see `ual_daemon.services.corrections`."""

from __future__ import annotations

import logging
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from ual.errors import ResourceExhaustedError
from ual_daemon import logs

_log = logging.getLogger(__name__)

MOST_WAITING_BYTES = 8192
"""Most bytes that wait; beyond that the oldest are dropped: 8 s of a usual base station. Older corrections help
nobody.
"""
HOLDER_SILENCE_S = 10.0
"""Seconds of silence after which a sender loses its turn once another one requests it."""


class Injected(NamedTuple):
    """Counts of the messages since the backend was made, and the time at which the last one left (its own clock)."""

    messages_count: int = 0
    bytes_count: int = 0
    dropped_count: int = 0
    too_long_count: int = 0
    left_s: float | None = None


class AutopilotCorrections(ABC):
    """Passes corrections on to the receiver of one autopilot. From any thread; no method waits."""

    def __init__(self) -> None:
        self.turn = SenderTurn()

    @abstractmethod
    def inject(self, message: bytes) -> None:
        """Sends one whole message of RTCM 3, which has been checked, as soon as setpoints leave room for it."""

    @abstractmethod
    def injected(self) -> Injected:
        """Returns what has become of those so far."""

    @abstractmethod
    def now_s(self) -> float:
        """Returns the time, by the clock of `Injected.left_s`."""


class WaitingCorrections:
    """Whole messages that wait to leave, the oldest first. Belongs to one thread; `counts` is for any.

    `longest_bytes` is what the way to the receiver can carry.
    """

    def __init__(self, longest_bytes: int, most_bytes: int = MOST_WAITING_BYTES) -> None:
        self.counts = Injected()
        self._longest_bytes = longest_bytes
        self._most_bytes = most_bytes
        self._waiting: deque[bytes] = deque()
        self._bytes_count = 0

    @property
    def bytes_count(self) -> int:
        """Bytes that wait."""
        return self._bytes_count

    def add(self, message: bytes) -> None:
        """Adds a message. Drops the oldest where there is no room."""
        if len(message) > self._longest_bytes:
            self._on_too_long(len(message))
            return
        self._waiting.append(message)
        self._bytes_count += len(message)
        while self._bytes_count > self._most_bytes:
            self._bytes_count -= len(self._waiting.popleft())
            self._on_dropped(1, "the link does not carry them")

    def take(self) -> bytes | None:
        """Takes the oldest; None where nothing waits. `on_left` has to follow, or `on_lost`."""
        if not self._waiting:
            return None
        message = self._waiting.popleft()
        self._bytes_count -= len(message)
        return message

    def on_left(self, message: bytes, now_s: float) -> None:
        """Counts a message that has left whole."""
        counts = self.counts
        self.counts = counts._replace(
            messages_count=counts.messages_count + 1, bytes_count=counts.bytes_count + len(message), left_s=now_s
        )

    def on_lost(self, why: str) -> None:
        """Counts a message that was taken, but has not left whole."""
        self._on_dropped(1, why)

    def drop(self, why: str) -> None:
        """Drops all that wait."""
        if self._waiting:
            count = len(self._waiting)
            self._waiting.clear()
            self._bytes_count = 0
            self._on_dropped(count, why)

    def _on_too_long(self, bytes_count: int) -> None:
        before = self.counts.too_long_count
        self.counts = self.counts._replace(too_long_count=before + 1)
        if _is_reported(before, before + 1):
            longest = self._longest_bytes
            logs.event(_log, logging.WARNING, "corrections_too_long", bytes=bytes_count, longest_bytes=longest)

    def _on_dropped(self, count: int, why: str) -> None:
        before = self.counts.dropped_count
        self.counts = self.counts._replace(dropped_count=before + count)
        if _is_reported(before, before + count):
            logs.event(_log, logging.WARNING, "corrections_dropped", why=why, count=before + count)


def _is_reported(before: int, after: int) -> bool:
    """Returns whether the first, the second, the fourth, and so on, is among those: a slow link must not fill the
    log.
    """
    return after.bit_length() > before.bit_length()


class SenderTurn:
    """Turn to send: one sender at a time, as two base stations must not be mixed. From any thread."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.skipped_bytes_count = 0
        """Bytes of all senders so far that belonged to no whole message. Counted by the sender whose turn it is."""
        self._clock = clock
        self._lock = threading.Lock()
        self._holder: object = None
        self._name = ""
        self._heard_s = 0.0

    @property
    def name(self) -> str:
        """The name of what sends now; empty where nothing does."""
        with self._lock:
            return self._name if self._is_held() else ""

    def keep(self, holder: object, name: str) -> None:
        """Takes the turn, or keeps it.

        Raises:
            ResourceExhaustedError: It is another one's.

        """
        with self._lock:
            if self._holder is not holder and self._is_held():
                text = f"corrections: {self._name} sends them already, and one program sends at a time"
                raise ResourceExhaustedError(text, {"limit": "1", "held_by": self._name})
            self._holder, self._name, self._heard_s = holder, name, self._clock()

    def leave(self, holder: object) -> None:
        """Gives it up, if it is this one's."""
        with self._lock:
            if self._holder is holder:
                self._holder, self._name = None, ""

    def _is_held(self) -> bool:
        return self._holder is not None and self._clock() - self._heard_s < HOLDER_SILENCE_S
