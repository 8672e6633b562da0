"""MAVLink's sequence numbers, which wrap after 255: which of two messages was sent first, and how many were lost."""

from __future__ import annotations

import math

_SEQUENCES, _LATE_FROM = 256, 128
LATE_FRAMES_COUNT = 128
"""A number that is at most this much behind the newest is of a late or doubled frame; a larger distance is a gap the
other way round. A jitter of 0.2 s reorders some 100 of PX4's messages."""


class SequenceUnwrapper:
    """Turns the sequence numbers of one sender into numbers that keep growing where they wrap.

    Each number is compared with the newest of any kind of message, which was sent a moment ago. Two messages of one
    kind may be so far apart that their numbers alone do not show which is older. 128 messages are 0.3 s of a PX4 that
    streams at its defaults. After a silence of `late_s` nothing can still be late, and any number is the next one.
    """

    def __init__(self, late_s: float) -> None:
        self.value = 0
        """Of the last message."""
        self._late_s = late_s
        self.newest = 0
        """The newest number. A caller whose message has the next one may set this, `newest_s` and `value` itself."""
        self.newest_s = -math.inf
        """Time at which the newest number came."""

    def update(self, sequence: int, now_s: float) -> int:
        """Takes the number of a message that has arrived. Returns the one that keeps growing."""
        newest = self.newest
        step = (sequence - newest) % _SEQUENCES
        if step < _LATE_FROM or now_s - self.newest_s > self._late_s:
            self.newest_s = now_s
            self.newest = self.value = value = newest + step
        else:
            self.value = value = newest + step - _SEQUENCES
        return value


class SequenceGaps:
    """Counts lost messages by the gaps in one sender's numbers; frames that come late or twice are not lost."""

    def __init__(self) -> None:
        self.next: int | None = None
        """The number with which nothing is lost: the finder may count on from it. None where there is none,
        or others are missing."""
        self._newest: int | None = None
        self._missing: set[int] = set()

    def count_lost(self, sequence: int) -> int:
        """Returns how many more frames are known to be lost, now that this number came; -1 when a missing one came."""
        if self.next is not None:
            self._newest = self.next - 1
        lost_count = self._count_lost(sequence)
        self.next = None if self._missing or self._newest is None else (self._newest + 1) % _SEQUENCES
        return lost_count

    def _count_lost(self, sequence: int) -> int:
        if self._newest is None:
            self._newest = sequence
            return 0
        step = (sequence - self._newest) % _SEQUENCES
        if step == 0 or step >= _SEQUENCES - LATE_FRAMES_COUNT:
            if sequence not in self._missing:
                return 0  # twice
            self._missing.remove(sequence)
            return -1
        self._newest = sequence
        # Numbers that this step has passed after a wrap are missing again; those too old to still come are forgotten.
        self._missing = {each for each in self._missing if 0 < (sequence - each) % _SEQUENCES <= LATE_FRAMES_COUNT}
        gap = [(sequence - back) % _SEQUENCES for back in range(1, step)]
        self._missing.update(gap[:LATE_FRAMES_COUNT])
        return len(gap)
