"""Finds out whether the autopilot sends more than the link carries, and how much less to ask for. Pure logic.

A link that loses much may be bad, or overrun: a radio of 4 kB/s into which the autopilot sends 20. Only a try tells: if
less is requested, the part that arrives grows where the link was overrun, and stays the same where it is bad.
"""

from __future__ import annotations

import math

HIGH_LOSS, LEFT_LOSS = 0.3, 0.1
"""Share of lost messages from which less is requested, and the share that counts once that has helped."""
LOSS_DURATION_S = 10.0
"""Seconds over which the loss is measured: a change shows after this time, and a loss must have lasted for it."""
HELPS_FACTOR, HELPS_LOSS = 1.25, 0.67
"""A try has helped if the part that arrives has grown by this factor at least, or the part that is lost has fallen by
the second one. Where messages are lost at random, both vary by a few percent."""
RETRY_S = 60.0
"""Seconds between a try that did not help and the next one; this doubles each time."""
LOW_LOSS, GROW_S = 0.05, 60.0
"""Share of lost messages below which more is requested again, while it is disarmed, and seconds for which it must last;
these double each time, too.
"""
HIGHEST_LEVEL = 4
"""The highest level; see `RateFit.level`."""


class RateFit:
    """Judges the loss once a second. Belongs to the thread that receives.

    `level` is how much less to ask for. At 0 it is nothing. At 1 the messages that UAL does not use come only once a
    second. From 2 on those that it uses come at half, a quarter, an eighth of the rate that is wanted.
    """

    def __init__(self) -> None:
        self.level = 0
        self.loss = 0.0
        """The newest loss."""
        self.is_high = False
        """Whether much is lost. An attribute, as each frame asks."""
        self._next_s = -math.inf
        self._high_since_s = self._low_since_s = math.inf
        self._try: tuple[int, float, float] | None = None
        """The level before the try that is in progress, the loss then, and when the try began."""
        self._retry_s = -math.inf
        self._pause_s, self._grow_s = RETRY_S, GROW_S

    @property
    def share(self) -> float:
        """The part of the wanted rates to ask for."""
        return 0.5 ** max(0, self.level - 1)

    def is_due(self, now_s: float) -> bool:
        """Returns whether the loss is to be taken now."""
        return now_s >= self._next_s

    def update(self, now_s: float, loss: float, *, is_armed: bool, has_unused: bool = True) -> bool:
        """Takes the part of the messages that was lost lately. Returns whether the level has changed.

        `has_unused` is whether messages come that are not used: else the first level would change nothing.
        """
        self._next_s, self.loss, self.is_high = now_s + 1.0, loss, loss >= HIGH_LOSS
        is_too_high = loss >= (LEFT_LOSS if self.level else HIGH_LOSS)
        self._high_since_s = min(self._high_since_s, now_s) if is_too_high else math.inf
        self._low_since_s = min(self._low_since_s, now_s) if loss < LOW_LOSS else math.inf
        before = self.level
        if self._try is not None:
            self._judge(*self._try, now_s)
        elif now_s - self._high_since_s >= LOSS_DURATION_S and now_s >= self._retry_s and self.level < HIGHEST_LEVEL:
            self._try = (self.level, loss, now_s)
            self.level = max(self.level + 1, 1 if has_unused else 2)
        elif now_s - self._low_since_s >= self._grow_s and self.level and not is_armed:
            self._grow_s *= 2.0
            self._low_since_s = now_s
            self.level -= 1
        return self.level != before

    def _judge(self, level: int, loss: float, begun_s: float, now_s: float) -> None:
        if now_s - begun_s <= LOSS_DURATION_S + 1.0:
            return
        self._try = None
        if 1.0 - self.loss < HELPS_FACTOR * (1.0 - loss) and self.loss > HELPS_LOSS * loss:
            self.level = level
            self._retry_s = now_s + self._pause_s
            self._pause_s *= 2.0
