"""What may be asked at all: every input is checked here, once, before anything else looks at it.

Each function returns the clean value, or raises `InvalidArgumentError` that names the field and the value.
"""

from __future__ import annotations

import math
import re
from typing import SupportsFloat

from ual.errors import InvalidArgumentError
from ual.geometry import KEEP_HEADING, Quaternion, Transform, Twist, Vector3
from ual.types import AltitudeReference
from ual_daemon.settings import FRAME_ID_PATTERN

MAX_DISTANCE_M = 1e7
MAX_SPEED_M_S = 1000.0
MAX_TURN_RATE_RAD_S = 1000.0
MAX_ANGLE_RAD = 1e6

_NORM_TOLERANCE = 0.05
"""How far from 1 the norm of a quaternion may be to count as a rotation slightly off."""


def refuse(field: str, message: str) -> InvalidArgumentError:
    """The error of a field."""
    return InvalidArgumentError(f"{field}: {message}", {"field": field})


def require_type(value: object, kind: type, field: str) -> None:
    """Refuses what is of another type."""
    if not isinstance(value, kind):
        raise refuse(field, f"{_shown(value)} is no {kind.__name__}")


def _shown(value: object) -> str:
    """A value of any type in one line."""
    return " ".join(repr(value).split())[:200]


def number(value: SupportsFloat, field: str, *, at_most: float) -> float:
    """A finite number, not beyond a magnitude."""
    if isinstance(value, (str, bytes, bytearray)):  # float() would read them
        raise refuse(field, f"{_shown(value)} is not a number")
    try:
        result = float(value)
    except OverflowError:  # an integer
        result = math.inf
    except (TypeError, ValueError):
        raise refuse(field, f"{_shown(value)} is not a number") from None
    if not math.isfinite(result):
        raise refuse(field, f"{result} is not a finite number")
    if abs(result) > at_most:
        raise refuse(field, f"{result:g} is beyond what can be meant (at most {at_most:g})")
    return result


def not_negative(value: SupportsFloat, field: str, *, at_most: float) -> float:
    """A finite number from 0."""
    result = number(value, field, at_most=at_most)
    if result < 0.0:
        raise refuse(field, f"{result:g} is negative")
    return result


def positive(value: SupportsFloat, field: str, *, at_most: float) -> float:
    """A finite number above 0."""
    result = not_negative(value, field, at_most=at_most)
    if result == 0.0:
        raise refuse(field, "is zero; it must be more")
    return result


def vector(value: Vector3, field: str, *, at_most: float) -> Vector3:
    """A vector of finite components, its length not beyond a magnitude."""
    if type(value) is Vector3 and type(value.x) is type(value.y) is type(value.z) is float and value.norm() <= at_most:
        return value  # the usual case, fast: no comparison with NaN is true
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
        raise refuse(field, f"its length {result.norm():g} is beyond what can be meant (at most {at_most:g})")
    return result


def position(value: Vector3, field: str) -> Vector3:
    """A position in metres."""
    return vector(value, field, at_most=MAX_DISTANCE_M)


def rotation(value: Quaternion, field: str) -> Quaternion:
    """A unit quaternion; one slightly off is normalized."""
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
        raise refuse(field, f"({q.x:g}, {q.y:g}, {q.z:g}, {q.w:g}) is no rotation: its norm is {norm:g}, not 1")
    return q.normalized()


def orientation(value: Quaternion, field: str) -> Quaternion | None:
    """A rotation, or None (keep the heading) for exactly all zeros."""
    if value == KEEP_HEADING:
        return None
    return rotation(value, field)


def twist(value: Twist, field: str) -> Twist:
    """A velocity; of its turn, only the part about z is flown."""
    require_type(value, Twist, field)
    return Twist(
        vector(value.linear, f"{field}.linear", at_most=MAX_SPEED_M_S),
        vector(value.angular, f"{field}.angular", at_most=MAX_TURN_RATE_RAD_S),
    )


def latitude(value: SupportsFloat) -> float:
    """Degrees, -90 to 90."""
    return number(value, "latitude_deg", at_most=90.0)


def longitude(value: SupportsFloat) -> float:
    """Degrees, -180 to 180."""
    return number(value, "longitude_deg", at_most=180.0)


def altitude_reference(value: AltitudeReference) -> AltitudeReference:
    """What an altitude is measured from: none is guessed."""
    if not isinstance(value, AltitudeReference):
        known = ", ".join(reference.name for reference in AltitudeReference)
        raise refuse("altitude_reference", f"{_shown(value)} is no AltitudeReference ({known})")
    return value


def frame_id(value: str, field: str) -> str:
    """A name for a frame: words of letters, digits and _, joined by /."""
    if not isinstance(value, str) or len(value) > 200 or not re.fullmatch(FRAME_ID_PATTERN, value):
        raise refuse(field, f"{str(value)[:200]!r} is no frame name (letters, digits and _, parts joined by /)")
    return value


def transform(value: Transform, field: str) -> Transform:
    """A transform between named frames; an empty parent is left empty."""
    require_type(value, Transform, field)
    return Transform(
        position(value.translation, f"{field}.translation"),
        rotation(value.rotation, f"{field}.rotation"),
        frame_id(value.frame_id, f"{field}.header.frame_id") if value.frame_id else "",
        frame_id(value.child_frame_id, f"{field}.child_frame_id"),
        value.stamp_s,
    )
