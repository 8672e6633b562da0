"""Times of the autopilot's measurements: its time since boot as UTC, without setting its clock."""

from __future__ import annotations

import math

OFFSET_WINDOW_S = 1.0
"""Seconds for which the fastest message counts. A longer window rejects more jitter, a shorter one follows a clock that
runs wrong (a simulator's by 1 %) more closely.
"""


class ClockOffset:
    """Converts time since boot to UTC by the fastest of the last messages, whose delay on the link is taken as zero.

    For one boot. The offsets are taken on the monotonic clock, so that a step of the wall clock moves the results with
    it and has no other effect.
    """

    def __init__(self, window_s: float = OFFSET_WINDOW_S) -> None:
        self._window_s = window_s
        self._window_ends_s = -math.inf
        self._last_window_s = math.inf
        self._this_window_s = math.inf

    def to_utc(self, boot_s: float, now_s: float, utc_now_s: float) -> float:
        """Returns `boot_s` as UTC, from a message received at `now_s` (monotonic), which is `utc_now_s`."""
        offset_s = now_s - boot_s
        if now_s >= self._window_ends_s:
            self._window_ends_s = now_s + self._window_s / 2
            self._last_window_s, self._this_window_s = self._this_window_s, offset_s
        self._this_window_s = min(self._this_window_s, offset_s)
        return utc_now_s - (offset_s - min(self._last_window_s, self._this_window_s))
