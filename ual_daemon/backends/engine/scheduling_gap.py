"""Notices that the thread that hears the autopilot did not run for long: a stopped process, a starved computer."""

from __future__ import annotations

import math

from ual_daemon.backends.engine import limits


class SchedulingGap:
    """Belongs to the thread that it watches."""

    def __init__(self) -> None:
        self.woke_s = math.inf
        """Time at which the thread woke last; infinite until it has."""
        self._why = ""
        self._ended_s = -math.inf

    def woke(self, now_s: float, link_s: float = math.inf) -> float:
        """Notes that the thread has woken. Returns how long it had paused, in seconds; 0 where that was not long.

        Args:
            now_s: The clock by which the thread is watched.
            link_s: After so long a silence the link to the autopilot counts as lost.

        """
        paused_s, self.woke_s = now_s - self.woke_s, now_s
        if not paused_s > min(limits.READER_PAUSE_S, link_s):
            return 0.0
        self._why, self._ended_s = f"this computer did not run UAL for {paused_s:.1f} s", now_s
        return paused_s

    def why(self, now_s: float) -> str:
        """Returns what the last pause was, human-readable, for a while after it; else nothing."""
        return self._why if now_s - self._ended_s < limits.PAUSE_GRACE_S else ""
