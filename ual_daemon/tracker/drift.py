"""Keeps a UAV that flies a velocity at the place to which this velocity leads.

An autopilot that is given only a velocity controls its estimate of the velocity, which may be wrong by 0.7 m/s for
seconds (decision 21): with "0 m/s" it wanders by metres in a minute. So the commanded velocity is integrated to a
place. The distance of the UAV from this place becomes a small velocity, which is added to what is sent.

The place goes with the UAV in each direction in which it does not fly what is commanded: while it accelerates and
brakes, so that it takes its place where it comes to rest, and while something stops it or carries it away, so that it
is not pulled. In all other directions the place stays: a UAV that brakes goes on holding its line and its height. A
heading is held in the same way while no turn is commanded.
"""

from __future__ import annotations

import math

from ual.geometry import Twist, Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.backends.values import Snapshot
from ual_daemon.tracker.limits import clamped, scaled_down

MOST_LAG_M = 1.0
"""The place is never farther from the UAV than this, horizontally and vertically."""
MOST_CORRECTION_M_S = 1.2
"""The most that is added, horizontally and vertically: twice what the estimate was seen to be wrong by."""
MOST_CHANGE_M_S2 = 2.0
"""What is added never changes faster, so that it does not jump."""
_POSITION_GAIN = 0.9
"""From a distance to a velocity, 1/s; PX4's own is 0.95 (MPC_XY_P), ArduPilot's 1 (PSC_POSXY_P)."""
_SMOOTHING_S = 0.3
_MOST_VELOCITY_ERROR_M_S = 0.7
_FLOWN_M_S = 0.1
"""The commanded velocity counts as reached within this."""
_LOST_M_S = 1.0
"""A UAV whose velocity is this far from the commanded one does not follow it."""
_LEAST_LOST_M_S = 0.25
"""A UAV that lacks half of the commanded speed does not follow it either, if that half is more than this."""
_LONGEST_STEP_S = 0.2
"""After a longer pause, the time in between does not count."""
_YAW_GAIN = 0.8
"""From a heading error to a yaw rate, 1/s."""
_MOST_YAW_LAG_RAD = 0.3
_NO_TURN_RAD_S = 0.1
"""A UAV that turns no faster has come to rest."""


_LEVEL_AXES = (Vector3(1.0, 0.0, 0.0), Vector3(0.0, 1.0, 0.0))
_UPRIGHT_AXES = (Vector3(0.0, 0.0, 1.0),)


class DriftCorrection:
    """Computes what is to be added to a commanded velocity.

    The update thread calls `step` and `forget`; any thread reads `velocity` and `yaw_rate_rad_s`.
    """

    def __init__(self) -> None:
        self.velocity = Vector3()
        """What is to be added to the velocity now, along the local axes."""
        self.yaw_rate_rad_s = 0.0
        """What is to be added to the yaw rate now."""
        self._horizontal: _Place | None = None
        self._vertical: _Place | None = None
        self._yaw_rad: float | None = None
        self._stepped_s = 0.0

    def forget(self) -> None:
        """Forgets the place: the next velocity begins where the UAV is then."""
        self.velocity, self._horizontal, self._vertical = Vector3(), None, None
        self.yaw_rate_rad_s, self._yaw_rad = 0.0, None

    def step(self, commanded: Twist, snapshot: Snapshot, limits: Limits) -> None:
        """Makes one update while a velocity is commanded. It is along the local axes, and within the limits."""
        if snapshot.pose is None or snapshot.velocity is None:
            self.forget()
            return
        pose, measured = snapshot.pose.value, snapshot.velocity.value
        passed_s = min(max(0.0, snapshot.time_s - self._stepped_s), _LONGEST_STEP_S)
        self._stepped_s = snapshot.time_s
        self._step_place(commanded.linear, pose.position, measured.linear, passed_s, limits)
        self._step_heading(commanded.angular.z, pose.yaw_rad, measured.angular.z)

    def _step_place(
        self, commanded: Vector3, here: Vector3, measured: Vector3, passed_s: float, limits: Limits
    ) -> None:
        horizontal = self._horizontal = self._horizontal or _Place(_level(here), _level(commanded), _LEVEL_AXES)
        vertical = self._vertical = self._vertical or _Place(_upright(here), _upright(commanded), _UPRIGHT_AXES)
        most_m_s = limits.horizontal_acceleration_m_s2 * passed_s
        horizontal.step(_level(commanded), _level(here), _level(measured), passed_s, most_m_s)
        most_m_s = limits.vertical_acceleration_m_s2 * passed_s
        vertical.step(_upright(commanded), _upright(here), _upright(measured), passed_s, most_m_s)
        wanted = commanded + horizontal.correction + vertical.correction
        self.velocity = scaled_down(Twist(wanted), limits).linear - commanded

    def _step_heading(self, commanded_rad_s: float, yaw_rad: float, measured_rad_s: float) -> None:
        if commanded_rad_s != 0.0 or (self._yaw_rad is None and abs(measured_rad_s) > _NO_TURN_RAD_S):
            self._yaw_rad, self.yaw_rate_rad_s = None, 0.0
            return
        wanted_rad = yaw_rad if self._yaw_rad is None else self._yaw_rad
        lag_rad = clamped(wrap_angle(wanted_rad - yaw_rad), _MOST_YAW_LAG_RAD)
        self._yaw_rad, self.yaw_rate_rad_s = yaw_rad + lag_rad, lag_rad * _YAW_GAIN


class _VelocityError:
    """The estimated velocity minus the velocity of the estimated position, both through the same low pass.

    They differ where an estimator corrects its position: the autopilot then flies a velocity that is not the one of its
    own position. Learned from the estimates alone, so adding it to a command closes no loop.
    """

    def __init__(self) -> None:
        self._smooth: tuple[Vector3, Vector3] | None = None
        """The position and the velocity through the low pass."""

    def step(self, position: Vector3, velocity: Vector3, passed_s: float) -> Vector3:
        """Makes one update. Returns the error, m/s."""
        old_position, old_velocity = self._smooth or (position - velocity * _SMOOTHING_S, velocity)
        share = 1.0 - math.exp(-passed_s / _SMOOTHING_S)
        smooth_position = old_position + (position - old_position) * share
        smooth_velocity = old_velocity + (velocity - old_velocity) * share
        self._smooth = (smooth_position, smooth_velocity)
        # The lag of a low pass behind its input, over its time constant, is the derivative through the same low pass.
        return _at_most(smooth_velocity - (position - smooth_position) / _SMOOTHING_S, _MOST_VELOCITY_ERROR_M_S)


class _Place:
    """The place in some of the axes: the horizontal ones, or the vertical one. Vectors are zero along the others."""

    def __init__(self, here: Vector3, commanded: Vector3, axes: tuple[Vector3, ...]) -> None:
        self.correction = Vector3()
        self._place, self._commanded = here, commanded
        self._error = _VelocityError()
        self._free = axes
        """The directions in which the place goes with the UAV; of length 1, at right angles to each other."""

    def step(self, commanded: Vector3, here: Vector3, velocity: Vector3, passed_s: float, possible_m_s: float) -> None:
        """Makes one update. `possible_m_s` is by how much a velocity can change between two updates."""
        self._find_free(commanded, velocity, possible_m_s)
        self._place += (self._commanded + commanded) * (passed_s / 2)
        self._commanded = commanded
        lag = _at_most(self._held(self._place - here), MOST_LAG_M)
        self._place = here + lag
        error = self._held(self._error.step(here, velocity, passed_s))
        wanted = _at_most(lag * _POSITION_GAIN + error, MOST_CORRECTION_M_S)
        self.correction += _at_most(wanted - self.correction, MOST_CHANGE_M_S2 * passed_s)

    def _find_free(self, commanded: Vector3, velocity: Vector3, possible_m_s: float) -> None:
        """Finds the directions in which the UAV does not fly what is commanded."""
        missing = commanded + self.correction - velocity
        if (missing - self._held(missing)).norm() <= _FLOWN_M_S:
            self._free = ()
        change = commanded - self._commanded
        if change.norm() > possible_m_s:
            self._make_free(change)
        missing = self._held(missing)
        if missing.norm() > _LOST_M_S:
            self._make_free(missing)
        speed_m_s = commanded.norm()
        if speed_m_s > 0.0 and missing.dot(commanded) / speed_m_s > max(_LEAST_LOST_M_S, speed_m_s / 2):
            self._make_free(commanded)

    def _make_free(self, along: Vector3) -> None:
        rest = self._held(along)
        rest_m_s = rest.norm()
        if rest_m_s > _FLOWN_M_S / 2:
            self._free = (*self._free, rest / rest_m_s)

    def _held(self, vector: Vector3) -> Vector3:
        """Returns the part of a vector in the directions in which the place stays."""
        for direction in self._free:
            vector -= direction * vector.dot(direction)
        return vector


def _level(vector: Vector3) -> Vector3:
    return Vector3(vector.x, vector.y, 0.0)


def _upright(vector: Vector3) -> Vector3:
    return Vector3(0.0, 0.0, vector.z)


def _at_most(vector: Vector3, length: float) -> Vector3:
    """Returns the vector, or one of this length in its direction."""
    own = vector.norm()
    return vector if own <= length else vector * (length / own)
