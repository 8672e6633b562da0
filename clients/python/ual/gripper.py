"""Payload devices of a UAV that hold, drop and switch: grippers, winches, servos and relays.

As values, from ``gripper.proto``. ``make proto`` writes this file: do not edit it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class GripperState(Enum):
    """State of a gripper by the autopilot.

    Neither PX4 nor ArduPilot has a sensor for it: "closed" means that its servo was sent there, and had the time.
    """

    UNKNOWN = 1
    """The autopilot does not report it, or has not reported it since the last order."""
    OPENING = 2
    OPEN = 3
    CLOSING = 4
    CLOSED = 5


class WinchAction(Enum):
    """Order to a winch."""

    RELAX = 1
    """Lets the drum turn freely: a load falls."""
    LENGTH = 2
    """Lets out, or takes in, `length_m` of line, at `rate_m_s` where the winch takes that."""
    RATE = 3
    """Lets out, or takes in, line at `rate_m_s`, until another order; 0 stops."""
    LOCK = 4
    """Locks the drum, with the line fully taken in."""
    DELIVER = 5
    """Lets down the load to the ground, leaves it there, takes in the line, and locks."""
    HOLD = 6
    """Stops, and holds."""
    RETRACT = 7
    """Takes in all of the line."""
    LOAD_LINE = 8
    """Takes in line that is loaded, until its tension shows the end."""
    ABANDON_LINE = 9
    """Lets out all of the line, and so gives it up."""
    LOAD_PAYLOAD = 10
    """Lets out as much line as a person needs to hang a load on it."""


@dataclass(frozen=True, slots=True)
class GripperInfo:
    """A gripper.

    Args:
        name: The name in the configuration.
        state: What the autopilot says.
        ordered: What this daemon has ordered last and was acknowledged, human-readable; empty: nothing. What is may be
            another thing.
        note: Why something is not known, human-readable; empty if nothing is to say.

    """

    name: str
    state: GripperState = GripperState.UNKNOWN
    ordered: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class WinchStatus:
    """Status that a winch reports. Values that it does not report are None.

    Args:
        length_m: How much line is out.
        speed_m_s: Positive: line is let out.
        tension_n: Of the line.
        voltage_v: At the winch.
        current_a: Through the winch.
        temperature_c: Of its motor.
        is_healthy: Whether it says that it is.
        is_fully_retracted: Whether all of the line is in.
        is_moving: Whether its motor moves. A winch without a sensor for that says False.
        is_clutch_engaged: Whether the drum turns freely.

    """

    length_m: float | None = None
    speed_m_s: float | None = None
    tension_n: float | None = None
    voltage_v: float | None = None
    current_a: float | None = None
    temperature_c: float | None = None
    is_healthy: bool = False
    is_fully_retracted: bool = False
    is_moving: bool = False
    is_clutch_engaged: bool = False


@dataclass(frozen=True, slots=True)
class ServoInfo:
    """A servo.

    Args:
        name: The name in the configuration.
        min_pwm_us: The shortest pulse that may be ordered.
        max_pwm_us: The longest one.
        positions: The positions that are configured, each with its pulse width.
        pwm_us: What the autopilot puts out now. None: it does not say.
        position: The position that this is; empty: none of them, or not known.
        ordered: As in `GripperInfo`.
        note: As in `GripperInfo`.

    """

    name: str
    min_pwm_us: int
    max_pwm_us: int
    positions: tuple[tuple[str, int], ...] = ()
    pwm_us: int | None = None
    position: str = ""
    ordered: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class RelayInfo:
    """A relay.

    Args:
        name: The name in the configuration.
        on_name: The name of the state in which it is on.
        off_name: The name of the state in which it is off.
        is_on: None: the autopilot does not say.
        ordered: As in `GripperInfo`.
        note: As in `GripperInfo`.

    """

    name: str
    on_name: str
    off_name: str
    is_on: bool | None = None
    ordered: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class WinchInfo:
    """A winch.

    Args:
        name: The name in the configuration.
        status: None: it is not known.
        ordered: As in `GripperInfo`.
        note: As in `GripperInfo`.

    """

    name: str
    status: WinchStatus | None = None
    ordered: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class Equipment:
    """All that is configured, with what is known of each."""

    grippers: tuple[GripperInfo, ...] = ()
    winches: tuple[WinchInfo, ...] = ()
    servos: tuple[ServoInfo, ...] = ()
    relays: tuple[RelayInfo, ...] = ()
