"""The clock of a real vehicle."""

from __future__ import annotations

import time

from typing_extensions import override

from ual_daemon.backends.base import Clock


class MonotonicClock(Clock):
    """The computer's monotonic clock, and the same moment as UTC."""

    @override
    def now_s(self) -> float:
        return time.monotonic()

    def utc_s(self) -> float:
        """Returns the present moment as UTC since 1970."""
        return time.time()
