"""Whether another node tells of the same UAV. It needs no ROS."""

from __future__ import annotations

import time
from collections.abc import Callable

STAYS_S = 30.0
"""A node that was killed is still seen for as long as DDS waits for it: 20 s by default."""
TEXT = "another node has the same UAV: each service and action is executed by both. End one of them"


class Others:
    """Waits until another node has been seen for so long that it is no dead one."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._since_s: float | None = None

    def text(self, tellers: int) -> str:
        """Returns what to say where so many nodes, this one too, tell of the UAV now."""
        if tellers < 2:
            self._since_s = None
            return ""
        if self._since_s is None:
            self._since_s = self._clock()
        return TEXT if self._clock() - self._since_s >= STAYS_S else ""
