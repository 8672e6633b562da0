"""The clock of a real vehicle."""

from __future__ import annotations

import time

from ual_daemon.backends.base import Clock


class MonotonicClock(Clock):
    """The computer's monotonic clock, and the same moment as UTC since 1970 (`utc_s`).

    Both are the system's own functions, as each message asks for them several times.
    """

    now_s = staticmethod(time.monotonic)
    utc_s = staticmethod(time.time)
