"""Conditions of arrival."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from ual.geometry import Vector3, wrap_angle
from ual_daemon.backends.values import MotionState, Snapshot
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.references import motion_of, unknown_position
from ual_daemon.trajectory import Motion


class Dwell:
    """Judges whether a condition has held without a break for the dwell time."""

    def __init__(self, dwell_s: float) -> None:
        self._dwell_s = dwell_s
        self._since_s: float | None = None

    def has_held(self, now_s: float, *, holds: bool) -> bool:
        """Returns whether it has. To be called at each update, with whether the condition holds now."""
        if not holds:
            self._since_s = None
        elif self._since_s is None:
            self._since_s = now_s
        return self._since_s is not None and now_s - self._since_s >= self._dwell_s


class _Mean(NamedTuple):
    """The mean errors against the goal."""

    position_error: Vector3
    heading_error_rad: float
    velocity: Vector3


class Arrival:
    """Judges whether the UAV has arrived: within the tolerances, and slow.

    It judges the mean over the dwell time, because an estimate is noisy: a single good or bad sample does not count.
    """

    def __init__(self, position: Vector3, yaw_rad: float, tolerance: ToleranceSettings) -> None:
        self._position, self._yaw_rad, self._tolerance = position, yaw_rad, tolerance
        self._samples: deque[tuple[float, MotionState]] = deque()
        """Measured motions, and when. Compared with the goal only when somebody asks: each update adds one."""

    def observe(self, snapshot: Snapshot) -> None:
        """Adds the measured motion. To be called at each update.

        Raises:
            WrongStateError: It is not known where the UAV is.

        """
        if snapshot.motion.pose is None:
            raise unknown_position()
        samples, now_s = self._samples, snapshot.time_s
        samples.append((now_s, snapshot.motion))
        # One sample older than the dwell time stays, so that the samples span all of it.
        while len(samples) > 1 and now_s - samples[1][0] >= self._tolerance.dwell_s:
            samples.popleft()

    def has_arrived(self, snapshot: Snapshot) -> bool:
        """Returns whether the UAV has arrived."""
        if not self._samples or snapshot.time_s - self._samples[0][0] < self._tolerance.dwell_s:
            return False
        mean, tolerance = self._mean(), self._tolerance
        return (
            mean.position_error.norm() <= tolerance.position_m
            and abs(mean.heading_error_rad) <= tolerance.heading_rad
            and mean.velocity.norm() <= tolerance.speed_m_s
        )

    def _mean(self) -> _Mean:
        position_error, velocity, count = Vector3(), Vector3(), len(self._samples)
        sine = cosine = 0.0  # a mean of angles would make +pi and -pi, each half a turn off, an error of 0
        for _, measured in self._samples:
            motion = motion_of(measured)
            heading_error_rad = wrap_angle(motion.yaw_rad - self._yaw_rad)
            position_error, velocity = position_error + (motion.position - self._position), velocity + motion.velocity
            sine, cosine = sine + math.sin(heading_error_rad), cosine + math.cos(heading_error_rad)
        return _Mean(position_error / count, math.atan2(sine, cosine), velocity / count)

    def turn_left_rad(self, motion: Motion) -> float:
        """Returns how far the heading of a motion is off, beyond the tolerance."""
        return max(0.0, abs(wrap_angle(motion.yaw_rad - self._yaw_rad)) - self._tolerance.heading_rad)

    def error_text(self) -> str:
        """Returns the mean errors, human-readable."""
        mean = self._mean()
        return (
            f"{mean.position_error.norm():.2f} m and {abs(mean.heading_error_rad):.2f} rad off, "
            f"at {mean.velocity.norm():.2f} m/s"
        )
