"""The gimbals that a UAV carries. As values, from ``gimbal.proto``. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ual.contract._bases import AngleRangeBase, GimbalAnglesBase
from ual.geometry import PointStamped, Quaternion


class GimbalAbility(Enum):
    """Ability of a gimbal."""

    ROLL = 1
    """It has this axis."""
    PITCH = 2
    YAW = 3
    BODY = 4
    """Angles of this reference."""
    HORIZON = 5
    EARTH = 6
    RATES = 7
    """SetGimbalRates."""
    NEUTRAL = 8
    """MoveGimbalToNeutral."""
    RETRACT = 9
    """RetractGimbal."""
    CONTROL = 10
    """TakeGimbalControl and ReleaseGimbalControl."""


class GimbalReference(Enum):
    """Axes from which angles count."""

    BODY = 1
    """From the body: it tilts and turns with the UAV."""
    HORIZON = 2
    """Roll and pitch from the horizon, yaw from the nose: it stays level, and turns with the UAV."""
    EARTH = 3
    """Roll and pitch from the horizon, yaw from the x axis of a frame: it stays level, and does not turn with the UAV.
    """


class GimbalActivity(Enum):
    """Last order of this daemon to a gimbal."""

    ANGLES = 1
    RATES = 2
    POINT = 3
    NEUTRAL = 4
    RETRACTED = 5


class GimbalControl(Enum):
    """Program on the link that has the control of a gimbal."""

    FREE = 1
    OURS = 2
    """This daemon."""
    OTHER = 3


@dataclass(frozen=True, slots=True)
class AngleRange(AngleRangeBase):
    """Between which angles an axis turns, rad."""

    least_rad: float
    most_rad: float


@dataclass(frozen=True, slots=True)
class GimbalAngles(GimbalAnglesBase):
    """Angles of a gimbal, rad: turned by yaw, then pitch, then roll."""

    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class GimbalInfo:
    """A gimbal.

    Args:
        number: The number by which requests name it, while the daemon runs.
        name: Human-readable.
        abilities: What it can do.
        is_connected: Whether messages of the gimbal arrive now.
        frame_id: Its direction, as a frame below ``<ns>/base_link``: x along its view, y left, z up.
        roll: Its limits from the horizon. None where it does not say, or says what cannot be.
        pitch: As `roll`.
        yaw: Its limits from the nose.
        note: Human-readable oddities: two reports that contradict each other, and what follows. Empty if there are
            none.

    """

    number: int
    name: str
    abilities: frozenset[GimbalAbility]
    is_connected: bool = True
    frame_id: str = ""
    roll: AngleRange | None = None
    pitch: AngleRange | None = None
    yaw: AngleRange | None = None
    note: str = ""


@dataclass(frozen=True, slots=True)
class GimbalStatus:
    """Attitude and activity of a gimbal. Unknown values are None.

    Args:
        stamp_s: When it looked so, as UTC since 1970.
        angles: Roll and pitch from the horizon, yaw from the nose.
        in_body: The same as an orientation in ``<ns>/base_link``: x along its view, y left, z up.
        in_odom: The same in ``<ns>/odom``.
        activity: What it was ordered last by this daemon; None also after another program has replaced that.
        target: The target, while its activity is POINT.
        off_target_rad: Angle between its direction and the target, rad.
        control: Which program on the link has the control of it.
        controller: Human-readable name of the program that has the control; empty where it is free, or not known.
        problems: Human-readable problems: its own failures, a limit that is reached, a target whose place is not known.

    """

    stamp_s: float | None = None
    angles: GimbalAngles | None = None
    in_body: Quaternion | None = None
    in_odom: Quaternion | None = None
    activity: GimbalActivity | None = None
    target: PointStamped | None = None
    off_target_rad: float | None = None
    control: GimbalControl | None = None
    controller: str = ""
    problems: tuple[str, ...] = ()
