"""For how long setpoints have been sent without a gap."""

from __future__ import annotations

import math

GAP_S = 0.5
"""A longer pause between two setpoints is a gap."""


class SetpointMonitor:
    """Takes note of each setpoint that was sent. From any thread."""

    def __init__(self) -> None:
        self._first_and_last_s = (-math.inf, -math.inf)  # replaced as a whole, so that it is read as a whole

    def on_sent(self, now_s: float) -> None:
        """Takes note of a setpoint that has left."""
        first_s, last_s = self._first_and_last_s
        self._first_and_last_s = (now_s if now_s - last_s > GAP_S else first_s, now_s)

    def duration_s(self, now_s: float) -> float:
        """Returns for how long setpoints have been sent without a gap; 0 while none are sent."""
        first_s, last_s = self._first_and_last_s
        return 0.0 if now_s - last_s > GAP_S else last_s - first_s
