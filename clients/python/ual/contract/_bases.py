"""Behaviour of the contract's values besides holding their fields: ``XBase`` is a base of the value ``X``."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields
from enum import Enum
from typing import TYPE_CHECKING, Any

from typing_extensions import Self, override

from ual.geometry import Quaternion

_UNTOLD: tuple[object, ...] = (None, "", ())
_EARTH_M = 6_371_000.0
_WHOLE_LIMITS = {
    "UINT8": (0, 2**8 - 1),
    "INT8": (-(2**7), 2**7 - 1),
    "UINT16": (0, 2**16 - 1),
    "INT16": (-(2**15), 2**15 - 1),
    "UINT32": (0, 2**32 - 1),
    "INT32": (-(2**31), 2**31 - 1),
}


class TelemetryBase:
    """A sample, whose fields may be made when they are first read. Any thread may be the first."""

    __slots__ = ("_make",)

    @classmethod
    def late(cls, make: Callable[[str], object], **known: object) -> Self:
        """A value with these fields; each other one is made by its name."""
        new = object.__new__(cls)
        object.__setattr__(new, "_make", make)
        for name, value in known.items():
            object.__setattr__(new, name, value)
        return new

    if not TYPE_CHECKING:  # to a type checker, any name would be a field

        def __getattr__(self, name: str) -> object:
            """Python asks here for what is not there."""
            if name not in self.__dataclass_fields__:
                text = f"{type(self).__name__!r} object has no attribute {name!r}"
                raise AttributeError(text, name=name, obj=self)  # with both, Python says "Did you mean"
            value = self._make(name)
            object.__setattr__(self, name, value)
            return value

    @override
    def __repr__(self) -> str:
        """Returns the known values, a line for each field."""
        value: Any = self  # its fields are those of the value
        lines = (
            f"  {each.name}={part!r}," for each in fields(value) if (part := getattr(self, each.name)) not in _UNTOLD
        )
        return "\n".join(("Telemetry(", *lines, ")"))


class CameraIntrinsicsBase:
    """A pinhole camera."""

    __slots__ = ()

    @classmethod
    def of_view(cls, width_px: int, height_px: int, horizontal_view_rad: float) -> Self:
        """Returns those of square pixels, whose rows see this angle from the left edge to the right one."""
        make: Any = cls  # its fields are those of the value
        focal_px = 0.5 * width_px / math.tan(0.5 * horizontal_view_rad)
        made: Self = make(width_px, height_px, focal_px, focal_px, 0.5 * (width_px - 1), 0.5 * (height_px - 1))
        return made


class AngleRangeBase:
    """The limits of an axis."""

    __slots__ = ()

    least_rad: float
    most_rad: float

    def nearest(self, angle_rad: float) -> float:
        """Returns the angle within it that is nearest."""
        return min(max(angle_rad, self.least_rad), self.most_rad)


class GimbalAnglesBase:
    """Angles of a gimbal."""

    __slots__ = ()

    roll_rad: float
    pitch_rad: float
    yaw_rad: float

    @property
    def orientation(self) -> Quaternion:
        """The same as a rotation: x along its view, y left, z up."""
        return Quaternion.from_euler(self.roll_rad, self.pitch_rad, self.yaw_rad)


class ParameterTypeBase(Enum):
    """Type in which an autopilot keeps a parameter."""

    @property
    def is_whole(self) -> bool:
        """Whether its values are integers."""
        return self.name in _WHOLE_LIMITS

    @property
    def limits(self) -> tuple[float, float]:
        """The least and the largest value."""
        from ual.shared.real32 import LARGEST_REAL32  # imported late: `import ual` has the bases

        return _WHOLE_LIMITS.get(self.name, (-LARGEST_REAL32, LARGEST_REAL32))


class ParameterBase:
    """A parameter. Its value is an int where its type is whole."""

    __slots__ = ()

    value: float
    type: ParameterTypeBase

    def __post_init__(self) -> None:
        if isinstance(self.value, float) and self.type.is_whole and self.value.is_integer():
            object.__setattr__(self, "value", int(self.value))

    @property
    def text(self) -> str:
        """The value, as short as it can be written without becoming another one."""
        from ual.shared.real32 import real32_text

        return str(int(self.value)) if self.type.is_whole else real32_text(self.value)


class LogChunkBase:
    """A piece of a log."""

    __slots__ = ()

    offset: int
    data: bytes

    @property
    def end(self) -> int:
        """Offset of the next piece."""
        return self.offset + len(self.data)


class FenceZoneBase:
    """A polygon or a circle of a fence."""

    __slots__ = ()

    is_inclusion: bool
    points: tuple[tuple[float, float], ...]
    radius_m: float | None

    @property
    def text(self) -> str:
        """Human-readable."""
        kind = "inclusion" if self.is_inclusion else "exclusion"
        if self.radius_m is None:
            return f"{kind} polygon of {len(self.points)} corners"
        return f"{kind} circle of {self.radius_m:g} m"

    def encloses(self, latitude_deg: float, longitude_deg: float) -> bool:
        """Returns whether a place is in its polygon or its circle. A side is straight in latitude and longitude."""
        if self.radius_m is not None:
            return _away_m(*self.points[0], latitude_deg, longitude_deg) <= self.radius_m
        is_in = False
        for i, (a_lat, a_lon) in enumerate(self.points):
            b_lat, b_lon = self.points[i - 1]
            if (a_lon > longitude_deg) != (b_lon > longitude_deg):
                share = (longitude_deg - a_lon) / (b_lon - a_lon)
                is_in ^= latitude_deg < a_lat + (b_lat - a_lat) * share
        return is_in


def _away_m(a_lat: float, a_lon: float, b_lat: float, b_lon: float) -> float:
    """Returns the distance of two places along a sphere."""
    a, b = math.radians(a_lat), math.radians(b_lat)
    half = math.sin((b - a) / 2.0) ** 2
    half += math.cos(a) * math.cos(b) * math.sin(math.radians(b_lon - a_lon) / 2.0) ** 2
    return 2.0 * _EARTH_M * math.asin(min(1.0, math.sqrt(half)))
