"""The velocities that a stream may go on with, without each being assessed by every rule again.

What bounds a motion is folded into one value: a ball around a place that lies inside every bound, and the limits. It is
made when a setpoint asks, and holds as long as everything that it was made from is the same. A velocity within it is
one that the rules would admit; they judge any other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ual.errors import UalError
from ual.geometry import Twist, Vector3
from ual.types import Capability, Limits
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Snapshot, VehicleInfo
from ual_daemon.flight.policy.geofence import FenceInputs, GeofencePolicy
from ual_daemon.flight.policy.reachable_points import REACTION_S
from ual_daemon.flight.state import is_surely_auto
from ual_daemon.frames.room import ROUNDING_MARGIN_M
from ual_daemon.settings import MAX_TURN_RAD_S
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.trajectory.envelope import RAMP_S
from ual_daemon.validation import MAX_SPEED_M_S

_SPEED_ROUNDING_RATIO = 1e-12
_UNSHORTENED_SETPOINTS_COUNT = 3
"""Setpoints that are assessed by the rules without the shortcut, where there is no room: most near an edge are."""
_SAME_POSITION_M2 = 0.1**2
"""Squared distance from a ball that was too small within which no other one is searched: each setpoint would pay."""
_REACTION_PATH_S = REACTION_S + RAMP_S / 2.0
"""Seconds for which a speed is flown on, whatever the brakes. With `brake_s2_m` it bounds `stopping_s` from above, as
(q + RAMP_S) / 2 is never less than sqrt(q * RAMP_S).
"""


@dataclass(slots=True)
class _Clearance:
    """Clearance that is valid while `info` and `world` are the same. Never changed: slots are read faster than a
    tuple's names.

    Attributes:
        info, world: All that it was made from, besides the position.
        level2: The square of the horizontal speed within the limits; no velocity is below 0.
        climb_m_s, sink_m_s, turn_rad_s: The limits.
        brake_s2_m: Half the inverse of the least acceleration.
        x, y, z, radius_m: The ball, in the local frame.
        rooms: The parts of the fence that were known when it was made.
    """

    info: VehicleInfo
    world: FenceInputs
    level2: float = -1.0
    climb_m_s: float = 0.0
    sink_m_s: float = 0.0
    turn_rad_s: float = 0.0
    brake_s2_m: float = 0.0
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    radius_m: float = -1.0
    rooms: object = None


class Clearance:
    """The clearance of one UAV. Any thread may call."""

    def __init__(self, backend: Backend, limits: CurrentLimits, geofence: GeofencePolicy) -> None:
        self._backend = backend
        self._limits = limits
        self._geofence = geofence
        self.rests_count = 0
        """Setpoints that need no test of the clearance."""
        self._now = _Clearance(VehicleInfo(), FenceInputs(*(None,) * 7))

    def admits(self, twist: Twist, snapshot: Snapshot, now_s: float) -> bool:
        """Returns whether a velocity along the axes of ``<ns>/odom`` surely may be flown now, as it is.

        Written out, as each setpoint of a stream asks.
        """
        v, w, motion = twist.linear, twist.angular, snapshot.motion
        pose = motion.pose
        if v.__class__ is not Vector3 or w.__class__ is not Vector3 or pose is None:
            return False
        x, y, z, turn = v.x, v.y, v.z, w.z
        if not (x.__class__ is y.__class__ is z.__class__ is turn.__class__ is float and w.x == w.y == 0.0):
            return False
        backend, now = self._backend, self._now
        if not is_surely_auto(snapshot, now_s, backend.freshness):
            return False
        info = backend.info()
        if now.info is not info or not self._geofence.holds(now.world, snapshot):
            now = self._now = self._made(info, snapshot)
        level2, turn_rad_s = x * x + y * y, now.turn_rad_s
        if not (level2 <= now.level2 and -now.sink_m_s <= z <= now.climb_m_s and -turn_rad_s <= turn <= turn_rad_s):
            return False
        speed2, here, own = level2 + z * z, pose.value.position, motion.velocity
        if own is not None:
            u = own.value.linear
            own2 = u.x * u.x + u.y * u.y + u.z * u.z
            if not own2 <= speed2:
                speed2 = own2
        speed_m_s = math.sqrt(speed2)
        # All points of `reachable_points` lie within this distance of where it is.
        reach_m = speed_m_s * (_REACTION_PATH_S + speed_m_s * now.brake_s2_m)
        left_m, off_x, off_y, off_z = now.radius_m - reach_m, here.x - now.x, here.y - now.y, here.z - now.z
        off2 = off_x * off_x + off_y * off_y + off_z * off_z
        if left_m >= 0.0 and off2 <= left_m * left_m:
            return True
        if off2 >= _SAME_POSITION_M2 or now.rooms is not self._geofence.rooms:
            now = self._now = self._made(info, snapshot)  # there may be room here, too
            if reach_m <= now.radius_m:
                return True
        self.rests_count = _UNSHORTENED_SETPOINTS_COUNT
        return False

    def _made(self, info: VehicleInfo, snapshot: Snapshot) -> _Clearance:
        """Returns the clearance where the UAV is; one that admits nothing where it is not sure."""
        world = self._geofence.world(snapshot)  # first: what changes meanwhile is found by the next setpoint
        limits = self._limits.get()
        if Capability.VELOCITY not in info.capabilities or not _are_usual(limits):
            return _Clearance(info, world)
        try:
            radius_m = self._geofence.surely_inside_m(snapshot)
        except UalError:  # it is not known where the fence, or odom, is: each setpoint is told so
            return _Clearance(info, world)
        assert snapshot.motion.pose is not None
        here = snapshot.motion.pose.value.position
        return _Clearance(
            info,
            world,
            (limits.horizontal_speed_m_s * (1.0 - _SPEED_ROUNDING_RATIO)) ** 2,
            limits.climb_speed_m_s,
            limits.descent_speed_m_s,
            min(limits.yaw_rate_rad_s, MAX_TURN_RAD_S),
            0.5 / min(limits.horizontal_acceleration_m_s2, limits.vertical_acceleration_m_s2),
            here.x,
            here.y,
            here.z,
            radius_m - ROUNDING_MARGIN_M,
            self._geofence.rooms,
        )


def _are_usual(limits: Limits) -> bool:
    """Returns whether no velocity within them is out of range, and none is zero."""
    upright_m_s = max(limits.climb_speed_m_s, limits.descent_speed_m_s)
    accelerations = limits.horizontal_acceleration_m_s2, limits.vertical_acceleration_m_s2
    return math.hypot(limits.horizontal_speed_m_s, upright_m_s) <= MAX_SPEED_M_S and min(accelerations) > 0.0
