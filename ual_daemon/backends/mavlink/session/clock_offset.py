"""When the autopilot measured: its time since boot as UTC, without its clock being set."""

from __future__ import annotations

import math

WINDOW_S = 1.0
"""How long the fastest message counts. Longer rejects more jitter, shorter follows a clock that runs wrong (a
simulator's by 1 %) more closely."""


class StampFilter:
    """Maps time since boot to UTC by the fastest of the last messages, whose delay on the link is taken as none.

    For one boot. The differences are taken on the monotonic clock, so that a step of the wall clock moves the stamps
    with it and does nothing else.
    """

    def __init__(self) -> None:
        self._window_ends_s = -math.inf
        self._before = math.inf
        self._now = math.inf

    def utc(self, boot_s: float, now_s: float, utc_now_s: float) -> float:
        """UTC of `boot_s`, in a message received at `now_s` (monotonic), which is `utc_now_s`."""
        offset = now_s - boot_s
        if now_s >= self._window_ends_s:
            self._window_ends_s = now_s + WINDOW_S / 2
            self._before, self._now = self._now, offset
        self._now = min(self._now, offset)
        return utc_now_s - (offset - min(self._before, self._now))
