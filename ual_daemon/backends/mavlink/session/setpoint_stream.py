"""For how long setpoints have been flowing."""

from __future__ import annotations

import math

GAP_S = 0.5
"""A longer pause ends the stream."""


class SetpointStream:
    """Notes each setpoint sent. From any thread."""

    def __init__(self) -> None:
        self._span_s = (-math.inf, -math.inf)  # replaced as a whole, so that it is read as a whole

    def sent(self, now_s: float) -> None:
        """A setpoint has left."""
        first_s, last_s = self._span_s
        self._span_s = (now_s if now_s - last_s > GAP_S else first_s, now_s)

    def duration_s(self, now_s: float) -> float:
        """For how long they have come without a gap; 0 when they do not come."""
        first_s, last_s = self._span_s
        return 0.0 if now_s - last_s > GAP_S else last_s - first_s
