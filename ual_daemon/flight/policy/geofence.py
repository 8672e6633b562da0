"""The geofence: what is refused because it would leave the fence. The safety pilot is never fenced.

`ual_daemon.frames.fence.Fence` is the geometry: an area, a disc and a height band. `GeofencePolicy` knows where the
configured fence lies in the backend's local frame, and which goals, paths and velocities would leave it. The
floor and the ceiling, which hold without any configuration, are edges of the same fence; so is the autopilot's own.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from ual.errors import GeofenceError, WrongStateError
from ual.geometry import Transform, Vector3
from ual.types import Limits
from ual_daemon.backends.values import AutopilotFence, Snapshot
from ual_daemon.flight.policy import autopilot_fence
from ual_daemon.flight.policy.ground import Datum, Ground
from ual_daemon.flight.policy.reachable_points import ReachablePoints, change, reachable_points
from ual_daemon.frames.fence import Exit, Fence
from ual_daemon.frames.odom_metres import FrameInLocal, OdomMetres
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.frames.room import Point3, Room
from ual_daemon.settings import ConfigError, GeofenceSettings, VehicleSettings
from ual_daemon.tracker.moving_goal import MovingGoal
from ual_daemon.tracker.references import Hold, Reference, Velocity, measured_motion
from ual_daemon.trajectory import Trajectory

_POINT_PERIOD_S = 0.1
"""The time between the points that are checked on a bend of a trajectory, near the edge, ..."""
_MAX_POINTS = 200
"""... and most points of a long bend. (Of a straight part, only the ends are checked.)"""
_SPEED_MARGIN_FACTOR = 2.0
"""A trajectory is assumed to be nowhere faster than this many times the limits and the speed of its start."""
_GENTLE_DESCENT_M_S = 0.2
"""A velocity that sinks more slowly may lead as near to the ground as a goal. One that climbs more slowly may lead as
far above the ceiling as the estimate may be off. A hover must not be refused because of noise.
"""
_SINKING_M_S = 0.02
"""A velocity that sinks no faster keeps its height."""
_MOST_GOAL_MARGIN_M = 0.1
"""A goal may be this much nearer to the ground than the clearance."""
_LEVEL_TOLERANCE = 1e-6
_AT_REST = Vector3()
_ANYWHERE = FrameInLocal(Transform(), OdomMetres(Vector3()))
_SAME_POINT_M = 1e-6
_MOST_ROOMS = 3
"""Rooms that are kept: a program that commands two velocities in turn, each near another corner, needs two."""


def geofence_of(settings: VehicleSettings, resolver: FrameResolver, needed_m: float) -> GeofencePolicy:
    """Returns the geofence of a UAV. Where the configuration has none, it is the one that the autopilot itself has.

    Args:
        settings: The floor, the ceiling, the clearance and the fence.
        resolver: Where the fence's frame is.
        needed_m: The clearance where the settings have none.

    Raises:
        ConfigError: The settings do not make a fence.

    """
    floor_m, ceiling_m = settings.floor_m, settings.ceiling_m
    clearance_m = needed_m if settings.clearance_m is None else settings.clearance_m
    if floor_m is not None and ceiling_m is not None and floor_m + clearance_m >= ceiling_m:
        raise ConfigError("is not above floor_m and clearance_m", "ceiling_m")
    return GeofencePolicy(settings.geofence, resolver, floor_m, ceiling_m, clearance_m)


class _CachedFence(NamedTuple):
    """Fence values cached under `key`.

    Attributes:
        key: What the rest depends on.
        fence: The fence of goals and ways in the local frame.
        low_fence: That of velocities, which reaches to the ground: a UAV that hovers below the clearance may still be
            flown, but `_require_stop_between` lets it sink no more.
        floor_z_m: z of the floor with its clearance, without what the estimated height may be off; minus infinity if
            there is none.
        ceiling_z_m: z of the ceiling, likewise.
        rooms: Parts of `low_fence` in which the last setpoints were found; the newest first.
    """

    key: tuple[object, ...]
    fence: Fence
    low_fence: Fence
    floor_z_m: float
    ceiling_z_m: float
    rooms: tuple[Room, ...]

    def has(self, points: Sequence[Point3]) -> bool:
        """Returns whether points are surely inside, and with them the straight ways between them."""
        for room in self.rooms:  # noqa: SIM110  each setpoint calls it: a generator would take twice as long
            if room.has(points):
                return True
        return False


@dataclass(slots=True)
class FenceInputs:
    """Inputs of the fence, the floor and the ceiling, and the frames. Slots are read faster than a tuple's."""

    links: object
    home: object
    start: object
    map_loss: object
    ground: object
    fence: object
    earth: object


class GeofencePolicy:
    """The configured fence, the floor and the ceiling, in the local frame. Any thread may call, except `observe`."""

    def __init__(
        self,
        settings: GeofenceSettings | None,
        resolver: FrameResolver,
        floor_m: float | None = None,
        ceiling_m: float | None = None,
        clearance_m: float = 0.0,
    ) -> None:
        """`settings` None: only the floor and the ceiling. Raises `ConfigError` if the settings do not make a fence."""
        self._floor_m, self._ceiling_m = floor_m, ceiling_m
        self.clearance_m = 0.0 if floor_m is None else clearance_m
        """Metres above the floor for goals and routes."""
        self.ground = Ground()
        """The ground of the take-off, as seen by the updates."""
        self.observe = self.ground.observe
        """Notes where the ground is. Called by the update thread at each update."""
        self._is_configured = settings is not None
        self._settings = settings = settings or GeofenceSettings()
        self._resolver = resolver
        self._frame_id = settings.frame_id or resolver.tree.odom
        if self._is_configured:
            self._check_settings()
        # A fence in odom moves with `set_home`, as configured. Elsewhere it stays: otherwise any client could move it
        # away, one `set_home` after the other.
        is_carried = resolver.is_moved_by_set_home(self._frame_id) and not resolver.tree.is_below_odom(self._frame_id)
        self._stays_at = resolver.in_local(self._frame_id) if is_carried else None
        Fence(settings.polygon or settings.polygon_geo)  # refuses a polygon that crosses itself now, not in the air
        self._cached: tuple[object, Fence] | None = None
        self._zoned: tuple[object, Fence] | None = None
        self._narrowed: tuple[object, tuple[Fence, Fence]] | None = None
        self._own: tuple[object, tuple[Fence, Fence]] | None = None
        self._last: _CachedFence | None = None
        self._admitted: tuple[object, ...] = ()

    def _check_settings(self) -> None:
        settings = self._settings
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
        if not self._resolver.tree.is_fixed(self._frame_id):
            raise ConfigError(f"{self._frame_id} is no fixed frame of the configuration", "geofence.frame_id")

    def _lowest_m(self) -> float:
        return -math.inf if self._settings.min_height_m is None else self._settings.min_height_m

    def _highest_m(self) -> float:
        return math.inf if self._settings.max_height_m is None else self._settings.max_height_m

    def fence(self, snapshot: Snapshot) -> Fence:
        """Returns the fence of goals and ways in the local frame.

        Raises:
            WrongStateError: It is not known where it lies there.
            FrameLostError: It is not known any more.

        """
        return self._now(snapshot).fence

    def _now(self, snapshot: Snapshot) -> _CachedFence:
        """Returns what holds now, which each setpoint requests: the same as before, unless something has changed."""
        own = snapshot.autopilot_fence
        place = self._resolver.frames_version() if self._is_configured else self._resolver.odom_z_m
        earth = snapshot.earth
        home = (earth.home_geo, earth.home_altitude_amsl_m, earth.projection)
        stands_at = autopilot_fence.home_of(snapshot) if own is not None and None in home else None
        key = (place, own, home, stands_at, self.ground.place)
        now = self._last
        if now is None or now.key != key:  # of a pair of tuples, only those members are compared that are not the same
            datum = self._datum(snapshot)
            (fence, low_fence), (floor_z_m, ceiling_z_m) = self._find(snapshot, datum), self._edges(datum)
            rooms = now.rooms if now is not None and now.low_fence is low_fence else ()
            now = self._last = _CachedFence(key, fence, low_fence, floor_z_m, ceiling_z_m, rooms)
        return now

    def _find(self, snapshot: Snapshot, datum: Datum) -> tuple[Fence, Fence]:
        """Returns the fence of goals and ways, and that of velocities."""
        if self._settings.polygon_geo and snapshot.earth.projection is None:
            raise WrongStateError("the geofence cannot be checked: the autopilot has not said where on Earth it is")
        frame = self._in_local()
        key = (
            frame.to_odom,
            frame.metres.home,
            frame.metres.projection,
            snapshot.earth.projection if self._settings.polygon_geo else None,
        )
        cached = self._cached
        if cached is None or cached[0] != key:
            cached = self._cached = (key, self._make(frame, snapshot))
        own = snapshot.autopilot_fence
        fence = cached[1] if own is None else self._within_autopilot_zones(cached[1], own, snapshot)
        lowest_m, highest_m = self._edges(datum)
        highest_m += datum.noise_m
        band = (fence, lowest_m - self._goal_margin_m(), highest_m)
        narrowed = self._narrowed
        if narrowed is None or narrowed[0] != band:
            low_fence = fence.narrowed(lowest_m - self.clearance_m - datum.noise_m, highest_m)
            narrowed = self._narrowed = (band, (fence.narrowed(*band[1:]), low_fence))
        return narrowed[1] if own is None else self._within_autopilot_limits(narrowed[1], own, snapshot)

    def edges(self, snapshot: Snapshot) -> Fence:
        """Returns the fence, human-readable. Raises as `fence`.

        Its floor and its ceiling are where they are configured, without what the estimated height may be off.
        """
        now = self._now(snapshot)
        return now.fence.narrowed(now.floor_z_m, now.ceiling_z_m)

    def _within_autopilot_zones(self, fence: Fence, own: AutopilotFence, snapshot: Snapshot) -> Fence:
        """Returns the part of a fence that the zones of the autopilot's own leave, with a reserve."""
        key = (fence, own.zones, own.unites_inclusions, snapshot.earth.projection)
        cached = self._zoned
        if cached is None or cached[0] != key:
            cached = self._zoned = (key, autopilot_fence.within_zones(fence, own, snapshot))
        return cached[1]

    def _within_autopilot_limits(
        self, fences: tuple[Fence, Fence], own: AutopilotFence, snapshot: Snapshot
    ) -> tuple[Fence, Fence]:
        """Returns the parts of both fences that are inside the limits of the autopilot's own, with a reserve."""
        key = (fences, own, autopilot_fence.home_of(snapshot))
        cached = self._own
        if cached is None or cached[0] != key:
            fence, low_fence = (autopilot_fence.within_limits(each, own, snapshot) for each in fences)
            cached = self._own = (key, (fence, low_fence))
        return cached[1]

    def _in_local(self) -> FrameInLocal:
        if not self._is_configured:
            return _ANYWHERE  # the floor and the ceiling depend on no frame
        if self._stays_at is not None:
            return self._resolver.from_start(self._stays_at)
        return self._resolver.in_local(self._frame_id)

    def _make(self, frame: FrameInLocal, snapshot: Snapshot) -> Fence:
        up = frame.rotation.rotate(Vector3(0.0, 0.0, 1.0))
        if math.hypot(up.x, up.y) > _LEVEL_TOLERANCE:
            raise WrongStateError(f"the geofence cannot be checked: its frame {self._frame_id} is not level")
        if self._settings.polygon_geo:
            assert snapshot.earth.projection is not None
            corners = (snapshot.earth.projection.to_local(lat, lon, 0.0) for lat, lon in self._settings.polygon_geo)
        else:
            corners = (frame.to_local(Vector3(x, y, 0.0)) for x, y in self._settings.polygon)
        base_m = frame.to_local(Vector3()).z
        return Fence(
            [(corner.x, corner.y) for corner in corners], base_m + self._lowest_m(), base_m + self._highest_m()
        )

    # --- The floor and the ceiling ------------------------------------------------------------------------------------

    def estimate_jumped(self, jump: Vector3) -> None:
        """Notes that the autopilot's estimate has jumped. Called by the update thread."""
        self.ground.estimate_jumped(jump)

    def height_m(self, snapshot: Snapshot) -> tuple[float, bool]:
        """Returns the height above the ground of the take-off, or else above home, and whether it is the former."""
        assert snapshot.motion.pose is not None
        return snapshot.motion.pose.value.position.z - self.ground_z_m(snapshot), self.ground.z_m is not None

    def ground_z_m(self, snapshot: Snapshot) -> float:
        """Returns the z of the ground from which heights are measured, in the local frame."""
        return self._datum(snapshot).z_m

    def _datum(self, snapshot: Snapshot) -> Datum:
        return self.ground.datum(snapshot, self._odom_z_m)

    def _odom_z_m(self) -> float:
        return self._resolver.odom_z_m

    def _edges(self, datum: Datum) -> tuple[float, float]:
        """Returns z of the floor, with the clearance over it, and of the ceiling in the local frame."""
        floor_m = -math.inf if self._floor_m is None else self._floor_m + self.clearance_m
        ceiling_m = math.inf if self._ceiling_m is None else self._ceiling_m
        return datum.z_m + floor_m, datum.z_m + ceiling_m

    def _goal_margin_m(self) -> float:
        """Returns how far below the clearance a goal may lie, so that a hover at it is no goal beyond it."""
        return min(_MOST_GOAL_MARGIN_M, self.clearance_m / 2.0)

    def top_z_m(self, snapshot: Snapshot) -> float:
        """Returns z of the ceiling or of the top of the configured fence, whichever is lower. Raises as `fence`."""
        now = self._now(snapshot)
        return min(now.ceiling_z_m, now.fence.highest_m)

    # --- What has changed ---------------------------------------------------------------------------------------------

    def depends_on(self, snapshot: Snapshot) -> tuple[object, ...]:
        """Returns all that the fence, the floor and the ceiling, and the frames depend on. While it is equal, they are
        the same. Each update calls it: comparing it costs next to nothing while nothing changes.
        """
        return (
            snapshot.autopilot_fence,
            snapshot.earth.projection,
            snapshot.earth.home_geo,
            snapshot.earth.home_altitude_amsl_m,
            self.ground.place,
            *self._resolver.frames_version(),
        )

    def holds(self, world: FenceInputs, snapshot: Snapshot) -> bool:
        """Returns whether all that `depends_on` returns are the same objects as in a `world`. Each setpoint asks."""
        resolver, earth = self._resolver, snapshot.earth
        frame = resolver.local_frame
        return (
            world.home is frame.home
            and world.links is resolver.tree.links
            and world.ground is self.ground.place
            and world.start is frame.start
            and world.map_loss is frame.map_loss
            and world.fence is snapshot.autopilot_fence
            and (world.earth is earth or world.earth == earth)
        )

    def world(self, snapshot: Snapshot) -> FenceInputs:
        """Returns what `holds` compares."""
        resolver = self._resolver
        frame = resolver.local_frame
        return FenceInputs(
            resolver.tree.links,
            frame.home,
            frame.start,
            frame.map_loss,
            self.ground.place,
            snapshot.autopilot_fence,
            snapshot.earth,
        )

    def outline(
        self, trajectory: Trajectory, from_s: float, here: Vector3, limits: Limits, snapshot: Snapshot
    ) -> Iterator[Vector3]:
        """Yields points along the rest of a trajectory, from where the UAV is, that show whether it leaves the fence.

        Raises as `fence`.
        """
        return _outline(trajectory, here, self.fence(snapshot), limits, from_s)

    # --- What is refused ----------------------------------------------------------------------------------------------

    def admit(self, what: str, motion: Trajectory | Reference, limits: Limits, snapshot: Snapshot) -> None:
        """Checks that a motion that begins now stays inside. `what` names it in the error.

        Raises:
            GeofenceError: It would leave the fence.
            WrongStateError: It is not known where the fence lies.

        """
        if isinstance(motion, Velocity):
            self.require_velocity(motion.velocity(snapshot), limits, snapshot)
        elif isinstance(motion, Trajectory):
            self.require_goal_inside(motion.end().position, what, snapshot)
            outline = _outline(motion, measured_motion(snapshot).position, self.fence(snapshot), limits)
            self.require_inside(outline, what, snapshot)
        elif isinstance(motion, Hold):
            self.require_straight_to(motion.position, what, snapshot)
        elif isinstance(motion, MovingGoal):
            self.require_straight_to(motion.goal(snapshot.time_s).position, what, snapshot)
        elif (pose := motion.pose()) is not None:
            self.require_straight_to(pose.position, what, snapshot)

    def is_free(self, a: Vector3, b: Vector3, snapshot: Snapshot) -> bool:
        """Returns whether the straight way between two positions crosses no corner and no hole of the fence.

        Yes where it is not known where the fence lies.
        """
        try:
            return self.fence(snapshot).is_free(a, b)
        except WrongStateError:
            return True

    def is_left_by(self, trajectory: Trajectory, limits: Limits, snapshot: Snapshot) -> bool:
        """Returns whether a trajectory begins inside the fence and leaves it. Raises as `fence`."""
        fence, start = self.fence(snapshot), trajectory.at(0.0).position
        outline = _outline(trajectory, start, fence, limits)
        return fence.is_inside(start) and fence.exit_point(outline) is not None

    def require_goal_inside(self, goal: Vector3, what: str, snapshot: Snapshot) -> None:
        """Raises `GeofenceError` if a goal lies outside."""
        if not self.fence(snapshot).is_inside(goal):
            raise self._error(what, goal, snapshot)

    def require_inside(self, polyline: Iterable[Vector3], what: str, snapshot: Snapshot) -> None:
        """Raises `GeofenceError` if a polyline in the local frame leaves the fence."""
        found = self.fence(snapshot).exit(polyline)
        if found is not None:
            raise self.exit_error(what, found, snapshot)

    def exit_error(self, what: str, found: Exit, snapshot: Snapshot) -> GeofenceError:
        """Returns the error of a way that leaves the fence where this was found."""
        return self._error(what, found.point, snapshot, found.before, ", or the way there does")

    def require_straight_to(self, goal: Vector3, what: str, snapshot: Snapshot) -> None:
        """Raises `GeofenceError` if a goal, or the straight way there from where the UAV is, leaves the fence."""
        now, here = self._now(snapshot), measured_motion(snapshot).position
        points = (here.x, here.y, here.z), (goal.x, goal.y, goal.z)
        if min(here.z, goal.z) < now.fence.lowest_m or not now.has(points):
            self.require_inside([here, goal], what, snapshot)
            self._find_room(now, points)

    @property
    def rooms(self) -> object:
        """The parts of the fence in which the last setpoints were found: another object where they are others."""
        return None if self._last is None else self._last.rooms

    def surely_inside_m(self, snapshot: Snapshot) -> float:
        """Returns the radius of a ball around a UAV in the air, in which every velocity may stop; negative for none.

        It lies in a part of the fence that setpoints were found in, and between floor and ceiling. It stays so while
        the `world` holds.

        Raises:
            WrongStateError: It is not known where the fence, or ``<ns>/odom``, lies.
            FrameLostError: It is not known any more.

        """
        assert snapshot.motion.pose is not None
        self._resolver.require_odom()
        now, here = self._now(snapshot), snapshot.motion.pose.value.position
        point = (here.x, here.y, here.z)
        inside_m = max((room.inside_m(point) for room in now.rooms), default=-1.0)
        return min(inside_m, here.z - now.floor_z_m, now.ceiling_z_m - here.z)

    def require_velocity(self, velocity: Vector3, limits: Limits, snapshot: Snapshot) -> None:
        """Checks that a UAV that is commanded a velocity can still stop inside the fence.

        It must be able to stop from the commanded velocity, from its own, and from the one that it has when it can next
        be commanded to brake: see `reachable_points`. Outside, a velocity that brings it nearer, and not out again on
        another side, is allowed. Anywhere, a velocity that stops it as well as it can be stopped is allowed.

        A stream of setpoints pays for polygons only now and then. What was found to be inside serves the next setpoint
        as a convex part of the fence (`Room`). Where all points of the reach lie in it, so does every way between them,
        and the rule would admit it. What was admitted without that is admitted for the same data, limits and fence.

        Raises:
            GeofenceError: It could not stop inside.
            WrongStateError: It is not known where the fence lies.

        """
        if velocity.x == velocity.y == velocity.z == 0.0:
            return
        assert snapshot.motion.pose is not None
        now, here = self._now(snapshot), snapshot.motion.pose.value.position
        own = _AT_REST if snapshot.motion.velocity is None else snapshot.motion.velocity.value.linear
        points = reachable_points(here, own, velocity, limits)
        if now.has(points):
            if not now.floor_z_m <= points.commanded_stop[2] <= now.ceiling_z_m:
                self._require_stop_between(now, points, velocity)
            return
        question = (now.low_fence, now.floor_z_m, now.ceiling_z_m, here, own, velocity, limits)
        if self._admitted != question:
            self._require_stop(now, points, own, velocity, limits, snapshot)
            self._admitted = question
            self._find_room(now, points)

    def _require_stop(
        self,
        now: _CachedFence,
        points: ReachablePoints,
        own: Vector3,
        velocity: Vector3,
        limits: Limits,
        snapshot: Snapshot,
    ) -> None:
        """Checks by the rule itself; see `require_velocity`."""
        fence, polylines = now.low_fence, points.polylines()
        here, commanded_stop = polylines[0]
        if fence.is_nowhere:
            raise self._velocity_error(Exit(here, None), snapshot)
        if fence.leads_back(here, commanded_stop):
            return
        self._require_stop_between(now, points, velocity)
        found = next((each for each in map(fence.exit, polylines) if each is not None), None)
        if found is None:
            return
        soonest = [here, *(Vector3(*point) for point in change(here, own, _AT_REST, limits))]
        changed = polylines[-1]
        # Behind a hole it is inside again, and the farther the better: so the way over the hole counts, too.
        is_farther_out = fence.signed_distance_m(changed[-1]) > fence.signed_distance_m(soonest[-1]) + _SAME_POINT_M
        if is_farther_out or fence.outside_m(changed) > fence.outside_m(soonest) + _SAME_POINT_M:
            raise self._velocity_error(found, snapshot)

    def _find_room(self, now: _CachedFence, points: Sequence[Point3]) -> None:
        """Keeps a part of the fence that contains points that were just admitted, if there is one."""
        room = now.low_fence.room_around(points)
        if room is not None:
            self._last = now._replace(rooms=(room, *now.rooms[: _MOST_ROOMS - 1]))

    def _require_stop_between(self, now: _CachedFence, points: ReachablePoints, velocity: Vector3) -> None:
        """Raises `GeofenceError` if a velocity leads through the clearance of the floor, or through the ceiling."""
        stop_z_m = points.commanded_stop[2]
        given_m = self._goal_margin_m() if velocity.z >= -_GENTLE_DESCENT_M_S else 0.0
        if velocity.z < -_SINKING_M_S and stop_z_m < now.floor_z_m - given_m:
            raise GeofenceError(
                f"velocity: from {self._text(Vector3(*points.here))} the UAV could not stop above the floor "
                f"({self._floor_text()})",
                {"setting": "floor_m"},
            )
        if velocity.z > _GENTLE_DESCENT_M_S and stop_z_m > now.ceiling_z_m:
            raise GeofenceError(
                f"velocity: from {self._text(Vector3(*points.here))} the UAV could not stop below the ceiling "
                f"({self._ceiling_text()})",
                {"setting": "ceiling_m"},
            )

    def _velocity_error(self, left: Exit, snapshot: Snapshot) -> GeofenceError:
        edge, metadata = self._broken_edge(left.point, snapshot, left.before)
        at_edge = f": there it is {edge}" if edge else ""
        point = self._text(left.point)
        return GeofenceError(f"velocity: it would leave the geofence at about {point}{at_edge}", metadata)

    def _error(
        self, what: str, point: Vector3, snapshot: Snapshot, before: Vector3 | None = None, or_way: str = ""
    ) -> GeofenceError:
        edge, metadata = self._broken_edge(point, snapshot)
        if edge:
            return GeofenceError(f"{what}: {self._text(point)} is {edge}", metadata)
        edge, metadata = self._broken_edge(point, snapshot, before)
        if edge:
            return GeofenceError(f"{what}: the way to {self._text(point)} leads {edge}", metadata)
        return GeofenceError(f"{what}: {self._text(point)} lies outside the geofence{or_way}")

    def _broken_edge(
        self, point: Vector3, snapshot: Snapshot, before: Vector3 | None = None
    ) -> tuple[str, dict[str, str]]:
        """Returns how a point lies beyond the floor, the ceiling or the autopilot's own fence: in words, as metadata.

        With `before`, also how the way from there leads through that fence. Empty if it does not.
        """
        datum = self._datum(snapshot)
        lowest_m, highest_m = self._edges(datum)
        height_m = point.z - datum.z_m
        where = f"{abs(height_m):.1f} m {'below' if height_m < 0.0 else 'above'} {datum.name}"
        if point.z < lowest_m - self._goal_margin_m():
            return f"{where}, {self._below_text(height_m)}", {"setting": "floor_m"}
        if point.z > highest_m + datum.noise_m:
            return f"{where}, above the ceiling ({self._ceiling_text()})", {"setting": "ceiling_m"}
        beyond = autopilot_fence.beyond_limit(point, snapshot)
        if beyond is None:
            beyond = autopilot_fence.beyond_zone(self.fence(snapshot).zone_left(before, point))
        return (
            ("", {}) if beyond is None else (autopilot_fence.text(beyond, autopilot_fence.RESERVE_M), beyond.metadata)
        )

    def _below_text(self, height_m: float) -> str:
        assert self._floor_m is not None
        if height_m < self._floor_m or not self.clearance_m:
            return f"below the floor ({self._floor_text()})"
        return (
            f"nearer to the floor than its clearance of {self.clearance_m:g} m ({self._floor_text()}); to come down, "
            "land"
        )

    def _floor_text(self) -> str:
        clearance = f", clearance_m: {self.clearance_m:g}" if self.clearance_m else ""
        return f"floor_m: {self._floor_m:g}{clearance} in the configuration; z is up"

    def _ceiling_text(self) -> str:
        return f"ceiling_m: {self._ceiling_m:g} in the configuration"

    def _text(self, local: Vector3) -> str:
        return self._resolver.describe(local)


def _outline(
    trajectory: Trajectory, start: Vector3, fence: Fence, limits: Limits, from_s: float = 0.0
) -> Iterator[Vector3]:
    """Yields a polyline from a point along a trajectory that leaves the fence where the trajectory does.

    It has the ends of the straight parts, and points on the bends, close to each other near the edge. Well inside, the
    next point is so far on that the trajectory cannot leave the fence before it. So the number of points depends on the
    bends, and not on the length or the duration of the trajectory.
    """
    vertical_m_s = max(limits.climb_speed_m_s, limits.descent_speed_m_s)
    fastest_m_s = max(math.hypot(limits.horizontal_speed_m_s, vertical_m_s), trajectory.at(from_s).velocity.norm())
    fastest_m_s *= _SPEED_MARGIN_FACTOR
    yield start
    for begin_s, end_s in trajectory.bends_s():
        if end_s < from_s:
            continue
        period_s = max(_POINT_PERIOD_S, (end_s - begin_s) / _MAX_POINTS)
        time_s = max(begin_s, from_s)
        while time_s < end_s:
            point = trajectory.at(time_s).position
            yield point
            time_s += max(period_s, fence.clearance_m(point) / fastest_m_s)
        yield trajectory.at(end_s).position
    yield trajectory.end().position
