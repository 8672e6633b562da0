"""Times of UAL (UTC) as times of the node's clock and back. Only stamps use this: no command waits for this clock."""

from __future__ import annotations

import time
from collections.abc import Callable

from ual_ros2 import values
from ual_ros2.messages import Entity, Message

LATEST_S = float((1 << 31) - 1)
"""The latest stamp of ROS: a later one, as of a camera with a wrong clock, cannot be written into a message."""
STANDS_S = 2.0
"""Seconds without a change after which simulated time stands."""


class RosTime:
    """Converts between UTC and ROS' clock, which is UTC too unless it is simulated (``use_sim_time``)."""

    def __init__(
        self, clock: Entity, utc_s: Callable[[], float] = time.time, steady_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._clock = clock
        self._utc_s = utc_s
        self._steady_s = steady_s
        self._seen: tuple[int, float] | None = None
        """Simulated time as it was seen last, and since when it is this."""

    @property
    def is_simulated(self) -> bool:
        """Whether it is that of ``/clock``."""
        return bool(self._clock.ros_time_is_active)

    def stands(self) -> bool:
        """Returns whether simulated time stands. It is to be called again and again."""
        now_s = self._steady_s()
        time_ns = self._clock.now().nanoseconds
        if not self.is_simulated or self._seen is None or self._seen[0] != time_ns:
            self._seen = time_ns, now_s
        return now_s - self._seen[1] > STANDS_S

    def stamp(self, stamp: Message, utc_s: float) -> None:
        """Fills a stamp with a time of UTC."""
        stamp.sec, stamp.nanosec = values.split(min(max(0.0, utc_s + self._offset_s()), LATEST_S))

    def stamp_now(self, stamp: Message) -> None:
        """Fills a stamp with the present."""
        self.stamp(stamp, self._utc_s())

    def utc_s(self, stamp: Message) -> float:
        """Returns the UTC of a stamp; 0 of an empty one, which means now."""
        if not (stamp.sec or stamp.nanosec):
            return 0.0
        return float(stamp.sec + stamp.nanosec / values.NANO - self._offset_s())

    def make_utc(self, stamp: Message) -> None:
        """Turns a stamp into one of UTC; an empty one, which means now, stays so."""
        utc_s = self.utc_s(stamp)
        if utc_s:
            stamp.sec, stamp.nanosec = values.split(min(max(0.0, utc_s), LATEST_S))

    def _offset_s(self) -> float:
        """Returns the seconds by which ROS' clock is before UTC."""
        if not self.is_simulated:
            return 0.0
        return float(self._clock.now().nanoseconds / values.NANO - self._utc_s())
