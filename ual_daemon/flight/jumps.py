"""Detects that the autopilot's estimate of its position has jumped: a reset of its estimator, or a moved origin.

The effect is what counts, as not all autopilots report a reset (PX4 counts its resets, ArduPilot does not): the
position changed by far more than the velocity explains, and stays there.
"""

from __future__ import annotations

from typing import NamedTuple

from ual.geometry import Vector3
from ual_daemon.backends.values import Snapshot

JUMP_M = 1.0
"""What an estimate wanders by within its noise is less, and is flown out."""
_NOISE_FACTOR = 4.0
"""An estimate whose steps are usually larger must jump by so many times as much."""
_SMOOTHING = 0.05
_LONGEST_S = 2.0
"""After a longer gap between two positions nothing can be said."""
_ACCELERATION_M_S2 = 4.0
"""Between two positions a UAV may fly elsewhere than the mean of its velocities says, by half of this times the time
squared."""


_SUSPECTED_S = 0.2
"""So long a suspicion counts if no other position comes."""


class _Seen(NamedTuple):
    """A position and velocity, when they were received and (0 where that is not known) measured, and in which boot."""

    position: Vector3
    velocity: Vector3
    received_s: float
    stamp_s: float
    boots_count: int


class JumpDetector:
    """Compares each position with the one before. Belongs to the update thread."""

    def __init__(self) -> None:
        self._last: _Seen | None = None
        self._seen_s: float | None = None
        self._is_suspected = False
        self._usual_m = 0.0

    def is_suspected(self, now_s: float) -> bool:
        """Whether the newest position has jumped, but another one must confirm it."""
        return self._is_suspected and self._seen_s is not None and now_s - self._seen_s < _SUSPECTED_S

    def observe(self, snapshot: Snapshot) -> Vector3 | None:
        """Returns by how much the estimate has jumped; None if it has not.

        A jump is returned with its second position, so that a single wrong one is none.
        """
        pose = snapshot.pose
        if pose is None or snapshot.velocity is None or pose.time_s == self._seen_s:
            return None
        self._seen_s = pose.time_s
        velocity = snapshot.velocity.value.linear
        new = _Seen(pose.value.position, velocity, pose.time_s, snapshot.stamp_s, snapshot.boots_count)
        last = self._last
        passed_s = 0.0 if last is None else _longest_s(last, new)
        if last is None or passed_s > _LONGEST_S or new.boots_count != last.boots_count:
            self._last, self._is_suspected = new, False
            return None
        step = _unexplained(last, new, passed_s)
        size_m = step.norm()
        free_m = max(JUMP_M, _NOISE_FACTOR * self._usual_m) + _ACCELERATION_M_S2 / 2 * passed_s * passed_s
        has_jumped = size_m > free_m
        if has_jumped and not self._is_suspected:  # the next one is compared with the same position
            self._is_suspected = True
            return None
        if not has_jumped:
            self._usual_m += (size_m - self._usual_m) * _SMOOTHING
        self._last, self._is_suspected = new, False
        return step if has_jumped else None


def _longest_s(last: _Seen, new: _Seen) -> float:
    """Returns how long it was at most between two positions: a link may hold them back and deliver them together."""
    received_s = new.received_s - last.received_s
    return max(received_s, new.stamp_s - last.stamp_s if last.stamp_s > 0.0 and new.stamp_s > 0.0 else received_s)


def _unexplained(last: _Seen, new: _Seen, passed_s: float) -> Vector3:
    """Returns the part of the change of position that the velocity does not explain, for any time up to `passed_s`."""
    change, velocity = new.position - last.position, (last.velocity + new.velocity) * 0.5
    speed_2 = velocity.dot(velocity)
    if speed_2 == 0.0:
        return change
    return change - velocity * max(0.0, min(passed_s, change.dot(velocity) / speed_2))
