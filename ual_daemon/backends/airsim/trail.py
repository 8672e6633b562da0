"""Recent poses of the vehicle: a picture arrives later than it was rendered."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Sequence

from ual.geometry import Pose, Quaternion

MOST_POSES = 1024
LONGEST_POSE_GAP_S = 0.25
"""Longest gap in seconds between two poses, or after the last one, within which the vehicle's position is known."""


class Trail:
    """The last poses by the simulator's time. For one thread that adds, and any that look."""

    def __init__(self) -> None:
        self._poses: deque[tuple[float, Pose]] = deque(maxlen=MOST_POSES)

    def add(self, time_s: float, pose: Pose) -> None:
        """Adds a pose. Where time goes back, another simulator has begun: the earlier ones are forgotten."""
        if self._poses and time_s < self._poses[-1][0]:
            self._poses.clear()
        self._poses.append((time_s, pose))

    def at(self, time_s: float) -> Pose | None:
        """Returns the pose at a time, between the two around it; None where that is not known.

        A picture may be newer than the last report. Then it is where the last two lead, at their speed.
        """
        poses = list(self._poses)
        after = bisect_left([each[0] for each in poses], time_s)
        if after == len(poses):
            return _beyond(poses[-2:], time_s)
        end_s, end = poses[after]
        if time_s == end_s:
            return end
        if not after or end_s - poses[after - 1][0] > LONGEST_POSE_GAP_S:
            return None
        begin_s, begin = poses[after - 1]
        return between(begin, end, (time_s - begin_s) / (end_s - begin_s))


def _beyond(last: Sequence[tuple[float, Pose]], time_s: float) -> Pose | None:
    if not last or time_s - last[-1][0] > LONGEST_POSE_GAP_S:
        return None
    begin_s, begin = last[0]
    end_s, end = last[-1]
    if not 0.0 < end_s - begin_s <= LONGEST_POSE_GAP_S:
        return end
    return between(begin, end, (time_s - begin_s) / (end_s - begin_s))


def between(begin: Pose, end: Pose, share: float) -> Pose:
    """Returns the pose that is a share of the way from one to another, which is near. Above 1 it is beyond that."""
    position = begin.position + (end.position - begin.position) * share
    sign = 1.0 if sum(a * b for a, b in zip(begin.orientation, end.orientation, strict=True)) >= 0.0 else -1.0
    mixed = (a + (sign * b - a) * share for a, b in zip(begin.orientation, end.orientation, strict=True))
    return Pose(position, Quaternion(*mixed).normalized())
