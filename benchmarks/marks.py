"""Numbers that travel inside MAVLink messages, by which a message that arrives is known for the one that was sent.

A setpoint carries its number in its speed to the north, a position in its distance to the north; both are exact in the
32-bit floating point numbers of MAVLink, and small enough for any autopilot to believe them.
"""

from __future__ import annotations

_SPEED_STEP_M_S = 2.0**-22
_SPEED_M_S = 1.0
SETPOINTS = 1 << 22
"""How many setpoints can be told apart."""
_DISTANCE_STEP_M = 2.0**-12
POSITIONS = 1 << 18
"""How many positions can be told apart."""


def speed_m_s(number: int) -> float:
    """The speed that says a number: 1 to 2 m/s."""
    return _SPEED_M_S + number % SETPOINTS * _SPEED_STEP_M_S


def number_of_speed(speed_m_s: float) -> int:
    """The number that a speed says; negative for a speed that says none."""
    return round((speed_m_s - _SPEED_M_S) / _SPEED_STEP_M_S)


def distance_m(number: int) -> float:
    """The distance that says a number: 0 to 64 m."""
    return number % POSITIONS * _DISTANCE_STEP_M


def number_of_distance(distance_m: float) -> int:
    """The number that a distance says."""
    return round(distance_m / _DISTANCE_STEP_M)
