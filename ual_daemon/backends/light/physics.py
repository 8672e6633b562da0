"""Modes and constants that both simulations share: `fleet.Fleet` for many vehicles, `single.Single` for one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import Any, TypeAlias

from ual_daemon.backends.light.settings import LightSettings

SIM_STEP_S = 0.02
"""The step of simulated time: 50 Hz. Faster setpoints would not help."""

SETPOINT_TIMEOUT_S = 1.0
"""An autopilot in GUIDED that gets no setpoint for this long holds its position by itself (PX4: 1.2 s)."""

POSITION_GAIN = 1.5
YAW_GAIN = 2.0
WIND_DRAG = 0.1
"""Acceleration by wind in 1/s, times the wind's speed: the drag of a small multirotor, for which its controller has to
compensate.
"""
GRAVITY_M_S2 = 9.81
COMMAND_SPEED_FACTOR = 1.25
"""Velocity commands may exceed the speed limits by this factor, so that the vehicle can reach the limits exactly."""
LIFT_OFF_M = 0.05
LANDED_AFTER_S = 0.5
LANDED_DRAIN_SHARE = 0.05
"""The battery drain on the ground with motors running, as a part of the drain in flight."""
LEAST_LIMIT_VALUE = 1e-9
NO_CONDITIONS_CODE = -1


class FlightMode(IntEnum):
    """The modes of the simulated autopilot."""

    MANUAL = 0
    GUIDED = 1
    HOLD = 2
    LAND = 3
    ALTITUDE = 4
    """Holds only the height. GUIDED and HOLD change to this when the position is lost."""


LightReport: TypeAlias = tuple[Sequence[float], Sequence[float], float, float, int, bool, bool, bool, float]
"""Report of one autopilot: position, velocity, yaw, yaw rate, mode, whether it is armed, is landed, and has a
position, and the percent of its battery. A plain tuple, as columns of numpy give them.
"""


def initial_row(settings: LightSettings) -> dict[str, Any]:
    """Returns the row of a vehicle that stands on the ground, disarmed. Columns that are missing are zero."""
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
        "reported_conditions": NO_CONDITIONS_CODE,
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
