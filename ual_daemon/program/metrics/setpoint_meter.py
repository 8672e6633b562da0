"""Counts setpoints, and how late they were sent: the only metric that is taken on the way of a setpoint."""

from __future__ import annotations

import math
import threading
from bisect import bisect_left
from collections.abc import Callable
from itertools import accumulate
from typing import NamedTuple

from ual_daemon.backends.values import Setpoint
from ual_daemon.flight.policy.authority import LONGEST_LINK_GAP_S

BOUNDS_S = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, math.inf)
"""Buckets of the histogram: the largest lateness of their setpoints in s."""


class LatenessHistogram(NamedTuple):
    """The histogram: how many setpoints were late by at most each of `BOUNDS_S`, and the sum of the lateness."""

    counts: tuple[int, ...]
    sum_s: float


class SetpointMeter:
    """Counts the setpoints of one UAV; `on_sent` is called with each, by the thread that sends it.

    A setpoint is due one `period_s` after the one before it, while the UAV is in a state in which UAL sends them. It is
    late by what passes beyond that. After a change to a state in which none are due, and after a gap in which UAL gives
    a flight up, the next one begins again. A lost link, or a stopped process, is lateness: setpoints were due.
    """

    def __init__(self, now_s: Callable[[], float], period_s: float) -> None:
        self.sent_count = 0
        self._now_s = now_s
        self._period_s = period_s
        self._lock = threading.Lock()
        self._counts = [0] * len(BOUNDS_S)
        self._sum_s = 0.0
        self._sent_s = -math.inf

    def on_sent(self, _: Setpoint) -> None:
        """Takes note of a setpoint that was sent."""
        now_s = self._now_s()
        with self._lock:
            gap_s, self._sent_s = now_s - self._sent_s, now_s
            self.sent_count += 1
            if gap_s <= LONGEST_LINK_GAP_S:
                late_s = max(0.0, gap_s - self._period_s)
                self._counts[bisect_left(BOUNDS_S, late_s)] += 1
                self._sum_s += late_s

    def on_pause(self, period_s: float) -> None:
        """Takes note that no setpoint is due from now on until the next one is sent."""
        with self._lock:
            self._sent_s, self._period_s = -math.inf, period_s

    @property
    def lateness(self) -> LatenessHistogram:
        """The histogram as it is now."""
        with self._lock:
            return LatenessHistogram(tuple(accumulate(self._counts)), self._sum_s)
