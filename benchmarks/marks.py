"""Numbers inside MAVLink messages, by which a message that arrives can be matched with the one that was sent.

A position carries its number in its distance to the north. A setpoint of UAL carries it in its yaw rate, and one of the
other ways in its speed to the north. What UAL sends is a velocity that is corrected (decision 21), but no corrected yaw
rate while the UAV is to turn. All are exact in MAVLink's 32-bit floating point numbers, and plausible to an autopilot.
"""

from __future__ import annotations

_SPEED_STEP_M_S = 2.0**-22
_SPEED_M_S = 1.0
SETPOINTS = 1 << 22
"""Setpoints with different numbers."""
_YAW_RATE_STEP_RAD_S = 2.0**-24
_YAW_RATE_RAD_S = 0.25
_DISTANCE_STEP_M = 2.0**-12
POSITIONS = 1 << 18
"""Positions with different numbers."""


def speed_m_s(number: int) -> float:
    """Converts a number to a speed of 1 to 2 m/s."""
    return _SPEED_M_S + number % SETPOINTS * _SPEED_STEP_M_S


def number_of_speed(speed_m_s: float) -> int:
    """Converts a speed to its number; negative for a speed without a number."""
    return round((speed_m_s - _SPEED_M_S) / _SPEED_STEP_M_S)


def yaw_rate_rad_s(number: int) -> float:
    """Converts a number to a yaw rate of 0.25 to 0.5 rad/s."""
    return _YAW_RATE_RAD_S + number % SETPOINTS * _YAW_RATE_STEP_RAD_S


def number_of_yaw_rate(yaw_rate_rad_s: float) -> int:
    """Converts a yaw rate, in either direction, to its number; negative for one without a number."""
    return round((abs(yaw_rate_rad_s) - _YAW_RATE_RAD_S) / _YAW_RATE_STEP_RAD_S)


def number_of_setpoint(speed_m_s: float, yaw_rate_rad_s: float) -> int:
    """Converts what a setpoint commands to its number; negative for one without a number."""
    return number_of_yaw_rate(yaw_rate_rad_s) if yaw_rate_rad_s else number_of_speed(speed_m_s)


def distance_m(number: int) -> float:
    """Converts a number to a distance of 0 to 64 m."""
    return number % POSITIONS * _DISTANCE_STEP_M


def number_of_distance(distance_m: float) -> int:
    """Converts a distance to its number."""
    return round(distance_m / _DISTANCE_STEP_M)
