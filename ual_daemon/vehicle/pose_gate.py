"""Gate for external poses: it passes new ones, in order, that a vehicle can have flown."""

from __future__ import annotations

import math
from typing import NamedTuple

from ual.geometry import Pose

OLDEST_POSE_S = 0.2
"""Age in seconds from which a pose says only where the UAV was. Autopilots keep about so much of the past."""
FUTURE_S = 0.05
"""Seconds by which the clock of the source may be ahead."""
POSE_GAP_S = 0.004
"""Poses are passed on 250 times a second at most: no autopilot uses more, and links and computers have other work."""
_TICK_S = 0.001
"""The time of a stamp is taken on another clock, so that the same stamp comes out a little differently each time."""
LEAST_SPEED_M_S = 5.0
"""Speed in m/s at which a UAV may be carried, or pushed by wind, whatever it flies with."""
_FASTEST_TURN_RAD_S = 35.0
POSITION_MARGIN_M = 0.25
_ANGLE_MARGIN_RAD = 0.35
_STD_DEV_FACTOR = 3.0
SETTLED_TIME_S = 1.0
"""Seconds for which poses must go on elsewhere to be no mistake: the source has moved its origin, or the UAV was
carried.
"""


class Drop(NamedTuple):
    """Why a pose is not given to the autopilot: `why` is one of few texts, `detail` has the figures."""

    why: str
    detail: str

    def __str__(self) -> str:
        return f"{self.why}: {self.detail}"


class _ReceivedPose(NamedTuple):
    pose: Pose
    time_s: float


class PoseGate:
    """Judges the poses of one UAV, one after the other. Times are of one clock. Not thread-safe."""

    def __init__(self, advice: str = "compare the clocks") -> None:
        """`advice` says what to do about a stamp that is too old or in the future."""
        self._advice = advice
        self.resets_count = 0
        """Changes with a pose that is taken although it is a jump."""
        self._last: _ReceivedPose | None = None
        self._elsewhere: _ReceivedPose | None = None
        self._elsewhere_since_s = 0.0

    def untimely(self, time_s: float, now_s: float) -> Drop | None:
        """Returns why a pose that was measured at a time cannot be used; None if it can."""
        age_s = now_s - time_s
        if age_s > OLDEST_POSE_S:
            return Drop("it is old", f"measured {age_s:.2f} s ago, at most {OLDEST_POSE_S:g} s; {self._advice}")
        if age_s < -FUTURE_S:
            return Drop("it is in the future", f"its stamp is {-age_s:.2f} s ahead; {self._advice}")
        if self._last is not None and time_s < self._last.time_s - _TICK_S:
            before_s = self._last.time_s - time_s
            return Drop("it is older than the one before", f"by {before_s:.3f} s; is there another source?")
        return None

    def is_too_soon(self, time_s: float) -> bool:
        """Returns whether a timely pose comes so soon after the last one that the autopilot has no use for it."""
        return self._last is not None and time_s - self._last.time_s < POSE_GAP_S

    def jump(self, pose: Pose, time_s: float, std_dev_m: float, fastest_m_s: float) -> Drop | None:
        """Notes a timely pose. Returns how it jumps, if it is not to be used; None if it is.

        `fastest_m_s` is the highest speed at which the UAV may move.
        """
        seen, last = _ReceivedPose(pose, time_s), self._last
        if last is None or self._goes_on(last, seen, std_dev_m, max(fastest_m_s, LEAST_SPEED_M_S)):
            self._last, self._elsewhere = seen, None
            return None
        return Drop("it jumps as no vehicle flies", _apart(last, seen))

    def _goes_on(self, last: _ReceivedPose, seen: _ReceivedPose, std_dev_m: float, fastest_m_s: float) -> bool:
        """Returns whether a pose follows the last good one, or those that have gone on elsewhere for long."""
        elsewhere = self._elsewhere
        if elsewhere is None or not _is_nearer(elsewhere, last, seen):
            if _is_airborne(last, seen, std_dev_m, fastest_m_s):
                return True
            elsewhere = None
        self._elsewhere = seen
        if elsewhere is None or not _is_airborne(elsewhere, seen, std_dev_m, fastest_m_s):
            self._elsewhere_since_s = seen.time_s
            return False
        is_settled = seen.time_s - self._elsewhere_since_s >= SETTLED_TIME_S
        self.resets_count += is_settled
        return is_settled


def _is_nearer(elsewhere: _ReceivedPose, last: _ReceivedPose, seen: _ReceivedPose) -> bool:
    """Returns whether a pose goes on where dropped ones were, and does not come back to where the last good one was.

    The time since the last good one does not count for it: while poses are dropped it grows, until any jump would be
    one that a vehicle can have flown.
    """
    return _measure(elsewhere.pose, seen.pose) < _measure(last.pose, seen.pose)


def _measure(begin: Pose, end: Pose) -> float:
    """Returns the distance between two poses in allowed margins of position and orientation."""
    return (end.position - begin.position).norm() / POSITION_MARGIN_M + _angle_rad(begin, end) / _ANGLE_MARGIN_RAD


def _is_airborne(begin: _ReceivedPose, end: _ReceivedPose, std_dev_m: float, fastest_m_s: float) -> bool:
    """Returns whether a vehicle can have moved from one to the other."""
    passed_s = end.time_s - begin.time_s
    way_m = POSITION_MARGIN_M + _STD_DEV_FACTOR * std_dev_m + fastest_m_s * passed_s
    if (end.pose.position - begin.pose.position).norm() > way_m:
        return False
    return _angle_rad(begin.pose, end.pose) <= _ANGLE_MARGIN_RAD + _FASTEST_TURN_RAD_S * passed_s


def _apart(begin: _ReceivedPose, end: _ReceivedPose) -> str:
    distance_m = (end.pose.position - begin.pose.position).norm()
    return f"{distance_m:.2f} m and {_angle_rad(begin.pose, end.pose):.2f} rad in {end.time_s - begin.time_s:.3f} s"


def _angle_rad(begin: Pose, end: Pose) -> float:
    cosine = abs(sum(a * b for a, b in zip(begin.orientation, end.orientation, strict=True)))
    return 2.0 * math.acos(min(1.0, cosine))
