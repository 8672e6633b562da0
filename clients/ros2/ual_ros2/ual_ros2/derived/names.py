"""Fields of requests that UAL calls otherwise than ROS.

``make proto`` writes this file: do not edit it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

NAMES: Final[Mapping[str, tuple[str, ...]]] = {
    "accept_radius_m": ("accept_radius",),
    "action": ("camera_action",),
    "altitude_m": ("altitude", "waypoint.altitude"),
    "corner_radius_m": ("corner_radius",),
    "delay_s": ("delay",),
    "distance_m": ("distance",),
    "duration_s": ("duration",),
    "height_m": ("height",),
    "hold_s": ("hold",),
    "holds_s": ("holds",),
    "interval_s": ("interval",),
    "latitude_deg": ("place.latitude", "waypoint.latitude"),
    "leg_speeds_m_s": ("leg_speeds",),
    "length_m": ("length",),
    "longitude_deg": ("place.longitude", "waypoint.longitude"),
    "max_age_s": ("max_age",),
    "max_speed_m_s": ("max_speed",),
    "orientation_std_dev_rad": ("orientation_std_dev",),
    "percent": ("focus", "zoom"),
    "period_s": ("period",),
    "pitch_rad": ("pitch",),
    "pitch_rad_s": ("pitch",),
    "position_m": ("position",),
    "position_std_dev_m": ("position_std_dev",),
    "power_ratio": ("power",),
    "radius_m": ("radius",),
    "rate_m_s": ("rate",),
    "remaining_percent": ("remaining",),
    "roll_rad": ("roll",),
    "seconds": ("hold",),
    "speed_m_s": ("speed",),
    "velocity_m_s": ("velocity",),
    "yaw_rad": ("yaw",),
    "yaw_rad_s": ("yaw",),
}
