"""Watches the computer's clock: where it is set, times in the log before and after do not belong together."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

from ual_daemon import logs

_log = logging.getLogger(__name__)

JUMP_S = 1.0
"""A clock that is set steps by more than what it is slewed by between two looks."""


class ClockWatch:
    """Logs each jump of the computer's clock. `compare` is called regularly, with the time of a monotonic clock."""

    def __init__(self, clock_s: Callable[[], float] = time.time) -> None:
        self._clock_s = clock_s
        self._offset_s: float | None = None

    def compare(self, now_s: float) -> None:
        """Compares both clocks."""
        offset_s = self._clock_s() - now_s
        if self._offset_s is not None and abs(offset_s - self._offset_s) >= JUMP_S:
            effect = "times of the log, the audit and recordings before it are of the old clock; flights do not use it"
            logs.event(_log, logging.WARNING, "clock_jumped", by_s=round(offset_s - self._offset_s, 3), effect=effect)
        self._offset_s = offset_s
