"""Content of a route file, and the errors of reading it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from ual.geometry import PoseStamped
from ual.types import AltitudeReference, GeoWaypoint

MOST_WAYPOINTS = 10_000
"""A daemon takes no longer path (RESOURCE_EXHAUSTED)."""
MOST_HOLD_S = 3600.0
"""Most seconds of a path's hold at one waypoint."""
_NOWHERE_DEG = 1e-6
"""Latitude and longitude that are both within a decimetre of 0 are a position that was not set."""
_MOST_LATITUDE_DEG, _MOST_LONGITUDE_DEG = 90.0, 180.0


class RouteError(Exception):
    """A file contains no valid route; the message is one line that says where and why."""


class FaultError(Exception):
    """Fault at one position of a file (empty: of the whole file); `naming` makes a `RouteError` of it."""

    def __init__(self, text: str, where: str = "") -> None:
        super().__init__(text)
        self.text, self.where = text, where


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Names the file in the errors of a block."""
    try:
        yield
    except FaultError as fault:
        prefix = f", {fault.where}:" if fault.where else ""
        raise RouteError(f"{name}{prefix} {fault.text}") from None


@dataclass(frozen=True, slots=True)
class Route:
    """Waypoints, either all with frames or all geographic.

    `leg_speeds_m_s` is empty or has one for each waypoint (0: none given). So has `holds_s`: how long to hold there (0:
    no stop).

    `left_out` lists, as human-readable text, what else is in the file and is not flown.
    """

    waypoints: Sequence[PoseStamped] | Sequence[GeoWaypoint]
    leg_speeds_m_s: Sequence[float] = ()
    left_out: Sequence[str] = ()
    holds_s: Sequence[float] = ()


def geo_waypoint(
    latitude_deg: float,
    longitude_deg: float,
    altitude_m: float,
    reference: AltitudeReference,
    where: str,
    yaw_rad: float | None = None,
) -> GeoWaypoint:
    """Returns a waypoint on Earth. Raises `FaultError` for a place that does not exist, or that was never set."""
    if not all(map(math.isfinite, (latitude_deg, longitude_deg, altitude_m))):
        raise FaultError(f"({latitude_deg}, {longitude_deg}, {altitude_m}) is no position", where)
    if abs(latitude_deg) > _MOST_LATITUDE_DEG or abs(longitude_deg) > _MOST_LONGITUDE_DEG:
        raise FaultError(
            f"latitude {latitude_deg:.12g}, longitude {longitude_deg:.12g} is not on Earth (at most 90 and 180 "
            "degrees): are the two swapped, or in another coordinate system?",
            where,
        )
    if abs(latitude_deg) < _NOWHERE_DEG and abs(longitude_deg) < _NOWHERE_DEG:
        raise FaultError("latitude 0, longitude 0 is a position that was not set: give it one, or delete it", where)
    return GeoWaypoint(latitude_deg, longitude_deg, altitude_m, reference, yaw_rad)


def is_same_position(a: GeoWaypoint, b: GeoWaypoint) -> bool:
    """Returns whether two waypoints differ in their headings at most."""
    return (a.latitude_deg, a.longitude_deg, a.altitude_m, a.altitude_reference) == (
        b.latitude_deg,
        b.longitude_deg,
        b.altitude_m,
        b.altitude_reference,
    )


def listed(numbers: Sequence[str]) -> str:
    """Returns ``item 3``, ``items 3, 4 and 7`` or ``items 1, 2, 3, 4, 5 and 12 more`` of the numbers of items."""
    if len(numbers) == 1:
        return f"item {numbers[0]}"
    shown = list(numbers[:_MOST_LISTED_NUMBERS])
    last = f"{len(numbers) - len(shown)} more" if len(numbers) > len(shown) else shown.pop()
    return f"items {', '.join(shown)} and {last}"


_MOST_LISTED_NUMBERS = 5
