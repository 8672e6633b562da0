"""The poses from outside as a source of the position: whether they come, since when not, and what doubts them."""

from __future__ import annotations

import math

NOTICED_SILENCE_S = 0.3
"""Sources send 20 poses a second, or more."""
_STREAM_S = 1.0
"""Seconds of poses that make a source on which the UAV may fly."""
_RECENT_LOSS_S = 20.0
"""Seconds after the last pose within which a lost position may have rested on the poses: no autopilot goes on for
longer.
"""
_DOUBT_AGE_LIMIT_S = 0.5


class ExternalSilence:
    """Silence of the external poses. Any thread may call."""

    def __init__(self) -> None:
        self._last_s: float | None = None
        self._since_s = 0.0
        """Since when they have come without a pause."""
        self._dropped = (-math.inf, "")
        """Time of the newest pose that was dropped or refused, and the reason."""
        self._doubted = (-math.inf, "")
        self.good_s = -math.inf
        """Last time at which the autopilot had a good position. An attribute, as each update sets it."""
        self.is_heard = False
        """Whether any has come."""
        self.is_doubtful = False
        """Whether they have been doubted at all: no call for each sample of others."""

    def on_pose(self, now_s: float) -> None:
        """Notes that a pose was given to the autopilot."""
        if self._last_s is None or now_s - self._last_s > NOTICED_SILENCE_S:
            self._since_s = now_s
        self._last_s, self.is_heard = now_s, True

    def dropped(self, now_s: float, why: str) -> None:
        """Notes that a pose came, but was dropped or refused."""
        self._dropped = (now_s, why)

    def doubted(self, now_s: float, why: str) -> None:
        """Notes why the poses that come are not to be trusted."""
        self._doubted = (now_s, why)
        self.is_doubtful = True

    def doubt(self, now_s: float) -> str:
        """Returns why the poses that come are not to be trusted; empty if nothing shows it."""
        doubted_s, why = self._doubted
        return why if now_s - doubted_s <= _DOUBT_AGE_LIMIT_S else ""

    def passed_s(self, now_s: float) -> float:
        """Returns how long ago the last one came; infinity if none ever did."""
        last_s = self._last_s
        return math.inf if last_s is None else now_s - last_s

    def is_source(self, now_s: float) -> bool:
        """Returns whether they come, and have come for long enough to fly on them."""
        last_s = self._last_s
        return last_s is not None and now_s - last_s <= NOTICED_SILENCE_S and last_s - self._since_s >= _STREAM_S

    def why_ended(self, now_s: float) -> str:
        """Returns how a source has ended, human-readable."""
        dropped_s, why = self._dropped
        is_dropped = now_s - dropped_s <= NOTICED_SILENCE_S
        return f"the poses from outside are dropped: {why}" if is_dropped else "no poses come from outside any more"

    def text(self, now_s: float) -> str:
        """Returns what the reason of UNINITIALIZED adds; empty while poses come, and where they are not the cause.

        They explain it for a while, and then as long as it lasts where the position was lost meanwhile.
        """
        passed_s, (dropped_s, why) = self.passed_s(now_s), self._dropped
        if passed_s <= NOTICED_SILENCE_S:
            return ""
        if now_s - dropped_s <= NOTICED_SILENCE_S:
            return f"; the poses from outside are dropped: {why}"
        was_lost_soon = 0.0 <= self.good_s - (now_s - passed_s) <= _RECENT_LOSS_S
        return f"; no poses from outside for {passed_s:.1f} s" if passed_s <= _RECENT_LOSS_S or was_lost_soon else ""
