"""Limit of the distance to a goal: a swapped or an empty coordinate is no goal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import count

from ual.errors import GeofenceError
from ual.geometry import Vector3
from ual.types import GeoWaypoint
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.policy.home import HomePoint
from ual_daemon.frames.resolver import Goal
from ual_daemon.geodesy import is_zero
from ual_daemon.settings import ConfigError, VehicleSettings
from ual_daemon.tracker.references import measured_motion
from ual_daemon.trajectory import PathWaypoint

_SETTING = {"setting": "reach_m"}
_M_PER_KM = 1000.0
_POLE_DEG = 90.0
_ZERO = "latitude and longitude 0 are what is left where none were given"


class DistanceLimit:
    """Refuses goals that lie further from the UAV than `reach_m`, and those at latitude and longitude 0."""

    def __init__(self, settings: VehicleSettings) -> None:
        """Raises `ConfigError` where the configuration itself has a place at latitude and longitude 0."""
        self._reach_m = settings.reach_m
        if self._reach_m is not None:
            _require_meant(settings)

    def require_goal(self, name: str, goal: Goal | GeoWaypoint, local: PathWaypoint, snapshot: Snapshot) -> None:
        """Checks the goal of a command, which is `local` in the local frame. Raises `GeofenceError`."""
        self.require_goals(name, [goal], [local], snapshot)

    def require_goals(
        self, name: str, goals: Sequence[Goal | GeoWaypoint], locals_: Sequence[PathWaypoint], snapshot: Snapshot
    ) -> None:
        """Checks all goals of a command. Raises `GeofenceError`, which names the first one that is refused."""
        if self._reach_m is None:
            return
        here = measured_motion(snapshot).position
        for number, goal, local in zip(count(), goals, locals_, strict=False):
            place = f"waypoint {number}: " if len(goals) > 1 else ""
            if isinstance(goal, GeoWaypoint) and is_zero(goal.latitude_deg, goal.longitude_deg):
                raise GeofenceError(
                    f"{name}: {place}{_ZERO}; reach_m: null in the configuration permits them", _SETTING
                )
            self._require_near(name, place, goal, local.position, here, snapshot)

    def _require_near(
        self, name: str, place: str, goal: Goal | GeoWaypoint, there: Vector3, here: Vector3, snapshot: Snapshot
    ) -> None:
        assert self._reach_m is not None
        distance_m = (there - here).horizontal_norm()
        if distance_m > self._reach_m:
            raise _beyond(f"{name}: {place}the goal", distance_m, self._reach_m, self._hint(goal, here, snapshot))

    def _hint(self, goal: Goal | GeoWaypoint, here: Vector3, snapshot: Snapshot) -> str:
        """Returns what may be wrong with a goal on Earth: the first mistake without which it is within the reach."""
        projection = snapshot.earth.projection
        if not isinstance(goal, GeoWaypoint) or projection is None:
            return ""
        assert self._reach_m is not None
        for mistake, latitude_deg, longitude_deg in _meant(goal):
            distance_m = (projection.to_local(latitude_deg, longitude_deg, 0.0) - here).horizontal_norm()
            if distance_m <= self._reach_m:
                return f"; with {mistake} it is {_text(distance_m)} away"
        return ""


def require_home(name: str, home: HomePoint, settings: VehicleSettings, snapshot: Snapshot) -> None:
    """Checks the home to which a command returns. Raises `GeofenceError`."""
    if settings.reach_m is None:
        return
    distance_m = (home.position - measured_motion(snapshot).position).horizontal_norm()
    if distance_m > settings.reach_m:
        ways_out = "; fly back (go_to_waypoint) and command this again, or land where it is (land)"
        raise _beyond(f"{name}: {home.what}", distance_m, settings.reach_m, ways_out)


def _meant(goal: GeoWaypoint) -> Iterator[tuple[str, float, float]]:
    """Yields each mistake that is often made, and the latitude and longitude (degrees) without it."""
    latitude_deg, longitude_deg = goal.latitude_deg, goal.longitude_deg
    if abs(longitude_deg) <= _POLE_DEG:
        yield "latitude and longitude swapped", longitude_deg, latitude_deg
    yield "the other sign of the longitude", latitude_deg, -longitude_deg
    yield "the other sign of the latitude", -latitude_deg, longitude_deg
    yield "the other sign of both", -latitude_deg, -longitude_deg


def _beyond(what: str, distance_m: float, reach_m: float, hint: str) -> GeofenceError:
    return GeofenceError(
        f"{what} is {_text(distance_m)} from the UAV, beyond its reach of {_text(reach_m)}"
        f" (reach_m: {reach_m:g} in the configuration){hint}",
        _SETTING,
    )


def _require_meant(settings: VehicleSettings) -> None:
    origin, fence = settings.map_origin_geo, settings.geofence
    if origin is not None and is_zero(origin[0], origin[1]):
        raise ConfigError(f"{_ZERO}; reach_m: null permits it", "map_origin_geo")
    if fence is not None and any(is_zero(*corner) for corner in fence.polygon_geo):
        raise ConfigError(f"{_ZERO}; reach_m: null permits it", "geofence.polygon_geo")


def _text(distance_m: float) -> str:
    return f"{distance_m / _M_PER_KM:,.1f} km" if distance_m >= _M_PER_KM else f"{distance_m:.0f} m"
