"""References: what is sent to the autopilot at each update while the UAV flies by setpoints of UAL."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence

from typing_extensions import override

from ual.errors import UalError, WrongStateError
from ual.geometry import Pose, Quaternion, Twist, Vector3, vector3, wrap_angle
from ual.types import Limits
from ual_daemon.backends.values import (
    MotionState,
    PositionSetpoint,
    Setpoint,
    Snapshot,
    VelocityResponses,
    VelocitySetpoint,
)
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.drift import DriftCorrection
from ual_daemon.tracker.time_scaling import TimeScaling
from ual_daemon.trajectory import Brake, Motion, Moved, Trajectory

VELOCITY_TIMEOUT_S = 0.5
"""Seconds without a renewal after which a velocity reference ends: the UAV stops and holds (contract)."""

_ZERO = Vector3()
_FREE_LAG_M = 0.5
_FREE_LAG_S = 0.4
_LONGEST_LAG_M = 1.5
_LONGEST_UPDATE_STEP_S = 0.2
LONGEST_STOP_S = 3.0
"""Seconds for which a reference waits at a stop for a UAV that does not come to rest there (a wandering estimate)."""


class Reference:
    """Gives a setpoint at each update. Poses and motions are in the local frame.

    Not an `ABC`: each update asks several times whether it is a `Velocity`, which would be a Python call each.
    """

    stop_reason: UalError | None = None
    """Why it stands, though it is to lead on: the geofence, or a lost goal; None while it does what it is to."""

    is_timed = False
    """Whether it ends unless it is given again."""

    @abstractmethod
    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        """Returns the setpoint now. Called once at each update, by the update thread."""

    @abstractmethod
    def motion(self, snapshot: Snapshot) -> Motion:
        """Returns the motion that it commands now. The next trajectory begins with it, so references never jump."""

    def motion_time_s(self, snapshot: Snapshot) -> float:
        """Returns the time of that motion: a reference may have moved last at the update before."""
        return snapshot.time_s

    @abstractmethod
    def pose(self) -> Pose | None:
        """Returns the pose that it commands now; None if it commands only a velocity."""

    def path_points(self, now_s: float) -> Sequence[Vector3]:
        """Returns the way to where it leads, as points; none where it does not lead anywhere else than it commands."""
        del now_s
        return ()


class Hold(Reference):
    """A pose to hold, sent as it is."""

    def __init__(self, position: Vector3, yaw_rad: float) -> None:
        self.position = position
        self._setpoint = PositionSetpoint(position, yaw_rad)

    def moved(self, offset: Vector3, yaw_rad: float = 0.0) -> Hold:
        """Returns the same pose at another position, and with the heading changed by an angle."""
        return Hold(self.position + offset, wrap_angle(self._setpoint.yaw_rad + yaw_rad))

    @override
    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        return self._setpoint

    @override
    def motion(self, snapshot: Snapshot) -> Motion:
        return Motion(self._setpoint.position, self._setpoint.yaw_rad)

    @override
    def pose(self) -> Pose | None:
        return Pose(self._setpoint.position, Quaternion.from_yaw(self._setpoint.yaw_rad))


class Velocity(Reference):
    """A velocity until a time. In the body's axes (`in_body`) it turns with the heading and stays level.

    What `drift` says is added to what is sent.
    """

    is_timed = True

    def __init__(self, twist: Twist, drift: DriftCorrection, *, in_body: bool, expires_s: float) -> None:
        self.twist, self._in_body, self.expires_s = twist, in_body, expires_s
        self._drift = drift

    @override
    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        # Most velocities need not be turned: each function called here delays the setpoints of a stream.
        velocity = self.velocity(snapshot) if self._in_body else self.twist.linear
        more = self._drift.velocity
        velocity = vector3(velocity.x + more.x, velocity.y + more.y, velocity.z + more.z)
        return VelocitySetpoint(velocity, self.twist.angular.z + self._drift.yaw_rate_rad_s)

    def velocity(self, snapshot: Snapshot) -> Vector3:
        """Returns the commanded velocity along the local axes."""
        velocity = self.twist.linear
        if self._in_body and snapshot.motion.pose is not None:
            return Quaternion.from_yaw(snapshot.motion.pose.value.yaw_rad).rotate(velocity)
        return velocity

    def correct_drift(self, snapshot: Snapshot, limits: Limits, responses: VelocityResponses) -> None:
        """Computes what is to be added to what is sent. Called once at each update, by the update thread."""
        self._drift.step(Twist(self.velocity(snapshot), self.twist.angular), snapshot, limits, responses)

    @override
    def motion(self, snapshot: Snapshot) -> Motion:
        return measured_motion(snapshot)

    @override
    def pose(self) -> Pose | None:
        return None


class TrajectoryReference(Reference):
    """Sends the motions of a trajectory in time.

    While the UAV lags behind (wind, weak motors), the reference slows down within the limits and waits for it; see
    `TimeScaling`. At a waypoint where the trajectory stands still, it waits until the UAV is there and slow, too
    (within `tolerance`), so that the UAV really stops.
    """

    def __init__(self, trajectory: Trajectory, now_s: float, tolerance: ToleranceSettings | None = None) -> None:
        self.trajectory = trajectory
        self._tolerance = tolerance or ToleranceSettings()
        self._stops_s = [*trajectory.stops_s, math.inf]
        self._stopped_since_s: float | None = None
        self._updated_s = now_s
        self._time = TimeScaling(trajectory)
        self._sent = self._time.motion, setpoint_of(self._time.motion)
        """The newest motion that was sent, and its setpoint: a hold is the same one repeatedly."""
        self._posed: tuple[Motion | None, Pose | None] = (None, None)
        """The newest motion whose pose was requested, and that pose. While it holds, the motion stays the same."""
        self.is_stopping = False
        """Whether it comes to rest on the trajectory as soon as the limits allow."""

    @property
    def time_s(self) -> float:
        """The time on the trajectory."""
        return self._time.time_s

    @property
    def passed_s(self) -> float:
        """The time on the trajectory, with what has passed of a hold."""
        return self._time.time_s

    @property
    def is_waiting(self) -> bool:
        """Whether it waits at a stop until the UAV stands there."""
        return self._stopped_since_s is not None

    @property
    def is_finished(self) -> bool:
        """Whether the reference has come to the end; the UAV may still be on its way."""
        return self.time_s >= self.trajectory.duration_s

    def move(self, offset: Vector3, yaw_rad: float) -> None:
        """Moves the trajectory, and turns its headings, as the estimate has jumped."""
        self.trajectory = moved = Moved(self.trajectory, offset, yaw_rad)
        self._time.move_to(moved)

    @override
    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        passed_s = min(max(0.0, snapshot.time_s - self._updated_s), _LONGEST_UPDATE_STEP_S)
        self._updated_s = snapshot.time_s
        self._advance(passed_s, snapshot)
        motion = self._time.motion
        if motion is not self._sent[0]:
            self._sent = motion, setpoint_of(motion)
        return self._sent[1]

    def _advance(self, passed_s: float, snapshot: Snapshot) -> None:
        """Advances the time on the trajectory, but not beyond a stop before the UAV has stopped there."""
        if self._stopped_since_s is not None:
            if not (self._has_stopped(snapshot) or snapshot.time_s - self._stopped_since_s > LONGEST_STOP_S):
                return
            self._stopped_since_s = None
            self._stops_s.pop(0)
        self._time.advance(passed_s, self._stops_s[0], self._wanted_scale(snapshot))
        if self.time_s == self._stops_s[0]:
            self._stopped_since_s = snapshot.time_s

    def _has_stopped(self, snapshot: Snapshot) -> bool:
        measured = measured_motion(snapshot)
        return (
            measured.velocity.norm() <= self._tolerance.speed_m_s
            and (measured.position - self._time.motion.position).norm() <= self._tolerance.position_m
        )

    def _wanted_scale(self, snapshot: Snapshot) -> float:
        """Returns the wanted time scale: 1 while the UAV is close, 0 where it is too far off, else in between."""
        if snapshot.motion.pose is None or self.is_stopping:
            return 0.0
        motion, here = self._time.motion, snapshot.motion.pose.value.position
        there, v = motion.position, motion.velocity  # in plain numbers, as each update calls it
        lag_m = math.hypot(there.x - here.x, there.y - here.y, there.z - here.z)
        if lag_m <= _FREE_LAG_M:  # nearly always
            return 1.0
        free_m = _FREE_LAG_M + _FREE_LAG_S * math.hypot(v.x, v.y, v.z)
        return max(0.0, min(1.0, 1.0 - (lag_m - free_m) / _LONGEST_LAG_M))

    @override
    def motion(self, snapshot: Snapshot) -> Motion:
        return self._time.motion

    @override
    def motion_time_s(self, snapshot: Snapshot) -> float:
        return self._updated_s

    @override
    def pose(self) -> Pose | None:
        motion = self._time.motion
        known_for, pose = self._posed
        if known_for is not motion:
            pose = pose_of(motion)
            self._posed = (motion, pose)
        return pose


class StopOnTrajectory(Reference):
    """Comes to rest on a trajectory that is followed already, as long as there is no room to brake straight ahead."""

    def __init__(
        self,
        following: TrajectoryReference,
        straight_stop: Callable[[Motion, Snapshot], TrajectoryReference | None],
    ) -> None:
        """`straight_stop` returns the reference that brakes straight ahead from a motion; None if it is not allowed."""
        self._following = following
        self._straight_stop = straight_stop
        self._brake: TrajectoryReference | None = None
        self._has_begun = False

    @property
    def followed(self) -> TrajectoryReference:
        """The trajectory that is followed now: the one on which it comes to rest, or straight ahead."""
        return self._brake or self._following

    @override
    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        if self._brake is not None:
            return self._brake.setpoint(snapshot)
        if not self._has_begun:
            # The first call may come from another thread while the update thread still steps `_following`. Only the
            # update thread may advance its time.
            self._has_begun = True
            return setpoint_of(self._following.motion(snapshot))
        self._following.is_stopping = True
        setpoint = self._following.setpoint(snapshot)
        self._brake = self._straight_stop(self._following.motion(snapshot), snapshot)
        return setpoint

    @override
    def motion(self, snapshot: Snapshot) -> Motion:
        return self.followed.motion(snapshot)

    @override
    def motion_time_s(self, snapshot: Snapshot) -> float:
        return self.followed.motion_time_s(snapshot)

    @override
    def pose(self) -> Pose | None:
        return self.followed.pose()


def setpoint_of(motion: Motion) -> PositionSetpoint:
    """Returns the setpoint that commands a motion."""
    return PositionSetpoint(
        motion.position, motion.yaw_rad, motion.velocity, motion.acceleration, motion.yaw_rate_rad_s
    )


def pose_of(motion: Motion) -> Pose:
    """Returns the pose in a motion: its position, level, with its heading."""
    return Pose(motion.position, Quaternion.from_yaw(motion.yaw_rad))


def measured_motion(snapshot: Snapshot) -> Motion:
    """Returns the motion of the UAV as the autopilot measures it.

    Raises:
        WrongStateError: It is not known where the UAV is.

    """
    return motion_of(snapshot.motion)


def motion_of(measured: MotionState) -> Motion:
    """Returns the same; see `measured_motion`, also for what is raised."""
    if measured.pose is None:
        raise unknown_position()
    pose = measured.pose.value
    if measured.velocity is None:
        return Motion(pose.position, pose.yaw_rad)
    twist = measured.velocity.value
    return Motion(pose.position, pose.yaw_rad, twist.linear, _ZERO, twist.angular.z)


def unknown_position() -> WrongStateError:
    """Returns the error that it is not known where the UAV is."""
    return WrongStateError("the autopilot has not said where the UAV is (its pose)", {"needed": "pose"})


def brake(
    snapshot: Snapshot, limits: Limits, start: Motion | None = None, start_s: float | None = None
) -> TrajectoryReference:
    """Returns the reference that comes to rest from a motion and holds there.

    `start` is the motion that is commanded, at `start_s` (None: now); None: the measured motion.
    """
    begin_s = snapshot.time_s if start_s is None else start_s
    return TrajectoryReference(Brake(start or measured_motion(snapshot), limits), begin_s)
