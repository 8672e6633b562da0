"""Detects that the autopilot's estimate of its heading has jumped: a reset of its estimator that moves no position.

As for positions (`jumps`), the effect is what counts: the heading changed by far more than the yaw rate explains, and
stays there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ual.geometry import Quaternion, wrap_angle
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.policy.jumps import Confirmation, EstimateJump

JUMP_RAD = 0.2
"""Least turn of an estimate in rad that counts as a jump; noise stays below it, and is turned back."""
_LATE_HEADING_S = 0.25
"""Seconds by which the heading of a pose may be older than its position: the autopilot sends them in different
messages.
"""
_ACCELERATION_RAD_S2 = 5.0
"""Between two headings the yaw rate may be another one than both, by half of this times the time."""
_HEADING_S = 0.5
"""After a longer gap between two headings nothing can be said."""


@dataclass(slots=True)
class _ReceivedHeading:
    """A heading, a yaw rate, when they were received, and in which boot."""

    orientation: Quaternion
    yaw_rad: float
    rate_rad_s: float
    received_s: float
    boots_count: int


class HeadingJumpDetector:
    """Compares each heading with the one before. Belongs to the update thread."""

    def __init__(self) -> None:
        self.poses = poses = Confirmation[_ReceivedHeading]()
        self.is_suspected = poses.is_suspected

    def observe(self, snapshot: Snapshot) -> EstimateJump | None:
        """Returns by how much the heading has jumped, with the second heading there; None if it has not."""
        poses, pose, velocity = self.poses, snapshot.motion.pose, snapshot.motion.velocity
        if pose is None or velocity is None or not poses.is_new(pose):
            return None
        orientation, last = pose.value.orientation, poses.last
        rate_rad_s, boots_count = velocity.value.angular.z, snapshot.link.boots_count
        yaw_rad = last.yaw_rad if last is not None and orientation is last.orientation else orientation.yaw_rad
        if last is not None and abs(math.remainder(yaw_rad - last.yaw_rad, math.tau)) <= JUMP_RAD:  # nearly always
            last.orientation, last.yaw_rad, last.rate_rad_s = orientation, yaw_rad, rate_rad_s
            last.received_s, last.boots_count, poses.is_waiting = pose.time_s, boots_count, False
            return None
        new = _ReceivedHeading(orientation, yaw_rad, rate_rad_s, pose.time_s, boots_count)
        if last is None:
            poses.accept(new)
            return None
        jump_rad = _jump_rad(last, new)
        return EstimateJump(yaw_rad=jump_rad) if poses.confirms(new, has_jumped=bool(jump_rad)) else None


def _jump_rad(last: _ReceivedHeading, new: _ReceivedHeading) -> float:
    """Returns by how much the heading has changed where the yaw rate does not explain it; else 0."""
    if new.boots_count != last.boots_count or not 0.0 <= new.received_s - last.received_s <= _HEADING_S:
        return 0.0
    passed_s = new.received_s - last.received_s
    change_rad = wrap_angle(new.yaw_rad - last.yaw_rad)
    fastest_rad_s = max(abs(last.rate_rad_s), abs(new.rate_rad_s))
    free_rad = JUMP_RAD + fastest_rad_s * (passed_s + _LATE_HEADING_S) + _ACCELERATION_RAD_S2 / 2 * passed_s * passed_s
    return change_rad if abs(change_rad) > free_rad else 0.0
