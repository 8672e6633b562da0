"""Zones and rally points of an autopilot's fence, anywhere on Earth (WGS 84)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ual.types import AltitudeReference

_EARTH_M = 6_371_000.0


@dataclass(frozen=True, slots=True)
class FenceZone:
    """A polygon or a circle: to be kept inside (an inclusion) or outside of.

    `points` are latitude and longitude in degrees. They are the corners of a polygon in order, whose last side leads
    back to the first, or the one centre of a circle, which has a radius.
    """

    is_inclusion: bool
    points: tuple[tuple[float, float], ...]
    radius_m: float | None = None

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


@dataclass(frozen=True, slots=True)
class RallyPoint:
    """A place to which an autopilot may return instead of its home.

    `height_m` is whole, as ArduPilot keeps it: above home, or above mean sea level.
    """

    latitude_deg: float
    longitude_deg: float
    height_m: int
    reference: AltitudeReference = AltitudeReference.HOME


@dataclass(frozen=True, slots=True)
class FencePlan:
    """What an autopilot is to keep. Without rally points, those that it has stay."""

    zones: tuple[FenceZone, ...]
    rally_points: tuple[RallyPoint, ...] = ()


@dataclass(frozen=True, slots=True)
class KeptFence:
    """What an autopilot keeps. `is_enabled` is whether it applies its zones; None where it does not say."""

    zones: tuple[FenceZone, ...]
    rally_points: tuple[RallyPoint, ...] = ()
    is_enabled: bool | None = None


def leaves_out(
    zones: Sequence[FenceZone], latitude_deg: float, longitude_deg: float, *, unites_inclusions: bool = False
) -> str:
    """Returns which of some zones forbids a place, human-readable; empty where none does.

    With `unites_inclusions` it is enough to be in one inclusion, as with ArduPilot's FENCE_OPTIONS.
    """
    inclusions = [each for each in zones if each.is_inclusion]
    outside = [each for each in inclusions if not each.encloses(latitude_deg, longitude_deg)]
    if outside and (not unites_inclusions or len(outside) == len(inclusions)):
        return f"it is outside the {outside[0].text}"
    inside = (each for each in zones if not each.is_inclusion and each.encloses(latitude_deg, longitude_deg))
    return next((f"it is inside the {each.text}" for each in inside), "")


def _away_m(a_lat: float, a_lon: float, b_lat: float, b_lon: float) -> float:
    """Returns the distance of two places along a sphere."""
    a, b = math.radians(a_lat), math.radians(b_lat)
    half = math.sin((b - a) / 2.0) ** 2
    half += math.cos(a) * math.cos(b) * math.sin(math.radians(b_lon - a_lon) / 2.0) ** 2
    return 2.0 * _EARTH_M * math.asin(min(1.0, math.sqrt(half)))
