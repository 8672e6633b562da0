"""Which of two messages was sent first, though their numbers come round every 256."""

from __future__ import annotations

_SEQUENCES = 256


class RunningNumber:
    """The numbers of one sender's messages, going on where they come round.

    Each is placed beside the newest that came, whatever its kind and sent a moment ago: two of one kind may be so
    far apart that their numbers alone do not tell which is older (128 messages are 0.3 s of a PX4 that streams at its
    defaults). After a silence of `late_s` nothing can still be late, and any number is the next one.
    """

    def __init__(self, late_s: float) -> None:
        self.value = 0
        """Of the message taken last."""
        self._late_s = late_s
        self._newest: int | None = None
        self._newest_s = 0.0

    def take(self, sequence: int, now_s: float) -> None:
        """A message of this number came."""
        if self._newest is None:
            self._newest, self._newest_s, self.value = sequence, now_s, sequence
            return
        step = (sequence - self._newest) % _SEQUENCES
        if step < _SEQUENCES // 2 or now_s - self._newest_s > self._late_s:
            self._newest += step
            self._newest_s = now_s
            self.value = self._newest
        else:
            self.value = self._newest + step - _SEQUENCES
