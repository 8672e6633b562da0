"""Bounds of plausible data of an autopilot. Data beyond that are dropped; what they replace becomes old by itself."""

from __future__ import annotations

import logging
import math
from collections import Counter

from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import Battery, GeoPoint
from ual_daemon.validation import MAX_ANGULAR_SPEED_RAD_S, MAX_DISTANCE_M, MAX_SPEED_M_S

_log = logging.getLogger(__name__)

MAX_ALTITUDE_M = 100_000.0
"""Above this is space."""
MAX_GEOID_SEPARATION_M = 200.0
"""Between the ellipsoid and mean sea level; on Earth it is between -107 and 86 m."""
MAX_PARAMETER_VALUE = 1e7
"""Of the parameters that are used: speeds, accelerations and jerks, in m or cm."""
NORM_TOLERANCE = 0.05
"""A quaternion whose norm is within this of 1 is a rotation."""


class Plausibility:
    """Judges data, counts those that cannot be true, and logs the first of each kind. No comparison with NaN holds."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        """Dropped data, of each kind."""

    def accepts_position(self, position: Vector3) -> bool:
        """Judges a position in the local frame."""
        norm = math.hypot(position.x, position.y, position.z)
        return norm <= MAX_DISTANCE_M or self._drop("position", f"of {norm:.3g} m")

    def accepts_velocity(self, velocity: Vector3) -> bool:
        """Judges a velocity."""
        norm = math.hypot(velocity.x, velocity.y, velocity.z)
        return norm <= MAX_SPEED_M_S or self._drop("velocity", f"of {norm:.3g} m/s")

    def accepts_motion(self, pose: Pose, velocity: Twist) -> bool:
        """Judges a pose and the velocity that came with it."""
        is_pose = self.accepts_position(pose.position) and self.accepts_rotation(pose.orientation)
        return is_pose and self.accepts_velocity(velocity.linear) and self.accepts_rates(velocity.angular)

    def accepts_rates(self, rates: Vector3) -> bool:
        """Judges angular speeds."""
        norm = math.hypot(rates.x, rates.y, rates.z)
        return norm <= MAX_ANGULAR_SPEED_RAD_S or self._drop("angular velocity", f"of {norm:.3g} rad/s")

    def accepts_rotation(self, rotation: Quaternion) -> bool:
        """Judges a quaternion before it is normalized."""
        return self.accepts_norm(rotation.norm())

    def accepts_norm(self, norm: float) -> bool:
        """Judges the norm of a quaternion."""
        return abs(norm - 1.0) <= NORM_TOLERANCE or self._drop("attitude", f"with a quaternion of norm {norm:.3g}")

    def accepts_angles(self, roll_rad: float, pitch_rad: float, yaw_rad: float) -> bool:
        """Judges an attitude in angles."""
        is_possible = all(abs(each) <= math.tau for each in (roll_rad, pitch_rad, yaw_rad))
        return is_possible or self._drop("attitude", f"of {roll_rad:.3g}, {pitch_rad:.3g}, {yaw_rad:.3g} rad")

    def accepts_geo_position(self, latitude_deg: float, longitude_deg: float) -> bool:
        """Judges a place on Earth."""
        is_on_earth = -90.0 <= latitude_deg <= 90.0 and -180.0 <= longitude_deg <= 180.0
        return is_on_earth or self._drop("place", f"at latitude {latitude_deg:.7g}, longitude {longitude_deg:.7g}")

    def accepts_altitude(self, altitude_m: float) -> bool:
        """Judges an altitude above whatever."""
        return -MAX_ALTITUDE_M <= altitude_m <= MAX_ALTITUDE_M or self._drop("altitude", f"of {altitude_m:.3g} m")

    def accepts_geo_point(self, point: GeoPoint) -> bool:
        """Judges a position on Earth."""
        amsl_m, home_m = point.altitude_amsl_m, point.altitude_home_m
        return (
            self.accepts_geo_position(point.latitude_deg, point.longitude_deg)
            and (amsl_m is None or self.accepts_altitude(amsl_m))
            and (home_m is None or self.accepts_altitude(home_m))
        )

    def accepts_geoid_separation(self, separation_m: float) -> bool:
        """Judges how far mean sea level is from the ellipsoid."""
        is_possible = abs(separation_m) <= MAX_GEOID_SEPARATION_M
        return is_possible or self._drop("geoid separation", f"of {separation_m:.3g} m")

    def accepts_battery(self, battery: Battery) -> bool:
        """Judges a battery's charge."""
        percent = battery.remaining_percent
        return percent is None or 0.0 <= percent <= 100.0 or self._drop("battery", f"with {percent:g} %")

    def accepts_parameter(self, name: str, value: float) -> bool:
        """Judges the value of a parameter that is used."""
        is_possible = math.isfinite(value) and abs(value) <= MAX_PARAMETER_VALUE
        return is_possible or self._drop("parameter", f"{name} of {value:.3g}")

    def _drop(self, kind: str, what: str) -> bool:
        if not self.counts[kind]:
            _log.warning("dropped: %s %s cannot be true; more like it are counted, not logged", kind, what)
        self.counts[kind] += 1
        return False
