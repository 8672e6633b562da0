"""Keeps a UAV that flies a velocity at the place to which this velocity leads.

An autopilot that is given only a velocity controls its estimate of the velocity, which may be wrong by 0.7 m/s for
seconds (decision 21). With "0 m/s" it wanders by metres in a minute. So the commanded velocity leads to a place. The
distance of the UAV from this place becomes a small velocity, which is added to what is sent.

The place begins where the reference before was, with its motion, and then moves as the vehicle can. It answers to the
commanded velocity with the vehicle's own delay, time constant and acceleration. So it is held in all directions from
the first moment, also while the UAV accelerates, brakes or turns (decision 39).

The place goes with the UAV only in a direction in which the UAV cannot follow: where something stops it or carries it
away. It is then not pulled. The direction is held again once the UAV flies there what is commanded. A heading is held
in the same way while no turn is commanded.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from ual.geometry import Twist, Vector3, vector3, wrap_angle
from ual.types import Limits
from ual_daemon.backends.values import Snapshot, VelocityResponse, VelocityResponses
from ual_daemon.tracker.limits import clamped, scaled_down
from ual_daemon.tracker.velocity_end_point import ExpectedMotion, MotionEstimate, VelocityEndPoint
from ual_daemon.tracker.velocity_error import VelocityError
from ual_daemon.trajectory import Motion

_LONGEST_UPDATE_STEP_S = 0.2
"""After a longer pause, the time in between does not count. Nor is a position extrapolated farther."""
_YAW_GAIN = 0.8
"""From a heading error to a yaw rate, 1/s."""
_MOST_YAW_LAG_RAD = 0.3
_NO_TURN_RAD_S = 0.1
"""A UAV that turns no faster has come to rest."""
_RECENT_SNAPSHOTS_COUNT, _SNAPSHOT_PERIOD_S = 25, 0.04
"""Updates before a velocity begins from which the error of the estimated velocity is known at once, and their
interval.
"""

Before = Callable[[Snapshot], "Motion | None"]
"""Returns the motion of the reference before; None where the UAV is not near it."""


class DriftCorrection:
    """Computes what is to be added to a commanded velocity.

    The update thread calls `stand_by`, `step` and `forget`; any thread reads `velocity` and `yaw_rate_rad_s`.
    """

    def __init__(self) -> None:
        self.velocity = Vector3()
        """Velocity to add now, along the local axes."""
        self.yaw_rate_rad_s = 0.0
        """Yaw rate to add now."""
        self._end_points: tuple[VelocityEndPoint, VelocityEndPoint] | None = None
        self._yaw_rad: float | None = None
        self._before: Before | None = None
        self._recent: deque[Snapshot] = deque(maxlen=_RECENT_SNAPSHOTS_COUNT)
        self._stepped_s = 0.0
        self._error = VelocityError()

    def forget(self) -> None:
        """Forgets the place and what was before: the next velocity begins where the UAV is then."""
        self._leave()
        self._before = None
        self._recent.clear()

    def stand_by(self, before: Before, snapshot: Snapshot) -> None:
        """Takes note of what is flown instead of a velocity: the place of the next velocity begins with its motion.

        Called at each update, so it computes nothing.
        """
        if self._end_points is not None:
            self._leave()
        self._before, self._stepped_s = before, snapshot.time_s
        if not self._recent or snapshot.time_s - self._recent[-1].time_s >= _SNAPSHOT_PERIOD_S:
            self._recent.append(snapshot)

    def _leave(self) -> None:
        self.velocity, self._end_points = Vector3(), None
        self.yaw_rate_rad_s, self._yaw_rad = 0.0, None

    def step(self, commanded: Twist, snapshot: Snapshot, limits: Limits, responses: VelocityResponses) -> None:
        """Makes one update while a velocity is commanded. It is along the local axes, and within the limits."""
        if snapshot.motion.pose is None or snapshot.motion.velocity is None:
            self.forget()
            return
        horizontal, vertical = self._end_points = self._end_points or self._begin(snapshot, responses)
        passed_s = _passed_s(self._stepped_s, snapshot.time_s)
        self._stepped_s = snapshot.time_s
        measured, command = self._see(snapshot, snapshot.motion.velocity.value.linear), commanded.linear
        p, v, error = measured
        level = MotionEstimate(_level(p), _level(v), _level(error))
        upright = MotionEstimate(_upright(p), _upright(v), _upright(error))
        along = horizontal.step(_level(command), level, passed_s, responses.horizontal)
        up = vertical.step(_upright(command), upright, passed_s, responses.vertical)
        wanted = vector3(command.x + along.x, command.y + along.y, command.z + up.z)
        self.velocity = scaled_down(Twist(wanted), limits).linear - command
        self._step_heading(commanded.angular.z, snapshot)

    def _see(self, snapshot: Snapshot, velocity: Vector3) -> MotionEstimate:
        here = _position(snapshot)
        return MotionEstimate(here, velocity, self._error.step(snapshot.time_s, here, velocity))

    def _begin(self, snapshot: Snapshot, responses: VelocityResponses) -> tuple[VelocityEndPoint, VelocityEndPoint]:
        """Returns the places of a velocity that begins: with the motion before, or else with the measured one."""
        before = None if self._before is None else self._before(snapshot)
        self._yaw_rad = None if before is None else _held_yaw_rad(before, snapshot)
        self._error = VelocityError()
        for each in (*self._recent, snapshot):
            if each.motion.pose is not None and each.motion.velocity is not None:
                measured = self._see(each, each.motion.velocity.value.linear)
        before = before or Motion(measured.position, 0.0, measured.velocity - measured.error)
        return _end_point(_level, before, responses.horizontal), _end_point(_upright, before, responses.vertical)

    def _step_heading(self, commanded_rad_s: float, snapshot: Snapshot) -> None:
        assert snapshot.motion.pose is not None
        assert snapshot.motion.velocity is not None
        yaw_rad, measured_rad_s = snapshot.motion.pose.value.yaw_rad, snapshot.motion.velocity.value.angular.z
        if commanded_rad_s != 0.0 or (self._yaw_rad is None and abs(measured_rad_s) > _NO_TURN_RAD_S):
            self._yaw_rad, self.yaw_rate_rad_s = None, 0.0
            return
        wanted_rad = yaw_rad if self._yaw_rad is None else self._yaw_rad
        lag_rad = clamped(wrap_angle(wanted_rad - yaw_rad), _MOST_YAW_LAG_RAD)
        self._yaw_rad, self.yaw_rate_rad_s = yaw_rad + lag_rad, lag_rad * _YAW_GAIN


def _end_point(part: Callable[[Vector3], Vector3], before: Motion, response: VelocityResponse) -> VelocityEndPoint:
    motion = part(before.position), part(before.velocity), part(before.acceleration)
    return VelocityEndPoint(ExpectedMotion(*motion, response))


def _held_yaw_rad(before: Motion, snapshot: Snapshot) -> float | None:
    """Returns the heading that was held before; None if there was none, or if the UAV does not have it."""
    assert snapshot.motion.pose is not None
    is_far = abs(wrap_angle(before.yaw_rad - snapshot.motion.pose.value.yaw_rad)) > _MOST_YAW_LAG_RAD
    return None if is_far or before.yaw_rate_rad_s else before.yaw_rad


def _position(snapshot: Snapshot) -> Vector3:
    """Returns the position now: between two of the autopilot's, the UAV moves on with its velocity."""
    pose, velocity = snapshot.motion.pose, snapshot.motion.velocity
    assert pose is not None
    assert velocity is not None
    p, v, passed_s = pose.value.position, velocity.value.linear, _passed_s(pose.time_s, snapshot.time_s)
    return vector3(p.x + v.x * passed_s, p.y + v.y * passed_s, p.z + v.z * passed_s)


def _passed_s(since_s: float, now_s: float) -> float:
    return min(max(0.0, now_s - since_s), _LONGEST_UPDATE_STEP_S)


def _level(vector: Vector3) -> Vector3:
    return vector3(vector.x, vector.y, 0.0)


def _upright(vector: Vector3) -> Vector3:
    return vector3(0.0, 0.0, vector.z)
