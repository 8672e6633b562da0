"""The dry run of a mission: its way as straight lines, within the geofence, the floor and the ceiling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ual.errors import WrongStateError
from ual.geometry import Vector3
from ual.missions.items import (
    HoldTime,
    Item,
    Land,
    ReturnToLaunch,
    Speed,
    TakeOff,
    Waypoint,
    name_of,
)
from ual.missions.order import executed
from ual.missions.plan import MissionPlan
from ual.types import AltitudeReference, GeoWaypoint, Limits
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.flight import Flight
from ual_daemon.flight.policy.home import home_point
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.tracker.limits import at_most
from ual_daemon.tracker.references import measured_motion
from ual_daemon.trajectory import Motion, StraightTrajectory
from ual_daemon.trajectory import PathWaypoint as Local
from ual_daemon.vehicle.distance_limit import DistanceLimit

COMMAND = "mission"


class MissionPlanner:
    """Makes the dry runs of missions of one UAV. Any thread may call."""

    def __init__(self, flight: Flight, resolver: FrameResolver, distance_limit: DistanceLimit) -> None:
        self._flight = flight
        self._resolver = resolver
        self._distance_limit = distance_limit

    def plan(self, items: Sequence[Item], snapshot: Snapshot, first: int = 1) -> MissionPlan:
        """Returns what a mission would be that begins with an item, counted from 1, where the UAV is.

        Raises:
            GeofenceError: It leads outside, below the floor, above the ceiling, or beyond the reach; names the item.
            WrongStateError: It is not known where the UAV or the geofence is.

        """
        if snapshot.motion.pose is None:
            why = self._flight.estimate(snapshot).why
            text = f"{COMMAND}: its way cannot be planned before it is known where the UAV is: {why}"
            raise WrongStateError(text, {"command": COMMAND, "needed": "pose"})
        return _Walk(self._flight, self._resolver, self._distance_limit, items, snapshot).plan(
            executed(items, first - 1)
        )


class _Walk:
    """Walks through a mission on paper."""

    def __init__(
        self,
        flight: Flight,
        resolver: FrameResolver,
        distance_limit: DistanceLimit,
        items: Sequence[Item],
        snapshot: Snapshot,
    ) -> None:
        self._flight, self._resolver, self._distance_limit = flight, resolver, distance_limit
        self._items, self._snapshot = items, snapshot
        self._ground_z_m = flight.geofence.ground_z_m(snapshot)
        self._limits = flight.limits.cruise()
        self._here = measured_motion(snapshot).position
        self._is_up = False
        """Whether a leg of it has been flown: the first one begins where the UAV is, perhaps on the ground."""
        self._length_m = self._duration_s = 0.0
        self._heights_m: list[float] = []
        self._seen: set[tuple[int, Vector3]] = set()
        """The legs that were checked: what jumps repeat is not checked again."""

    def plan(self, order: Sequence[int]) -> MissionPlan:
        here_m = self._here.z - self._ground_z_m
        for index in order:
            self._item(index)
        heights_m = self._heights_m or [here_m]  # it may begin with an item that leads to no place
        return MissionPlan(self._length_m, self._duration_s, min(heights_m), max(heights_m), len(order))

    def _item(self, index: int) -> None:
        item = self._items[index]
        if isinstance(item, TakeOff):
            self._take_off(index, item)
        elif isinstance(item, Waypoint):
            self._leg(index, self._position(index, item))
            self._duration_s += item.hold_s
        elif isinstance(item, HoldTime):
            self._duration_s += item.seconds
        elif isinstance(item, Speed):
            self._limits = _at_speed(self._flight.limits.get(), item.speed_m_s)
        elif isinstance(item, Land):
            over = self._position(index, Waypoint(item.latitude_deg, item.longitude_deg, 0.0))
            self._leg(index, Vector3(over.x, over.y, self._here.z))
            self._down()
        elif isinstance(item, ReturnToLaunch):
            self._return()

    def _take_off(self, index: int, item: TakeOff) -> None:
        has_place = item.latitude_deg is not None and item.longitude_deg is not None
        latitude_deg, longitude_deg = (item.latitude_deg, item.longitude_deg) if has_place else (0.0, 0.0)
        assert latitude_deg is not None
        assert longitude_deg is not None
        at = GeoWaypoint(latitude_deg, longitude_deg, item.altitude_m, item.altitude_reference)
        goal = self._resolved(at) if has_place else self._above(item)
        top = Vector3(self._here.x, self._here.y, max(goal.z, self._here.z))
        self._is_up = False  # it climbs from the ground
        self._leg(index, top)
        if has_place:
            self._require_near(index, at, goal)
            self._leg(index, Vector3(goal.x, goal.y, top.z))

    def _above(self, item: TakeOff) -> Vector3:
        """Returns where the UAV is at the altitude of its take-off."""
        place = self._snapshot.motion.position_geo
        projection = self._snapshot.earth.projection
        if place is None and projection is not None:
            place = projection.to_geo(self._here)
        latitude_deg, longitude_deg = (0.0, 0.0) if place is None else (place.latitude_deg, place.longitude_deg)
        at = GeoWaypoint(latitude_deg, longitude_deg, item.altitude_m, item.altitude_reference)
        return self._resolved(at)

    def _resolved(self, at: GeoWaypoint) -> Vector3:
        """Returns a place in the local frame. Home is reported a moment after the arming, which sets it."""
        snapshot = self._snapshot
        is_told = snapshot.earth.home_altitude_amsl_m is not None or not snapshot.control.is_on_ground
        if is_told or at.altitude_reference is not AltitudeReference.HOME:
            return self._resolver.geo_to_local(at, snapshot).position
        flat = replace(at, altitude_m=0.0, altitude_reference=AltitudeReference.AMSL)
        place = self._resolver.geo_to_local(flat, snapshot).position
        return Vector3(place.x, place.y, self._ground_z_m + at.altitude_m)

    def _position(self, index: int, item: Waypoint) -> Vector3:
        at = GeoWaypoint(item.latitude_deg, item.longitude_deg, item.altitude_m, item.altitude_reference)
        position = self._resolved(at)
        self._require_near(index, at, position)
        return position

    def _require_near(self, index: int, at: GeoWaypoint, position: Vector3) -> None:
        what = f"{COMMAND}: {name_of(self._items, index)}"
        self._distance_limit.require_goal(what, at, Local(position), self._snapshot)

    def _leg(self, index: int, goal: Vector3) -> None:
        if (index, self._here) not in self._seen:
            self._seen.add((index, self._here))
            self._check(index, goal)
        self._add(goal)
        self._is_up = True
        self._heights_m.append(goal.z - self._ground_z_m)

    def _check(self, index: int, goal: Vector3) -> None:
        what = f"{COMMAND}: {name_of(self._items, index)}"
        geofence, snapshot = self._flight.geofence, self._snapshot
        geofence.require_goal_inside(goal, what, snapshot)
        if self._is_up:
            geofence.require_inside([self._here, goal], what, snapshot)

    def _add(self, goal: Vector3) -> None:
        line = StraightTrajectory(Motion(self._here, 0.0), goal, 0.0, self._limits)
        self._length_m += line.length_m
        self._duration_s += line.duration_s
        self._here = goal

    def _down(self) -> None:
        self._add(Vector3(self._here.x, self._here.y, min(self._ground_z_m, self._here.z)))

    def _return(self) -> None:
        """Returns at the present height: how high the autopilot climbs for it, its parameters say."""
        home = home_point(self._snapshot, self._flight.geofence.ground)
        if home is not None:
            self._add(Vector3(home.position.x, home.position.y, self._here.z))
        self._down()


def _at_speed(limits: Limits, speed_m_s: float) -> Limits:
    horizontal_m_s = at_most(limits, speed_m_s).horizontal_speed_m_s
    return replace(limits, horizontal_speed_m_s=horizontal_m_s)
