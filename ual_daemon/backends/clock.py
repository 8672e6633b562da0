"""The clock of a real vehicle."""

from __future__ import annotations

import time
from functools import partial

from typing_extensions import override

from ual_daemon.backends.base import Clock

steady_s = partial(time.clock_gettime, getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC))
"""Returns the seconds since some moment. They never go back, and pass while the computer sleeps, too.

Linux' other monotonic clock stands still then. Data from before the sleep would count as new after it.
"""


class MonotonicClock(Clock):
    """The computer's monotonic clock, and the same moment as UTC since 1970 (`utc_s`).

    Both are the system's own functions, as each message requests them several times.
    """

    now_s = staticmethod(steady_s)
    utc_s = staticmethod(time.time)


class SpedUpClock(Clock):
    """Time of a simulation since the clock was made, by the computer's clock: it passes `speed` times as fast."""

    def __init__(self, speed: float) -> None:
        self._begin_s, self._speed = time.monotonic(), speed

    @override
    def now_s(self) -> float:
        return (time.monotonic() - self._begin_s) * self._speed
