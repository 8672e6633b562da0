"""Checks every input of a caller, once, before anything else uses it.

Each function returns the valid value, or raises an `InvalidArgumentError` that names the field and the value.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import SupportsFloat

from ual import geometry
from ual.errors import InvalidArgumentError
from ual.geometry import KEEP_HEADING, Quaternion, Transform, Twist, Vector3
from ual.types import AltitudeReference, GeoWaypoint, PathHeading
from ual_daemon.settings import FRAME_ID_PATTERN, MAX_TURN_RAD_S

MAX_DISTANCE_M = 1e7
MAX_SPEED_M_S = 1000.0
MIN_SPEED_M_S = 0.01
"""A lower speed is refused: a task would take almost forever, so the value must be a mistake."""
MAX_HOLD_S = 3600.0
"""Most seconds of a path's hold at one waypoint."""
MAX_ANGULAR_SPEED_RAD_S = 1000.0
"""Of what is measured."""
MAX_STREAM_RATE_HZ = 1e9
WATCH_RATE_HZ = 10.0
"""Reports of a task in a second where a caller asks for none in particular."""
MAX_WATCH_RATE_HZ = 50.0
"""A UAV is updated as often: nothing changes in between, and one watcher must not take a core of the daemon."""
MAX_STAMP_S = 253_402_300_799.0
"""The end of the year 9999, the latest time in protobuf."""

_NORM_TOLERANCE = 0.05
"""A quaternion whose norm is within this of 1 counts as a rotation and is normalized."""


def refuse(field: str, message: str) -> InvalidArgumentError:
    """Makes the error for a field."""
    return InvalidArgumentError(f"{field}: {message}", {"field": field})


def require_type(value: object, kind: type, field: str) -> None:
    """Refuses a value of another type."""
    if not isinstance(value, kind):
        raise refuse(field, f"{_shown(value)} is not of type {kind.__name__}")


def _shown(value: object) -> str:
    """Returns a value of any type as one line of text."""
    return " ".join(repr(value).split())[:200]


def number(value: SupportsFloat, field: str, *, at_most: float) -> float:
    """Accepts a finite number with at most the given magnitude."""
    if isinstance(value, (str, bytes, bytearray, bool)):  # float() would take them
        raise refuse(field, f"{_shown(value)} is not a number")
    try:
        result = float(value)
    except OverflowError:  # an integer that is too large
        result = math.inf
    except (TypeError, ValueError):
        raise refuse(field, f"{_shown(value)} is not a number") from None
    if not math.isfinite(result):
        raise refuse(field, f"{result} is not a finite number")
    if abs(result) > at_most:
        bound = f"at most {at_most:.12g}" if result > 0.0 else f"at least {-at_most:.12g}"
        exact = repr(result).removesuffix(".0")  # fewer digits could be those of the bound
        raise refuse(field, f"{exact} is out of range ({bound})")
    return result


def not_negative(value: SupportsFloat, field: str, *, at_most: float) -> float:
    """Accepts a finite number of at least 0."""
    result = number(value, field, at_most=at_most)
    if result < 0.0:
        raise refuse(field, f"{result:g} is negative")
    return result


def watch_period_s(rate_hz: SupportsFloat) -> float:
    """Returns the seconds between two reports of a task, of which a rate of 0 leaves the choice to UAL."""
    rate_hz = not_negative(rate_hz, "rate_hz", at_most=MAX_STREAM_RATE_HZ) or WATCH_RATE_HZ
    return 1.0 / min(rate_hz, MAX_WATCH_RATE_HZ)


def positive(value: SupportsFloat, field: str, *, at_most: float) -> float:
    """Accepts a finite number above 0."""
    result = not_negative(value, field, at_most=at_most)
    if result == 0.0:
        raise refuse(field, "is zero; it must be more")
    return result


def max_speed(value: SupportsFloat | None) -> float | None:
    """Accepts a speed limit in m/s, or None."""
    if value is None:
        return None
    return _checked_speed(positive(value, "max_speed_m_s", at_most=MAX_SPEED_M_S), "max_speed_m_s")


def leg_speeds(values: Sequence[SupportsFloat], waypoint_count: int) -> list[float | None]:
    """Accepts one speed limit in m/s for each waypoint, or none at all. Returns None where there is none or it is 0."""
    fields = [f"leg_speeds_m_s[{i}]" for i in range(len(values))]
    speeds = [not_negative(each, field, at_most=MAX_SPEED_M_S) for each, field in zip(values, fields, strict=True)]
    if not speeds:
        return [None] * waypoint_count
    if len(speeds) != waypoint_count:
        raise refuse("leg_speeds_m_s", f"{len(speeds)} for {waypoint_count} waypoints; give one for each, or none")
    return [_checked_speed(speed, field) if speed else None for speed, field in zip(speeds, fields, strict=True)]


def holds(values: Sequence[SupportsFloat], waypoint_count: int) -> list[float]:
    """Accepts how long to hold at each waypoint, in seconds, or nothing at all."""
    found = [not_negative(each, f"holds_s[{i}]", at_most=MAX_HOLD_S) for i, each in enumerate(values)]
    if found and len(found) != waypoint_count:
        raise refuse("holds_s", f"{len(found)} for {waypoint_count} waypoints; give one for each, or none")
    return found or [0.0] * waypoint_count


def _checked_speed(speed_m_s: float, field: str) -> float:
    if speed_m_s < MIN_SPEED_M_S:
        raise refuse(field, f"{speed_m_s:g} is too slow (at least {MIN_SPEED_M_S:g})")
    return speed_m_s


def path_heading(value: PathHeading, *, has_point: bool) -> PathHeading:
    """Accepts where the nose points on a path. A point of interest must be given for POINT_OF_INTEREST only."""
    if not isinstance(value, PathHeading):
        known = ", ".join(heading.name for heading in PathHeading)
        raise refuse("heading", f"{_shown(value)} is not a PathHeading ({known})")
    if has_point and value is not PathHeading.POINT_OF_INTEREST:
        raise refuse("point_of_interest", f"is given, but the heading is {value.name}, not POINT_OF_INTEREST")
    if not has_point and value is PathHeading.POINT_OF_INTEREST:
        raise refuse("point_of_interest", "is not given, but the heading is POINT_OF_INTEREST")
    return value


def vector(value: Vector3, field: str, *, at_most: float) -> Vector3:
    """Accepts a vector of finite components with at most the given length."""
    if _is_valid(value, at_most):
        return value
    try:
        x, y, z = value
    except (TypeError, ValueError):
        raise refuse(field, f"{_shown(value)} is not a vector of three components") from None
    result = Vector3(
        number(x, f"{field}.x", at_most=at_most),
        number(y, f"{field}.y", at_most=at_most),
        number(z, f"{field}.z", at_most=at_most),
    )
    if result.norm() > at_most:
        raise refuse(field, f"its length {result.norm():g} is out of range (at most {at_most:g})")
    return result


def _is_valid(value: Vector3, at_most: float) -> bool:
    """Returns whether the value is valid as it is. Fast, because every setpoint needs it. A comparison with NaN is
    false.
    """
    return (
        type(value) is Vector3 and type(value.x) is type(value.y) is type(value.z) is float and value.norm() <= at_most
    )


def position(value: Vector3, field: str) -> Vector3:
    """Accepts a position in metres."""
    return vector(value, field, at_most=MAX_DISTANCE_M)


def rotation(value: Quaternion, field: str) -> Quaternion:
    """Accepts a unit quaternion; normalizes one whose norm is slightly off."""
    try:
        x, y, z, w = value
    except (TypeError, ValueError):
        raise refuse(field, f"{_shown(value)} is not a quaternion x, y, z, w") from None
    q = Quaternion(
        number(x, f"{field}.x", at_most=math.inf),
        number(y, f"{field}.y", at_most=math.inf),
        number(z, f"{field}.z", at_most=math.inf),
        number(w, f"{field}.w", at_most=math.inf),
    )
    norm = q.norm()
    if not abs(norm - 1.0) <= _NORM_TOLERANCE:
        raise refuse(field, f"({q.x:g}, {q.y:g}, {q.z:g}, {q.w:g}) is not a rotation: its norm is {norm:g}, not 1")
    return q.normalized()


def orientation(value: Quaternion, field: str) -> Quaternion | None:
    """Accepts a rotation. Returns None (keep the heading) for all zeros."""
    if value == KEEP_HEADING:
        return None
    return rotation(value, field)


def twist(value: Twist, field: str) -> Twist:
    """Accepts a velocity. Of its angular part only z is flown."""
    require_type(value, Twist, field)
    if _is_valid(value.linear, MAX_SPEED_M_S) and _is_valid(value.angular, MAX_TURN_RAD_S):
        return value
    linear = vector(value.linear, f"{field}.linear", at_most=MAX_SPEED_M_S)
    angular = vector(value.angular, f"{field}.angular", at_most=math.inf)
    if angular.norm() > MAX_TURN_RAD_S:
        words = f"({angular.x:g}, {angular.y:g}, {angular.z:g}) rad/s are more than two turns a second"
        raise refuse(f"{field}.angular", f"{words}: give radians, not degrees")
    return Twist(linear, angular)


def angle(value: SupportsFloat, field: str, *, at_most: float) -> float:
    """Accepts an angle in radians, or a rate in rad/s. What is more is meant in degrees."""
    result = number(value, field, at_most=math.inf)
    if abs(result) > at_most:
        raise refuse(field, f"{result:.12g} is out of range (at most {at_most:.5g}): give radians, not degrees")
    return result


def latitude(value: SupportsFloat, field: str = "latitude_deg") -> float:
    """Accepts degrees from -90 to 90."""
    return number(value, field, at_most=90.0)


def longitude(value: SupportsFloat, field: str = "longitude_deg") -> float:
    """Accepts degrees from -180 to 180."""
    return number(value, field, at_most=180.0)


def altitude_reference(value: AltitudeReference, field: str = "altitude_reference") -> AltitudeReference:
    """Accepts what an altitude is measured from; never guesses it."""
    if not isinstance(value, AltitudeReference):
        known = ", ".join(reference.name for reference in AltitudeReference)
        raise refuse(field, f"{_shown(value)} is not an AltitudeReference ({known})")
    return value


def heading(value: SupportsFloat, field: str) -> float:
    """Accepts a heading in radians of at most a full turn."""
    return geometry.heading(number(value, field, at_most=math.inf), field)


def geo_waypoint(value: GeoWaypoint, prefix: str = "") -> GeoWaypoint:
    """Accepts a geographic waypoint; `prefix` is put before the names of its fields in errors."""
    yaw_rad = value.yaw_rad
    return GeoWaypoint(
        latitude(value.latitude_deg, f"{prefix}latitude_deg"),
        longitude(value.longitude_deg, f"{prefix}longitude_deg"),
        number(value.altitude_m, f"{prefix}altitude_m", at_most=MAX_DISTANCE_M),
        altitude_reference(value.altitude_reference, f"{prefix}altitude_reference"),
        None if yaw_rad is None else heading(yaw_rad, f"{prefix}yaw_rad"),
    )


def frame_id(value: str, field: str) -> str:
    """Accepts the name of a frame: letters, digits and ``_``, parts joined by ``/``."""
    if not isinstance(value, str) or len(value) > 200 or not re.fullmatch(FRAME_ID_PATTERN, value):
        raise refuse(field, f"{str(value)[:200]!r} is not a frame name (letters, digits and _, parts joined by /)")
    return value


def transform(value: Transform, field: str) -> Transform:
    """Accepts a transform between named frames; an empty parent stays empty."""
    require_type(value, Transform, field)
    return Transform(
        position(value.translation, f"{field}.translation"),
        rotation(value.rotation, f"{field}.rotation"),
        frame_id(value.frame_id, f"{field}.header.frame_id") if value.frame_id else "",
        frame_id(value.child_frame_id, f"{field}.child_frame_id"),
        not_negative(value.stamp_s, f"{field}.header.stamp", at_most=MAX_STAMP_S),
    )


def short_text(value: str, field: str, *, at_most: int = 64) -> str:
    """Accepts one line of printable text."""
    require_type(value, str, field)
    if not value.isprintable() or len(value) > at_most:
        raise refuse(field, f"{_shown(value)} is not one line of at most {at_most} printable characters")
    return value
