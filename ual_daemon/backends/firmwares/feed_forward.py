"""Adds to position setpoints what the autopilot could otherwise only correct by being off them.

Two things are learned in flight, and added to each position setpoint:

- **Drag.** PX4's controllers do not model it. In steady flight they compensate it by a position error, larger
  horizontally than vertically, so that the line is bent. They also compensate it by an integral, which then carries the
  UAV beyond its goal. The linear drag of a multirotor is the part of its acceleration that its tilt does not explain
  and that grows with its speed. See Faessler et al., "Differential Flatness of Quadrotor Dynamics Subject to Rotor
  Drag", RA-L 2018. The part that does not grow with its speed (wind, a tilted level) is left to the integral.
- **The error of the velocity.** The position and the velocity of an estimator do not always agree: after an
  acceleration PX4's position moves by up to 0.5 m/s otherwise than its velocity says, for seconds. PX4 controls its
  velocity, and its position error grows until it makes up for the difference.

In addition, the acceleration leads by as long as the vehicle takes to tilt.

A velocity setpoint becomes the velocity that is flown by now and the acceleration towards the commanded one, as PX4's
own answer winds up its integral (decision 44).
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, NamedTuple, overload

from msgspec import Meta

from ual.geometry import Pose, Vector3, vector3
from ual_daemon import logs
from ual_daemon.backends.values import PositionSetpoint, Setpoint, VelocitySetpoint

_log = logging.getLogger(__name__)

GRAVITY_M_S2 = 9.81
MOST_DRAG_1_S = 1.5
"""A limit of what is learned: light vehicles have 0.1 to 0.5 1/s, PX4's simulator 1 (SIH_KDV / SIH_MASS)."""
MOST_VELOCITY_ERROR_M_S = 0.7
TILT_S = 0.2
"""The time from a setpoint to the tilt that it requires, the link included."""
MOST_LEAD_M_S2 = 1.5
"""The limit of the lead: an acceleration that jumps must not become a kick."""
_LEAD_SMOOTHING_S = 0.06
_PULL_SMOOTHING_S = 0.5
_LONGEST_SAMPLE_GAP_S = 0.3
_DRAG_MEMORY_S = 60.0
_LEAST_SPEED_M_S = 1.0
"""At lower speeds nothing is learned about drag, and nothing forgotten."""
_JUMP_M = 0.5
"""A position that moves farther than its velocity says, between two of them, has jumped."""
_PRIOR_M2_S = 1.0
"""The variance of the velocity (m^2/s^2 times seconds) at which half of the measured drag is used: with less of it the
estimate stays close to what was expected."""
_DRAG_VARIANCE_M2_S = 10.0
"""The variance from which on the drag is worth to be reported."""
_DRAG_NEWS_1_S = 0.1
VELOCITY_GAINS = {"MPC_XY_VEL_P_ACC": 1.8, "MPC_XY_VEL_D_ACC": 0.2}
"""The gains by which PX4 follows a horizontal velocity, as they are shipped."""
(_P_NAME, _P), (_D_NAME, _D) = VELOCITY_GAINS.items()
_MOST_M_S2 = GRAVITY_M_S2
"""No velocity requests more: it is a tilt of 45 degrees."""
_LEAST_TILT_COSINE = 0.5
"""The cosine of the tilt beyond which it does not fly as a multirotor does."""
_UNREAD: Mapping[str, float] = MappingProxyType({})

Drag = Annotated[float, Meta(ge=0.0, le=MOST_DRAG_1_S)]
"""The setting of a backend: the drag to begin with, 1/s."""


class _Smooth(NamedTuple):
    """All values through the same low pass, so that they still belong together."""

    time_s: float
    velocity: tuple[float, float, float]
    pull: tuple[float, float]
    """The horizontal acceleration caused by the thrust, from the tilt."""
    error: tuple[float, float, float]
    """The estimated velocity minus the velocity of the estimated position."""
    newest: tuple[Vector3, Vector3]
    """The position and the velocity as they came."""


class FeedForward:
    """Learns from the pose and the velocity of one vehicle in its local frame (x east, y north, z up).

    `expected_drag_1_s` counts until its drag is learned. What is learned is logged (``drag_learned``). `learn` belongs
    to the thread that receives; `apply` is for any.
    """

    def __init__(self, expected_drag_1_s: float = 0.0, parameters: Mapping[str, float] = _UNREAD) -> None:
        """`parameters` are those read so far, and may grow: the defaults of `VELOCITY_GAINS` count until then."""
        self._parameters = parameters
        self._smooth: _Smooth | None = None
        self._sums = _Sums(expected_drag_1_s)
        self.drag_1_s = self._reported_1_s = expected_drag_1_s
        """Deceleration by drag for each m/s."""
        self.velocity_error = Vector3()
        """The estimated velocity minus the velocity of the estimated position, m/s."""
        self._last: tuple[float, Vector3] | None = None
        """Time of the last setpoint, and the low-pass filtered accelerations until then."""
        self._velocity = (0.0, 0.0, 0.0)
        """Time of the last setpoint, and the horizontal velocity that is flown then: it follows a commanded one
        later.
        """

    def learn(self, time_s: float, pose: Pose, velocity: Vector3) -> None:
        """Takes a new pose and its velocity. `time_s` is the autopilot's own time."""
        old, q = self._smooth, pose.orientation
        passed_s = math.inf if old is None else time_s - old.time_s
        is_continued = (
            old is not None and 0.0 <= passed_s <= _LONGEST_SAMPLE_GAP_S and not _jumps(old, pose, velocity, passed_s)
        )
        upright = 1.0 - 2.0 * (q.x * q.x + q.y * q.y)  # the vertical part of the body's upward axis
        if old is None or not is_continued or upright < _LEAST_TILT_COSINE:
            self._smooth = _Smooth(
                time_s, (velocity.x, velocity.y, velocity.z), (0.0, 0.0), (0.0, 0.0, 0.0), (pose.position, velocity)
            )
            self.velocity_error = Vector3()
            return
        # In plain numbers, as each sample passes here.
        share, (vx, vy, vz), (px, py) = 1.0 - math.exp(-passed_s / _PULL_SMOOTHING_S), old.velocity, old.pull
        factor = (GRAVITY_M_S2 + (velocity.z - vz) / _PULL_SMOOTHING_S) / upright
        pull_x, pull_y = 2.0 * (q.x * q.z + q.w * q.y) * factor, 2.0 * (q.y * q.z - q.w * q.x) * factor
        vx, vy, vz = vx + (velocity.x - vx) * share, vy + (velocity.y - vy) * share, vz + (velocity.z - vz) * share
        px, py = px + (pull_x - px) * share, py + (pull_y - py) * share
        error = x, y, z = _error(old, pose.position, velocity, passed_s, share)
        self._smooth = _Smooth(time_s, (vx, vy, vz), (px, py), error, (pose.position, velocity))
        kept = min(1.0, MOST_VELOCITY_ERROR_M_S / max(math.hypot(x, y, z), 1e-9))
        self.velocity_error = vector3(x * kept, y * kept, z * kept)
        if math.hypot(vx, vy) > _LEAST_SPEED_M_S:
            smooth = vector3(vx, vy, vz)
            self._sums.add(smooth, vector3(px, py, 0.0) - (velocity - smooth) / _PULL_SMOOTHING_S, passed_s)
            self.drag_1_s = max(0.0, min(MOST_DRAG_1_S, self._sums.slope()))
            self._tell()

    def _tell(self) -> None:
        if abs(self.drag_1_s - self._reported_1_s) > _DRAG_NEWS_1_S and self._sums.variance() > _DRAG_VARIANCE_M2_S:
            self._reported_1_s = self.drag_1_s
            logs.event(_log, logging.INFO, "drag_learned", drag_1_s=round(self.drag_1_s, 2))

    @overload
    def apply(self, setpoint: PositionSetpoint, now_s: float) -> PositionSetpoint: ...

    @overload
    def apply(self, setpoint: VelocitySetpoint, now_s: float) -> VelocitySetpoint: ...

    def apply(self, setpoint: Setpoint, now_s: float) -> Setpoint:
        """Returns the setpoint with what was learned. In plain numbers, as each setpoint passes here."""
        if isinstance(setpoint, VelocitySetpoint):
            v = setpoint.velocity
            x, y, ax, ay = self.answered(v.x, v.y, now_s)
            return VelocitySetpoint(vector3(x, y, v.z), setpoint.yaw_rate_rad_s, vector3(ax, ay, 0.0))
        v, a, error, drag_1_s = setpoint.velocity, setpoint.acceleration, self.velocity_error, self.drag_1_s
        self._velocity = (now_s, v.x, v.y)
        acceleration = self._leading(vector3(a.x + v.x * drag_1_s, a.y + v.y * drag_1_s, a.z), now_s)
        velocity = vector3(v.x + error.x, v.y + error.y, v.z + error.z)
        return PositionSetpoint(setpoint.position, setpoint.yaw_rad, velocity, acceleration, setpoint.yaw_rate_rad_s)

    def answered(self, vx: float, vy: float, now_s: float) -> tuple[float, float, float, float]:
        """Returns the horizontal velocity that is flown by now, and the acceleration towards the commanded one.

        PX4 itself accelerates by P (commanded - v) - D a, which is the same. But all of that is then an error to it,
        which its integral adds up: after a stop from 5 m/s it would come to rest 0.6 m too early.
        """
        parameters = self._parameters
        gain_1_s = parameters.get(_P_NAME) or _P
        time_s = (1.0 + parameters.get(_D_NAME, _D)) / gain_1_s
        (old_s, x, y), drag_1_s, most_m_s = self._velocity, self.drag_1_s, _MOST_M_S2 / gain_1_s
        share = 1.0 - math.exp((old_s - now_s) / time_s) if now_s > old_s else 0.0
        dx, dy, most2 = vx - x, vy - y, most_m_s * most_m_s
        if (off2 := dx * dx + dy * dy) > most2:
            share *= math.sqrt(most2 / off2)
        x, y = x + dx * share, y + dy * share
        self._velocity = (now_s, x, y)
        dx, dy = vx - x, vy - y
        if (off2 := dx * dx + dy * dy) > most2:
            gain_1_s *= math.sqrt(most2 / off2)
        return x, y, dx * gain_1_s + x * drag_1_s, dy * gain_1_s + y * drag_1_s

    def _leading(self, a: Vector3, now_s: float) -> Vector3:
        """Returns the acceleration as it will be by the time the vehicle has tilted."""
        last = self._last
        passed_s = math.inf if last is None else now_s - last[0]
        if last is None or passed_s > _LONGEST_SAMPLE_GAP_S:
            self._last = (now_s, a)
            return a
        s, share = last[1], 1.0 - math.exp(-max(0.0, passed_s) / _LEAD_SMOOTHING_S)
        smooth = vector3(s.x + (a.x - s.x) * share, s.y + (a.y - s.y) * share, s.z + (a.z - s.z) * share)
        self._last = (now_s, smooth)
        factor = TILT_S / _LEAD_SMOOTHING_S
        x, y, z = (a.x - smooth.x) * factor, (a.y - smooth.y) * factor, (a.z - smooth.z) * factor
        kept = min(1.0, MOST_LEAD_M_S2 / max(math.hypot(x, y, z), 1e-9))
        return vector3(a.x + x * kept, a.y + y * kept, a.z + z * kept)


def _jumps(old: _Smooth, pose: Pose, velocity: Vector3, passed_s: float) -> bool:
    """Returns whether the estimate was reset: that is no velocity, and must not become one in the setpoints."""
    p, q, v = pose.position, old.newest[0], velocity
    off = (p.x - q.x - v.x * passed_s, p.y - q.y - v.y * passed_s, p.z - q.z - v.z * passed_s)
    return math.hypot(*off) > _JUMP_M


def _error(old: _Smooth, p: Vector3, v: Vector3, passed_s: float, share: float) -> tuple[float, float, float]:
    """Returns the error of the velocity with that since the last position, in plain numbers, as each sample passes."""
    if passed_s <= 0.0:
        return old.error
    (x, y, z), (q, u) = old.error, old.newest
    return (
        x + ((u.x + v.x) / 2 - (p.x - q.x) / passed_s - x) * share,
        y + ((u.y + v.y) / 2 - (p.y - q.y) / passed_s - y) * share,
        z + ((u.z + v.z) / 2 - (p.z - q.z) / passed_s - z) * share,
    )


class _Sums:
    """The least-squares line of horizontal acceleration over velocity, of the last `_DRAG_MEMORY_S`.

    Both axes have one slope; each has its own offset, the constant part (wind). `expected` is the slope before there is
    any.
    """

    def __init__(self, expected: float) -> None:
        self._expected = expected
        self._weight = self._vv = self._va = 0.0
        self._v = self._a = Vector3()

    def add(self, velocity: Vector3, acceleration: Vector3, weight_s: float) -> None:
        """Adds a point, weighted by the time that it stands for."""
        v, a = vector3(velocity.x, velocity.y, 0.0), vector3(acceleration.x, acceleration.y, 0.0)
        keep = math.exp(-weight_s / _DRAG_MEMORY_S)
        self._weight = self._weight * keep + weight_s
        self._v, self._a = self._v * keep + v * weight_s, self._a * keep + a * weight_s
        self._vv = self._vv * keep + v.dot(v) * weight_s
        self._va = self._va * keep + v.dot(a) * weight_s

    def variance(self) -> float:
        """Returns the variance of the velocities, times the time that they stand for."""
        return self._vv - self._v.dot(self._v) / self._weight

    def slope(self) -> float:
        """Returns the slope, drawn toward what was expected while the velocities have varied little."""
        covariance = self._va - self._v.dot(self._a) / self._weight
        return (covariance + self._expected * _PRIOR_M2_S) / (self.variance() + _PRIOR_M2_S)
