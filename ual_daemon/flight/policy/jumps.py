"""Detects that the autopilot's estimate of its position has jumped: a reset of its estimator, or a moved origin.

The effect is what counts, as not all autopilots report a reset (PX4 counts its resets, ArduPilot does not). The
position changed by far more than the velocity explains, and stays there. `heading_jumps` does so for the heading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

from ual.geometry import Pose, Vector3
from ual_daemon.backends.values import Sample, Snapshot

T = TypeVar("T")

JUMP_M = 1.0
"""Least step of an estimate in metres that counts as a jump; noise stays below it, and is flown out."""
ANNOUNCED_JUMP_M = 0.2
"""Least step in metres that counts as a jump for `ANNOUNCED_JUMP_S` after one was announced: the source has moved."""
ANNOUNCED_JUMP_S = 3.0
_STEP_NOISE_FACTOR = 4.0
"""Factor of its usual steps by which a noisy estimate must jump."""
_STEP_SMOOTHING_SHARE = 0.05
_LONGEST_POSITION_GAP_S = 2.0
"""After a longer gap between two positions nothing can be said."""
_ACCELERATION_M_S2 = 4.0
"""Between two positions a UAV may fly elsewhere than the mean of its velocities says, by half of this times the time
squared."""
SUSPECTED_JUMP_S = 0.2
"""Seconds for which a suspicion counts if no other position comes."""


class EstimateJump(NamedTuple):
    """By how much the autopilot's estimate has jumped: the position along the local axes, the heading to the left."""

    offset: Vector3 = Vector3()
    yaw_rad: float = 0.0

    @property
    def text(self) -> str:
        """Kind and size of the jump, human-readable."""
        distance_m = self.offset.norm()
        return f"position jumped by {distance_m:.1f} m" if distance_m else f"heading jumped by {self._yaw_deg:.0f} deg"

    @property
    def fields(self) -> dict[str, float]:
        """The same as the fields of an event of the log."""
        x, y, z = self.offset
        return {"x": round(x, 2), "y": round(y, 2), "z": round(z, 2), "yaw_deg": round(self._yaw_deg, 1)}

    @property
    def _yaw_deg(self) -> float:
        return math.degrees(self.yaw_rad)


@dataclass(slots=True)
class _ReceivedPosition:
    """A position and velocity, when they were received and (0 where that is not known) measured, and in which boot.

    When they were measured is on the autopilot's own clock, or else in UTC.
    """

    position: Vector3
    velocity: Vector3
    received_s: float
    measured_s: float
    boots_count: int


class Confirmation(Generic[T]):
    """Reference for comparisons of poses: the `last` that was no jump. A single wrong pose is none: a second must
    confirm it.

    Belongs to the update thread.
    """

    def __init__(self) -> None:
        self.last: T | None = None
        self.is_waiting = False
        """Whether the newest pose has jumped, and was not confirmed yet."""
        self._newest_s = -math.inf

    def is_new(self, pose: Sample[Pose]) -> bool:
        """Returns whether this pose was not seen yet, and takes it as the newest."""
        if pose.time_s == self._newest_s:
            return False
        self._newest_s = pose.time_s
        return True

    def is_suspected(self, now_s: float) -> bool:
        """Returns whether the newest pose has jumped, but another one must confirm it, and may still come."""
        return self.is_waiting and now_s - self._newest_s < SUSPECTED_JUMP_S

    def accept(self, new: T) -> None:
        """Takes a pose that is compared with those that follow."""
        self.last, self.is_waiting = new, False

    def confirms(self, new: T, *, has_jumped: bool) -> bool:
        """Takes a pose. Returns whether it confirms a jump: pose after a suspected one is compared with the same."""
        if has_jumped and not self.is_waiting:
            self.is_waiting = True
            return False
        self.accept(new)
        return has_jumped


class JumpDetector:
    """Compares each position with the one before. Belongs to the update thread."""

    def __init__(self) -> None:
        self.poses = poses = Confirmation[_ReceivedPosition]()
        self._usual_m = 0.0
        self._announced_s = -math.inf
        self.is_suspected = poses.is_suspected

    def announce(self, now_s: float) -> None:
        """Takes note that the position will jump: smaller steps are looked for. Any thread may call."""
        self._announced_s = now_s

    def observe(self, snapshot: Snapshot) -> EstimateJump | None:
        """Returns by how much the estimate has jumped, with the second position there; None if it has not."""
        poses, pose, sample = self.poses, snapshot.motion.pose, snapshot.motion.velocity
        if pose is None or sample is None or not poses.is_new(pose):
            return None
        last = poses.last
        measured_s = snapshot.motion.measured_s or snapshot.motion.stamp_s
        place, velocity, boots_count = pose.value.position, sample.value.linear, snapshot.link.boots_count
        if (
            last is not None
            and boots_count == last.boots_count
            and not poses.is_waiting
            and self._is_continued(last, place, velocity, pose.time_s)
        ):
            last.position, last.velocity, last.received_s, last.measured_s = place, velocity, pose.time_s, measured_s
            return None
        new = _ReceivedPosition(place, velocity, pose.time_s, measured_s, boots_count)
        passed_s = 0.0 if last is None else _longest_s(last, new)
        if last is None or new.boots_count != last.boots_count:
            poses.is_waiting = False
            estimator = snapshot.motion.estimator
            if estimator is not None and estimator.value.is_good:  # until then it looks for its first position
                poses.accept(new)
            return None
        if passed_s > _LONGEST_POSITION_GAP_S:
            poses.accept(new)
            return None
        step = _unexplained(last, new, passed_s)
        free_m = self._free_m(new.received_s) + _ACCELERATION_M_S2 / 2 * passed_s * passed_s
        return EstimateJump(step) if poses.confirms(new, has_jumped=step.norm() > free_m) else None

    def _free_m(self, received_s: float) -> float:
        """Returns by how much the position may change without an explanation."""
        is_announced = received_s - self._announced_s < ANNOUNCED_JUMP_S
        return max(ANNOUNCED_JUMP_M if is_announced else JUMP_M, _STEP_NOISE_FACTOR * self._usual_m)

    def _is_continued(self, last: _ReceivedPosition, q: Vector3, w: Vector3, received_s: float) -> bool:
        """Returns whether the velocity explains the change to a position `q`, with a velocity `w`, well. In plain
        numbers, as each update calls it.
        """
        passed_s = received_s - last.received_s
        if not 0.0 <= passed_s <= _LONGEST_POSITION_GAP_S:
            return False
        p, v = last.position, last.velocity
        half_s = passed_s / 2
        size_m = math.hypot(
            q.x - p.x - (v.x + w.x) * half_s, q.y - p.y - (v.y + w.y) * half_s, q.z - p.z - (v.z + w.z) * half_s
        )
        if size_m > ANNOUNCED_JUMP_M and size_m > self._free_m(received_s):
            return False
        self._usual_m += (size_m - self._usual_m) * _STEP_SMOOTHING_SHARE
        return True


def _longest_s(last: _ReceivedPosition, new: _ReceivedPosition) -> float:
    """Returns how long it was at most between two positions: a link may hold them back and deliver them together."""
    received_s = new.received_s - last.received_s
    are_measured = last.measured_s > 0.0 and new.measured_s > 0.0
    return max(received_s, new.measured_s - last.measured_s if are_measured else received_s)


def _unexplained(last: _ReceivedPosition, new: _ReceivedPosition, passed_s: float) -> Vector3:
    """Returns the part of the change of position that the velocity does not explain, for any time up to `passed_s`."""
    change, velocity = new.position - last.position, (last.velocity + new.velocity) * 0.5
    speed_2 = velocity.dot(velocity)
    if speed_2 == 0.0:
        return change
    return change - velocity * max(0.0, min(passed_s, change.dot(velocity) / speed_2))
