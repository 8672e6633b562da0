"""Distance of mean sea level from the ellipsoid, as MAVROS has added it to each altitude."""

from __future__ import annotations

from collections import deque
from statistics import median

_ESTIMATES_COUNT = 9
_MOST_SEPARATION_M = 200.0


class Geoid:
    """The separation between the ellipsoid and mean sea level at this place.

    Autopilots send altitudes above mean sea level. MAVROS adds the separation of its own model (EGM96) to all that it
    publishes as positions on Earth, and does not say how much. But some topics have the altitude as it came:
    ``gpsstatus/gps1/raw`` exactly (mavros_extras), ``vfr_hud`` of the same estimate as ``global_position/global``.
    """

    def __init__(self) -> None:
        self._exact_m: float | None = None
        self._estimates_m: deque[float] = deque(maxlen=_ESTIMATES_COUNT)

    @property
    def separation_m(self) -> float | None:
        """The separation in metres; None while it is not known."""
        if self._exact_m is not None:
            return self._exact_m
        return median(self._estimates_m) if len(self._estimates_m) == _ESTIMATES_COUNT else None

    def on_exact(self, ellipsoid_m: float, amsl_m: float) -> None:
        """Takes one altitude as MAVROS publishes it, and as the autopilot sent it."""
        if abs(ellipsoid_m - amsl_m) <= _MOST_SEPARATION_M:
            self._exact_m = ellipsoid_m - amsl_m

    def on_estimate(self, ellipsoid_m: float, amsl_m: float) -> None:
        """Takes two altitudes of the same estimate, of about the same time."""
        if abs(ellipsoid_m - amsl_m) <= _MOST_SEPARATION_M:
            self._estimates_m.append(ellipsoid_m - amsl_m)

    def amsl_m(self, ellipsoid_m: float) -> float | None:
        """Returns the altitude above mean sea level of one that MAVROS published; None while that is not known."""
        separation_m = self.separation_m
        return None if separation_m is None else ellipsoid_m - separation_m
