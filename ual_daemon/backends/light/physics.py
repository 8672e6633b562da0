"""What both ways to move vehicles (`fleet.Fleet` many, `single.Single` one) share: modes, and the laws' numbers."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any, NamedTuple

from ual_daemon.backends.light.settings import LightSettings

STEP_S = 0.02
"""The step of simulated time: 50 Hz, as fast as setpoints are useful."""

SETPOINT_TIMEOUT_S = 1.0
"""An autopilot that gets no setpoint for so long while it follows ours holds its position by itself (PX4: 1.2 s)."""

POSITION_GAIN = 1.5
YAW_GAIN = 2.0
WIND_DRAG = 0.1
"""Acceleration by wind, 1/s times its speed; a small multirotor's drag against what its controller must make up."""
COMMAND_HEADROOM = 1.25
"""How far velocity commands may go beyond the speed limits, so that the limits can be held exactly."""
LIFT_OFF_M = 0.05
LANDED_AFTER_S = 0.5
LANDED_DRAIN = 0.05
"""What a motor takes on the ground of what it takes in flight."""
TINY = 1e-9
NEVER_TOLD = -1


class FlightMode(IntEnum):
    """The modes of the simulated autopilot."""

    MANUAL = 0
    GUIDED = 1
    HOLD = 2
    LAND = 3
    ALTITUDE = 4
    """Holds the height only: what is left of guided flight and hold without a position."""


class Seen(NamedTuple):
    """What one autopilot says of itself."""

    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    yaw: float
    yaw_rate: float
    mode: int
    is_armed: bool
    is_landed: bool
    has_position: bool
    battery_percent: float


def beginning(settings: LightSettings) -> dict[str, Any]:
    """The row of a vehicle that stands on the ground, disarmed; what is not in it is zero."""
    return {
        "position": settings.start,
        "yaw": settings.start_yaw_rad,
        "mode": int(FlightMode.HOLD),
        "is_landed": True,
        "battery_percent": settings.battery_percent,
        "setpoint_s": -math.inf,
        "hold": settings.start,
        "ground": settings.start[2],
        "wind": settings.wind_m_s,
        "power": 1.0,
        "has_position": True,
        "told": NEVER_TOLD,
        "horizontal_speed": settings.horizontal_speed_m_s,
        "vertical_speed": settings.vertical_speed_m_s,
        "horizontal_acceleration": settings.horizontal_acceleration_m_s2,
        "vertical_acceleration": settings.vertical_acceleration_m_s2,
        "max_yaw_rate": settings.yaw_rate_rad_s,
        "response_s": settings.response_s,
        "landing_speed": settings.landing_speed_m_s,
        "disarm_after_s": settings.disarm_after_landing_s,
        "endurance_s": settings.battery_endurance_s,
    }
