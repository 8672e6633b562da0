"""The geofence: a polygon and a height band that no goal, path or velocity may leave. The safety pilot is never fenced.

`ual_daemon.frames.fence.Fence` is the geometry; `Geofence` knows where the configured fence lies in the backend's local
frame, and what is refused.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from ual.errors import GeofenceError, WrongStateError
from ual.geometry import Transform, Vector3
from ual.types import Limits
from ual_daemon.backends.values import Snapshot
from ual_daemon.frames.fence import Fence
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.settings import ConfigError, GeofenceSettings
from ual_daemon.tracker.references import Reference, Velocity, measured_motion
from ual_daemon.trajectory import Brake, Motion, Trajectory, acceleration_limit

_REACTION_S = 0.4
"""How long a UAV goes on before it begins to brake: the age of its data, the way of the setpoint, its time to tilt."""
_PLACE_EVERY_S = 0.1
"""How close places on a trajectory are looked at where it bends, near the edge, ..."""
_MOST_PLACES = 200
"""... unless the bend takes so long that these would be more. (Where it flies straight, its ends are enough.)"""
_SPEED_MARGIN = 2.0
"""A trajectory is taken to be nowhere faster than this many times the limits, and its start."""
_LEVEL = 1e-6
_SAME_PLACE_M = 1e-6


class Geofence:
    """The configured fence, wherever the frame in which it is given lies in the local frame. Any thread may call."""

    def __init__(self, settings: GeofenceSettings, resolver: FrameResolver) -> None:
        """Raises `ConfigError` where the settings make no fence."""
        self._settings = settings
        self._resolver = resolver
        self._frame_id = settings.frame_id or resolver.tree.odom
        corners = settings.polygon or settings.polygon_geo
        if settings.polygon and settings.polygon_geo:
            raise ConfigError("give the polygon either in metres or by latitude and longitude", "geofence.polygon_geo")
        if not corners and settings.min_height_m is None and settings.max_height_m is None:
            raise ConfigError("has neither a polygon nor heights", "geofence")
        if corners and len(corners) < 3:
            key = "geofence.polygon" if settings.polygon else "geofence.polygon_geo"
            raise ConfigError("a polygon has at least three corners", key)
        if not self._lowest_m() < self._highest_m():
            raise ConfigError("is not above min_height_m", "geofence.max_height_m")
        if not resolver.tree.is_fixed(self._frame_id):
            raise ConfigError(f"{self._frame_id} is no fixed frame of the configuration", "geofence.frame_id")
        # In odom it moves with `set_home`, as it is told to. Elsewhere it stays: else any client could walk it away.
        is_carried = resolver.is_moved_by_set_home(self._frame_id) and not resolver.tree.is_below_odom(self._frame_id)
        self._stays_at = resolver.frame_to_local(self._frame_id) if is_carried else None
        Fence(corners)  # refuses a polygon that crosses itself now, not in the air
        self._made: tuple[object, Fence] | None = None

    def _lowest_m(self) -> float:
        return -math.inf if self._settings.min_height_m is None else self._settings.min_height_m

    def _highest_m(self) -> float:
        return math.inf if self._settings.max_height_m is None else self._settings.max_height_m

    def fence(self, snapshot: Snapshot) -> Fence:
        """The fence in the local frame. Raises `WrongStateError` while it is not known where it lies there."""
        if self._settings.polygon_geo and snapshot.projection is None:
            raise WrongStateError("the geofence cannot be checked: the autopilot has not said where on Earth it is")
        to_local = self._stays_at or self._resolver.frame_to_local(self._frame_id)
        key = (to_local.translation, to_local.rotation, snapshot.projection if self._settings.polygon_geo else None)
        made = self._made
        if made is None or made[0] != key:
            made = self._made = (key, self._make(to_local, snapshot))
        return made[1]

    def _make(self, to_local: Transform, snapshot: Snapshot) -> Fence:
        up = to_local.rotation.rotate(Vector3(0.0, 0.0, 1.0))
        if math.hypot(up.x, up.y) > _LEVEL:
            raise WrongStateError(f"the geofence cannot be checked: its frame {self._frame_id} is not level")
        if self._settings.polygon_geo:
            assert snapshot.projection is not None
            places = (snapshot.projection.to_local(lat, lon, 0.0) for lat, lon in self._settings.polygon_geo)
        else:
            places = (to_local.apply(Vector3(x, y, 0.0)) for x, y in self._settings.polygon)
        base_m = to_local.translation.z
        return Fence([(place.x, place.y) for place in places], base_m + self._lowest_m(), base_m + self._highest_m())

    # --- What is refused ----------------------------------------------------------------------------------------------

    def admit(self, what: str, motion: Trajectory | Reference, limits: Limits, snapshot: Snapshot) -> None:
        """Raises `GeofenceError` where a motion that begins now would leave the fence."""
        measured = measured_motion(snapshot)
        if isinstance(motion, Trajectory):
            self.require_goal(motion.end().position, what, snapshot)
            way = _outline(motion, measured.position, self.fence(snapshot), limits)
            self.require_inside(way, what, snapshot)
        elif isinstance(motion, Velocity):
            self.require_velocity(measured, motion.velocity(snapshot), limits, snapshot)
        elif (pose := motion.pose()) is not None:
            self.require_inside([measured.position, pose.position], what, snapshot)

    def is_left_by(self, trajectory: Trajectory, limits: Limits, snapshot: Snapshot) -> bool:
        """Whether a trajectory that begins inside leaves the fence. Raises as `fence`."""
        fence, start = self.fence(snapshot), trajectory.at(0.0).position
        way = _outline(trajectory, start, fence, limits)
        return fence.is_inside(start) and fence.place_of_leaving(way) is not None

    def require_goal(self, goal: Vector3, what: str, snapshot: Snapshot) -> None:
        """Raises `GeofenceError` where a place to end at lies outside."""
        if not self.fence(snapshot).is_inside(goal):
            raise GeofenceError(f"{what}: {self._text(goal)} lies outside the geofence")

    def require_inside(self, way: Iterable[Vector3], what: str, snapshot: Snapshot) -> None:
        """Raises `GeofenceError` where a way (a polyline in the local frame) leaves the fence."""
        left = self.fence(snapshot).place_of_leaving(way)
        if left is not None:
            raise GeofenceError(f"{what}: {self._text(left)} lies outside the geofence, or the way there does")

    def require_velocity(self, motion: Motion, velocity: Vector3, limits: Limits, snapshot: Snapshot) -> None:
        """Raises `GeofenceError` where a UAV that is told a velocity could then no more stop inside the fence: from
        that velocity, from its own, or from one on the way between them.

        Outside, what brings it nearer is allowed; anywhere, what stops it as well as it can be stopped.
        """
        speed = velocity.norm()
        if speed == 0.0:
            return
        fence = self.fence(snapshot)
        here = motion.position
        direction = velocity / speed
        fastest = direction * max(speed, motion.velocity.dot(direction))
        stop = here + fastest * _REACTION_S + _braking(fastest, limits)
        if fence.distance_m(stop) < fence.distance_m(here):  # it comes back
            return
        goes_on = here + motion.velocity * _REACTION_S
        soon, changed_stop = _change(motion, velocity, limits)
        ways = (
            [here, stop],
            [here, goes_on, goes_on + _braking(motion.velocity, limits)],
            [here, soon, changed_stop],
        )
        left = next((place for way in ways if (place := fence.place_of_leaving(way)) is not None), None)
        if left is None:
            return
        _, soonest_stop = _change(motion, Vector3(), limits)
        if fence.outside_m(changed_stop) > fence.outside_m(soonest_stop) + _SAME_PLACE_M:
            raise GeofenceError(f"velocity: it would leave the geofence at about {self._text(left)}")

    def _text(self, local: Vector3) -> str:
        p = self._resolver.frame_to_local(self._resolver.tree.odom).inverse().apply(local)
        return f"{p.x:.1f}, {p.y:.1f}, {p.z:.1f} in {self._resolver.tree.odom}"


def _outline(trajectory: Trajectory, start: Vector3, fence: Fence, limits: Limits) -> Iterator[Vector3]:
    """A polyline from a place along a trajectory that leaves the fence where that does: the ends of its straight parts,
    and places on its bends, close ones near the edge. From a place well inside, the next is as far as the trajectory
    could not get out before. So their number depends on its bends, and not on how long it is or takes.
    """
    vertical_m_s = max(limits.climb_speed_m_s, limits.descent_speed_m_s)
    fastest_m_s = max(math.hypot(limits.horizontal_speed_m_s, vertical_m_s), trajectory.at(0.0).velocity.norm())
    fastest_m_s *= _SPEED_MARGIN
    yield start
    for begin_s, end_s in trajectory.bends_s():
        every_s = max(_PLACE_EVERY_S, (end_s - begin_s) / _MOST_PLACES)
        time_s = begin_s
        while time_s < end_s:
            place = trajectory.at(time_s).position
            yield place
            time_s += max(every_s, fence.clearance_m(place) / fastest_m_s)
        yield trajectory.at(end_s).position
    yield trajectory.end().position


def _change(motion: Motion, velocity: Vector3, limits: Limits) -> tuple[Vector3, Vector3]:
    """Where a UAV that is told a velocity gets to until it can be told to brake, and where it comes to rest then."""
    change = velocity - motion.velocity
    size = change.norm()
    most_m_s = acceleration_limit(change / size, limits) * _REACTION_S if size > 0.0 else 0.0
    changed = motion.velocity + change * (most_m_s / size) if size > most_m_s else velocity
    soon = motion.position + (motion.velocity + changed) * (_REACTION_S / 2)
    return soon, soon + _braking(changed, limits)


def _braking(velocity: Vector3, limits: Limits) -> Vector3:
    """How far it goes while it brakes from a velocity."""
    return Brake(Motion(Vector3(), 0.0, velocity), limits).end().position
