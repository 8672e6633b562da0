"""The newest values of one autopilot: each with its order, its age, and what makes it invalid.

A backend makes all of its readings from one `Readings`, so that none is forgotten when they are discarded.
"""

from __future__ import annotations

import math
import warnings
from enum import Enum
from typing import Generic, TypeVar

from ual_daemon.backends.values import Sample

T = TypeVar("T")

LONGEST_REORDERING_S = 3.0
"""Seconds for which a value that was sent earlier than the newest one is ignored; after that the order must be
wrong.
"""


def ahead_s(now_s: float) -> float:
    """Returns the time of what an autopilot reports by itself, ahead of the message with the rest that changed with it.

    It counts as later than what was received at the same moment. PX4's event of the arming comes before the mode that
    the arming has entered; a busy computer reads it together with the mode of before.
    """
    return math.nextafter(now_s, math.inf)


class Valid(Enum):
    """Until when a reading may be believed."""

    WHILE_HEARD = "while it is heard"
    """It may change unseen: a silence discards it, and so does a reboot."""
    UNTIL_REBOOT = "until the autopilot boots"
    """As a place in the local frame."""
    ALWAYS = "always"
    """A property of the vehicle."""
    # Names of `Lasts`, until 0.4.
    SEEN = WHILE_HEARD
    BOOT = UNTIL_REBOOT
    EVER = ALWAYS


class Reading(Generic[T]):
    """The newest value of one kind. Belongs to the thread that receives; any thread may read `sample` once."""

    __slots__ = ("_all", "_limit_s", "_order", "_received_s", "_unknown", "sample")

    def __init__(self, readings: Readings, limit_s: float, unknown: Sample[T] | None) -> None:
        self.sample: Sample[T] | None = unknown
        """The value and when it was received, as a snapshot takes it; None while it is not known."""
        self._all = readings
        self._limit_s = limit_s
        self._unknown = unknown
        self._order = self._received_s = -math.inf

    def is_next(self, now_s: float) -> bool:
        """Returns whether the present message was sent after the one before that had this value, of whatever kind;
        notes it.

        A late message is ignored. Otherwise a link that reorders messages would show the mode before for a moment, as
        if the safety pilot had taken the UAV.
        """
        order = self._all.order
        if order < self._order and now_s - self._received_s < LONGEST_REORDERING_S:
            return False
        self._order, self._received_s = order, now_s
        return True

    def set(self, value: T, time_s: float) -> None:
        """Takes a value that is to be believed, and when it was received."""
        self.sample = Sample(value, time_s)

    def on_value(self, value: T, now_s: float) -> bool:
        """Takes a value unless its message is late. Returns whether it was taken."""
        if not self.is_next(now_s):
            return False
        self.sample = Sample(value, now_s)
        return True

    @property
    def value(self) -> T | None:
        """The newest value, whatever its age; None while it is not known."""
        sample = self.sample  # once: another thread may have it discarded meanwhile
        return None if sample is None else sample.value

    def fresh(self, now_s: float) -> T | None:
        """Returns the value; None if it is older than its limit, or not known."""
        sample = self.sample
        return None if sample is None or now_s - sample.time_s > self._limit_s else sample.value

    def was_received_within(self, limit_s: float, now_s: float) -> bool:
        """Returns whether a message with this value came lately, whether it was believed or not."""
        return now_s - self._received_s <= limit_s

    @property
    def order(self) -> float:
        """The order of the newest message that had this value."""
        return self._order

    def discard(self) -> None:
        """Forgets the value. Its order stays: a late message does not bring it back."""
        self.sample = self._unknown

    def forget_order(self) -> None:
        """Forgets the order, too, as a new boot counts again."""
        self._order = self._received_s = -math.inf


class Readings:
    """All readings of one vehicle. `order` is that of the present message: a number that grows with what is sent later
    (a sequence number without wraps, a stamp of the device). It is set before the message is taken.
    """

    def __init__(self) -> None:
        self.order = 0.0
        self._all: list[tuple[Valid, Reading[object]]] = []

    def add(self, lasts: Valid, *, limit_s: float = math.inf, unknown: Sample[T] | None = None) -> Reading[T]:
        """Makes a reading. It has no value older than `limit_s`, and the sample `unknown` while it is not known."""
        reading: Reading[T] = Reading(self, limit_s, unknown)
        self._all.append((lasts, reading))  # type: ignore[arg-type]  # only discarded through this list
        return reading

    def discard_state(self) -> None:
        """Discards all that may have changed since it was sent."""
        for lasts, reading in self._all:
            if lasts is Valid.WHILE_HEARD:
                reading.discard()

    def discard_boot(self) -> None:
        """Discards all that belongs to the boot before, and the order of all messages."""
        for lasts, reading in self._all:
            reading.forget_order()
            if lasts is not Valid.ALWAYS:
                reading.discard()


def __getattr__(name: str) -> object:
    if name == "Lasts":
        warnings.warn("Lasts is Valid since 0.3; the old name ends with 0.4", DeprecationWarning, stacklevel=2)
        return Valid
    raise AttributeError(name)
