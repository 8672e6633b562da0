"""Recently sent setpoints, and the duration of their sending without a gap."""

from __future__ import annotations

import math
from collections import deque
from typing import TypeAlias

from ual_daemon.backends.values import Setpoint

SETPOINT_GAP_S = 0.5
"""A longer pause between two setpoints is a gap."""
_RECENT_SETPOINTS_COUNT = 150

Sent: TypeAlias = Setpoint | tuple[float, float, float] | None
"""A setpoint as the autopilot gets it; of a velocity also x, y and z alone. None where it is not known."""


class SetpointMonitor:
    """Takes note of each setpoint that was sent. From any thread."""

    def __init__(self) -> None:
        self._first_and_last_s = (-math.inf, -math.inf)  # replaced as a whole, so that it is read as a whole
        self.recent: deque[tuple[float, Sent]] = deque(maxlen=_RECENT_SETPOINTS_COUNT)
        """Times and values of the last setpoints."""

    @property
    def last_s(self) -> float:
        """Time of the last setpoint."""
        return self._first_and_last_s[1]

    def on_sent(self, now_s: float, setpoint: Sent = None) -> None:
        """Takes note of a setpoint that has left."""
        self.recent.append((now_s, setpoint))
        first_s, last_s = self._first_and_last_s
        self._first_and_last_s = (now_s if now_s - last_s > SETPOINT_GAP_S else first_s, now_s)

    def longest_gap_s(self, since_s: float, until_s: float) -> float:
        """Returns for how long none was sent at most, between two times; of a gap that began earlier, all of it."""
        times_s = [time_s for time_s, _ in list(self.recent)]
        ends_s = [*times_s[1:], until_s]
        return max(
            (end_s - begin_s for begin_s, end_s in zip(times_s, ends_s, strict=False) if end_s > since_s),
            default=math.inf,
        )

    def duration_s(self, now_s: float) -> float:
        """Returns for how long setpoints have been sent without a gap; 0 while none are sent."""
        first_s, last_s = self._first_and_last_s
        return 0.0 if now_s - last_s > SETPOINT_GAP_S else last_s - first_s
