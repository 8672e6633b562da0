"""Whether home is still as high as the autopilot reported last: its own height above home tells, all the time."""

from __future__ import annotations

import logging
import math

from ual_daemon import logs

_log = logging.getLogger(__name__)

HEIGHT_TOLERANCE_M = 0.1
"""Both heights come in millimetres."""
_CONTRARY_HEIGHTS_COUNT = 2
"""Consecutive heights that must contradict it: one of them may have come late."""
_LOGGED_MOVE_M = 0.5
"""Metres outside of all logged positions from which a move of home is logged: a PX4 corrects its home for two minutes,
step by step. It goes back and forth by up to 2.3 m then, several times a second.
"""
_LARGE_MOVE_M = 3.0
"""Metres since the last log line from which a move of home is always logged: a ground station may set home back."""


class HomeWatch:
    """Compares home with what the height above home implies. Not thread-safe.

    Autopilots tell home seldom (PX4 every 2 s), and a ground station may set it at any time.
    """

    def __init__(self, tolerance_m: float = HEIGHT_TOLERANCE_M, doubts_count: int = _CONTRARY_HEIGHTS_COUNT) -> None:
        self._tolerance_m, self._most_doubts = tolerance_m, doubts_count
        self._doubts_count = 0
        self._logged_m = math.nan
        """Height of home in metres when its move was logged last."""
        self._least_m, self._most_m = math.inf, -math.inf
        """The lowest and the highest home that was logged."""
        self.is_wanted = False
        """Whether home should be requested now. The caller sets this back."""

    def is_contradicted(self, home_m: float, altitude_m: float, above_home_m: float) -> bool:
        """Takes an altitude and a height above home of the same moment. Returns whether home is not at `home_m` any
        more, which is an altitude, too.
        """
        if altitude_m == above_home_m or abs(altitude_m - above_home_m - home_m) <= self._tolerance_m:
            self._doubts_count = 0  # the same: it says so while it has no home
            return False
        self._doubts_count += 1
        is_contradicted = self._doubts_count >= self._most_doubts
        if self._doubts_count == self._most_doubts:
            self._log_move(altitude_m - above_home_m, home_m)
        self.is_wanted = self.is_wanted or is_contradicted
        return is_contradicted

    def _log_move(self, found_m: float, home_m: float) -> None:
        is_known = self._least_m - _LOGGED_MOVE_M < found_m < self._most_m + _LOGGED_MOVE_M
        if is_known and abs(found_m - self._logged_m) < _LARGE_MOVE_M:
            return
        self._logged_m, moved_m = found_m, round(found_m - home_m, 2)
        self._least_m, self._most_m = min(self._least_m, found_m), max(self._most_m, found_m)
        logs.event(_log, logging.INFO, "home_moved", up_m=moved_m, why="its height above home contradicts its home")
