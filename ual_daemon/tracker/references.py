"""What a UAV is told at each update while it flies by our references."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable

from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import Limits
from ual_daemon.backends.values import PositionSetpoint, Setpoint, Snapshot, VelocitySetpoint
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.time_scaling import TimeScaling
from ual_daemon.trajectory import Brake, Motion, Trajectory

VELOCITY_TIMEOUT_S = 0.5
"""A velocity reference that is not renewed for so long is over: the UAV stops and holds (contract)."""

_FREE_LAG_M = 0.5
_FREE_LAG_S = 0.4
_LONGEST_LAG_M = 1.5
_LONGEST_STEP_S = 0.2
LONGEST_STOP_S = 3.0
"""How long the reference waits at a stop for a UAV that does not come to rest there (a wandering estimate)."""


class Reference(ABC):
    """Something that gives a setpoint at each update. Poses are in the local frame."""

    @abstractmethod
    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        """The setpoint now. Called once at each update, by the update thread."""

    @abstractmethod
    def motion(self, snapshot: Snapshot) -> Motion:
        """The motion it asks for now: where a next trajectory begins, so that references never jump."""

    @abstractmethod
    def pose(self) -> Pose | None:
        """Where the UAV is told to be; None where only a velocity is told."""


class Hold(Reference):
    """A place to stay at, sent as it is."""

    def __init__(self, position: Vector3, yaw_rad: float) -> None:
        self._setpoint = PositionSetpoint(position, yaw_rad)

    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        return self._setpoint

    def motion(self, snapshot: Snapshot) -> Motion:
        return Motion(self._setpoint.position, self._setpoint.yaw_rad)

    def pose(self) -> Pose | None:
        return Pose(self._setpoint.position, Quaternion.from_yaw(self._setpoint.yaw_rad))


class Velocity(Reference):
    """A velocity until a time. In the body's axes (`in_body`) it turns with the heading and stays level."""

    def __init__(self, twist: Twist, *, in_body: bool, expires_s: float) -> None:
        self._twist, self._in_body, self.expires_s = twist, in_body, expires_s

    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        return VelocitySetpoint(self.velocity(snapshot), self._twist.angular.z)

    def velocity(self, snapshot: Snapshot) -> Vector3:
        """The velocity along the local axes."""
        velocity = self._twist.linear
        if self._in_body and snapshot.pose is not None:
            return Quaternion.from_yaw(snapshot.pose.value.yaw_rad).rotate(velocity)
        return velocity

    def motion(self, snapshot: Snapshot) -> Motion:
        return measured_motion(snapshot)

    def pose(self) -> Pose | None:
        return None


class Follow(Reference):
    """Follows a trajectory in time.

    Where the UAV lags behind (wind, weak motors), the reference waits for it, and slows down for that within the limits
    (see `pace`); where the trajectory stands still at a waypoint, until the UAV is there and slow, too (within
    `tolerance`), so that it really stops.
    """

    def __init__(self, trajectory: Trajectory, now_s: float, tolerance: ToleranceSettings | None = None) -> None:
        self.trajectory = trajectory
        self._tolerance = tolerance or ToleranceSettings()
        self._stops_s = [*trajectory.stops_s, math.inf]
        self._stopped_since_s: float | None = None
        self._updated_s = now_s
        self._pace = TimeScaling(trajectory)
        self.is_stopping = False
        """Whether it comes to rest where it is on the trajectory, as soon as the limits allow."""

    @property
    def time_s(self) -> float:
        """How far in the trajectory's time it is."""
        return self._pace.time_s

    @property
    def is_finished(self) -> bool:
        """Whether the reference has come to the end; the UAV may still be on its way."""
        return self.time_s >= self.trajectory.duration_s

    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        passed_s = min(max(0.0, snapshot.time_s - self._updated_s), _LONGEST_STEP_S)
        self._updated_s = snapshot.time_s
        self._go_on(passed_s, snapshot)
        return setpoint_of(self._pace.motion)

    def _go_on(self, passed_s: float, snapshot: Snapshot) -> None:
        """The trajectory's time passes, but not beyond a stop before the UAV has made it."""
        if self._stopped_since_s is not None:
            if not (self._has_stopped(snapshot) or snapshot.time_s - self._stopped_since_s > LONGEST_STOP_S):
                return
            self._stopped_since_s = None
            self._stops_s.pop(0)
        self._pace.go_on(passed_s, self._stops_s[0], self._wanted_pace(snapshot))
        if self.time_s == self._stops_s[0]:
            self._stopped_since_s = snapshot.time_s

    def _has_stopped(self, snapshot: Snapshot) -> bool:
        measured = measured_motion(snapshot)
        return (
            measured.velocity.norm() <= self._tolerance.speed_m_s
            and (measured.position - self._pace.motion.position).norm() <= self._tolerance.position_m
        )

    def _wanted_pace(self, snapshot: Snapshot) -> float:
        """1 while the UAV is close behind, 0 where it is too far off, in between on the way."""
        if snapshot.pose is None or self.is_stopping:
            return 0.0
        motion = self._pace.motion
        lag_m = (motion.position - snapshot.pose.value.position).norm()
        free_m = _FREE_LAG_M + _FREE_LAG_S * motion.velocity.norm()
        return max(0.0, min(1.0, 1.0 - (lag_m - free_m) / _LONGEST_LAG_M))

    def motion(self, snapshot: Snapshot) -> Motion:
        return self._pace.motion

    def pose(self) -> Pose | None:
        return Pose(self._pace.motion.position, Quaternion.from_yaw(self._pace.motion.yaw_rad))


class StopAlong(Reference):
    """Comes to rest on the trajectory that is followed already, while straight ahead there is no room to brake."""

    def __init__(self, follow: Follow, straight: Callable[[Motion, Snapshot], Follow | None]) -> None:
        """`straight` brakes from a motion straight ahead; None where it may not."""
        self._follow = follow
        self._straight = straight
        self._brake: Follow | None = None
        self._is_begun = False

    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        if self._brake is not None:
            return self._brake.setpoint(snapshot)
        if not self._is_begun:
            # This time another thread may ask, while the update thread still follows: that alone lets time pass.
            self._is_begun = True
            return setpoint_of(self._follow.motion(snapshot))
        self._follow.is_stopping = True
        setpoint = self._follow.setpoint(snapshot)
        self._brake = self._straight(self._follow.motion(snapshot), snapshot)
        return setpoint

    def motion(self, snapshot: Snapshot) -> Motion:
        return (self._brake or self._follow).motion(snapshot)

    def pose(self) -> Pose | None:
        return (self._brake or self._follow).pose()


def setpoint_of(motion: Motion) -> PositionSetpoint:
    """What tells the autopilot to be in a motion now."""
    return PositionSetpoint(
        motion.position, motion.yaw_rad, motion.velocity, motion.acceleration, motion.yaw_rate_rad_s
    )


def measured_motion(snapshot: Snapshot) -> Motion:
    """The motion of the UAV as the autopilot measures it. The snapshot must have a pose."""
    assert snapshot.pose is not None
    pose = snapshot.pose.value
    if snapshot.velocity is None:
        return Motion(pose.position, pose.yaw_rad)
    twist = snapshot.velocity.value
    return Motion(pose.position, pose.yaw_rad, twist.linear, yaw_rate_rad_s=twist.angular.z)


def brake(snapshot: Snapshot, limits: Limits, start: Motion | None = None) -> Follow:
    """Comes to rest from a motion (`start`: the one that is asked for now; None: the measured one), and holds there."""
    return Follow(Brake(start or measured_motion(snapshot), limits), snapshot.time_s)
