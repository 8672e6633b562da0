"""Routes of places on Earth that a file draws as a line: what their altitudes mean, and which line is flown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from ual.routes._route import FaultError, Route, geo_waypoint, is_same_position
from ual.shared.numbers import parse_number, shown
from ual.types import AltitudeReference, GeoWaypoint

T = TypeVar("T")

HOW = "give an altitude above home at which to fly all of it (--altitude)"
_MOST_NAMED_LINES = 5


@dataclass(frozen=True, slots=True)
class Heights:
    """Altitudes by the caller: fly all at `altitude_m` above home, or the reference of the file's altitudes."""

    altitude_m: float | None = None
    reference: AltitudeReference | None = None


@dataclass(frozen=True, slots=True)
class RoutePoint:
    """One place of a line; `where` names it in messages."""

    where: str
    latitude_deg: float
    longitude_deg: float
    altitude_m: float | None


def number(text: str | None, what: str, where: str) -> float:
    """Parses a number of a file. Raises `FaultError`."""
    if text is None:
        raise FaultError(f"it has no {what}", where)
    try:
        return parse_number(text)
    except ValueError as error:
        raise FaultError(f"its {what} {error}", where) from None


def the_one(lines: Sequence[tuple[str, T]], what: str, has: str) -> T:
    """Returns the only one of lines with their names. Raises `FaultError`, which names them, and what else there is."""
    if len(lines) == 1:
        return lines[0][1]
    names = [shown(name) for name, _ in lines[:_MOST_NAMED_LINES] if name]
    named = f" ({', '.join(names)}{', ...' if len(lines) > _MOST_NAMED_LINES else ''})" if names else ""
    instead = f" (it has {has})" if has and not lines else ""
    then = "keep one in a file of its own" if lines else "draw the way as one line"
    raise FaultError(f"has {len(lines)} {what}{named or instead}; a route needs exactly one: {then}")


def counted(counts: Sequence[tuple[int, str]]) -> str:
    """Returns ``2 points and 1 polygon`` of the numbers of things."""
    return " and ".join(f"{count} {name}{'s' * (count > 1)}" for count, name in counts if count)


def route(
    points: Sequence[RoutePoint], reference: AltitudeReference | None, heights: Heights, left_out: Sequence[str]
) -> Route:
    """Returns the route through places whose altitudes count from `reference`. Raises `FaultError`.

    Where the file does not say from what (None), the caller has to.
    """
    if heights.altitude_m is not None:
        if any(point.altitude_m for point in points):
            left_out = [*left_out, f"the altitudes of the file: all is flown {heights.altitude_m:g} m above home"]
        flat = [replace(point, altitude_m=heights.altitude_m) for point in points]
        return Route(_waypoints(flat, AltitudeReference.HOME), (), left_out)
    if reference is not None and heights.reference is not None:
        raise FaultError("says itself what its altitudes count from: leave out --reference")
    missing = [point for point in points if point.altitude_m is None]
    if missing:
        raise FaultError(f"it has no altitude: {HOW}", missing[0].where)
    wanted = reference or heights.reference
    if wanted is None:
        raise FaultError(
            "does not say what its altitudes count from, and many such files have the ground's: give --reference "
            f"(home, amsl or ellipsoid), or {HOW}"
        )
    return Route(_waypoints(points, wanted), (), left_out)


def _waypoints(points: Sequence[RoutePoint], reference: AltitudeReference) -> list[GeoWaypoint]:
    """Returns a waypoint for each place, but one for those at the same place in a row (a track that stands still)."""
    found: list[GeoWaypoint] = []
    for point in points:
        altitude_m = 0.0 if point.altitude_m is None else point.altitude_m
        waypoint = geo_waypoint(point.latitude_deg, point.longitude_deg, altitude_m, reference, point.where)
        if not found or not is_same_position(found[-1], waypoint):
            found.append(waypoint)
    return found
