"""The errors for arguments of the wrong type: they name the argument, what came, and what to pass.

The class interface and both clients raise them before anything is sent. Values of the right type (NaN, magnitudes) are
checked by the daemon.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from enum import Enum
from typing import Any, SupportsFloat, SupportsIndex

from ual.errors import InvalidArgumentError
from ual.shared.flags import SWITCHES, is_flag, shown

_EXAMPLES = {
    "GeoWaypoint": "ual.GeoWaypoint(latitude_deg, longitude_deg, altitude_m)",
    "PointStamped": "ual.Vector3(x, y, z)",
    "Pose": "ual.Pose.at(x, y, z)",
    "PoseStamped": "ual.Pose.at(x, y, z)",
    "Quaternion": "ual.Quaternion.from_yaw(yaw_rad)",
    "Transform": "ual.Transform(ual.Vector3(x, y, z), child_frame_id=name)",
    "Twist": "ual.Twist(ual.Vector3(x, y, z))",
    "TwistStamped": "ual.Twist(ual.Vector3(x, y, z))",
    "Vector3": "ual.Vector3(x, y, z)",
}


def wrong_type(value: object, wanted: type, field: str) -> InvalidArgumentError:
    """Makes the error for a value that is not of the type `wanted`, with an example of one that is."""
    example = _EXAMPLES.get(wanted.__name__, f"a {wanted.__name__}")
    return InvalidArgumentError(
        f"{field}: {shown(value)} is of type {type(value).__name__}; pass {example}", {"field": field}
    )


def require(value: object, wanted: type, field: str) -> None:
    """Raises `InvalidArgumentError` unless the value is of the type `wanted`."""
    if not isinstance(value, wanted):
        raise wrong_type(value, wanted, field)


def wrong_part(request: object, field: str, error: Exception) -> InvalidArgumentError:
    """Makes the error for a request that could not be sent because of `error`.

    It names the part that is no number, no text or no member of its enum. A setpoint or a transform is itself the
    `field`; the request of a task contains the field.
    """
    for name, part, kind in _parts(request, _root(field)):
        if not _fits(part, kind):
            return _misfit(name, part, kind)
        number = _as_float(part) if kind.startswith("float") else None
        if number is not None and not math.isfinite(number):
            return InvalidArgumentError(f"{name}: {number} is not a finite number", {"field": name})
    return InvalidArgumentError(f"{field}: {error}", {"field": field})


def require_parts(request: object, field: str) -> None:
    """Raises `InvalidArgumentError` where protobuf takes a part for what it is not: True for 1, bytes for a text."""
    for name, part, kind in _parts(request, _root(field)):
        if not _fits(part, kind):
            raise _misfit(name, part, kind)


def _root(field: str) -> str:
    return field if field in ("pose", "velocity", "transform") else ""


def _misfit(name: str, part: object, kind: str) -> InvalidArgumentError:
    return InvalidArgumentError(f"{name}: {shown(part)} is not {_KINDS[kind]}", {"field": name})


_KINDS = {
    "bool": SWITCHES,
    "float": "a number",
    "float | None": "a number",
    "str": "a text",
    "Sequence[float]": "a list of numbers",
    "PathHeading": "a PathHeading",
    "AltitudeReference": "an AltitudeReference",
}


def _parts(value: object, name: str, kind: str = "") -> Iterator[tuple[str, object, str]]:
    """Yields name, value and declared type of each part of a request that holds a single value."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        inside = "" if type(value).__name__ == "GeoWaypoint" and name == "waypoint" else name
        for each in dataclasses.fields(value):
            part_name = f"{inside}.{each.name}" if inside else each.name
            yield from _parts(getattr(value, each.name), part_name, str(each.type))
    elif kind.startswith("Sequence") and isinstance(value, (list, tuple)):
        for i, part in enumerate(value):
            yield from _parts(part, f"{name}[{i}]", "float")
    elif kind in _KINDS:
        yield name, value, kind


def _fits(value: object, kind: str) -> bool:
    if kind == "str":
        return isinstance(value, str)
    if kind == "bool":
        return is_flag(value)
    if kind in ("PathHeading", "AltitudeReference"):
        return isinstance(value, Enum) and type(value).__name__ == kind
    if value is None:
        return kind.endswith("None")
    if type(value) is float:
        return True
    is_number = isinstance(value, (SupportsFloat, SupportsIndex)) and not isinstance(value, bool)
    return is_number and kind.startswith("float") and _as_float(value) is not None


def _as_float(value: Any) -> float | None:  # noqa: ANN401 (whatever may be one number)
    """Returns a number; None where it only looks like one, as an array of several does."""
    try:
        return float(value)
    except OverflowError:  # an integer that no float can be
        return math.inf
    except (TypeError, ValueError):
        return None
