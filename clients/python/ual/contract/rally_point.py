"""A rally point: by hand, as a message has its reference as a flag."""

from __future__ import annotations

from dataclasses import dataclass

from ual.types import AltitudeReference


@dataclass(frozen=True, slots=True)
class RallyPoint:
    """A place to which an autopilot may return instead of its home.

    `height_m` is whole, as ArduPilot keeps it: above home, or above mean sea level.
    """

    latitude_deg: float
    longitude_deg: float
    height_m: int
    reference: AltitudeReference = AltitudeReference.HOME
