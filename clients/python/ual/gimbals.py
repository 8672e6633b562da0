"""The gimbals of a UAV, as values. `ual.Uav.gimbals` points them; the manual is ``docs/how-to/gimbals.md``.

Angles follow REP 103, as all of UAL: a positive pitch looks down, a positive yaw is to the left.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ual.geometry import PointStamped, Quaternion


class GimbalAbility(Enum):
    """What a gimbal can do: its axes, the references of its angles, and orders that not all have."""

    ROLL = 1
    PITCH = 2
    YAW = 3
    BODY = 4
    HORIZON = 5
    EARTH = 6
    RATES = 7
    NEUTRAL = 8
    RETRACT = 9
    CONTROL = 10


class GimbalReference(Enum):
    """From what angles count.

    BODY: from the body, so it tilts and turns with the UAV. HORIZON: roll and pitch from the horizon, yaw from the
    nose, so it stays level and turns with the UAV. EARTH: level, too, and yaw from the x axis of a frame.
    """

    BODY = 1
    HORIZON = 2
    EARTH = 3


class GimbalActivity(Enum):
    """What a gimbal was ordered last."""

    ANGLES = 1
    RATES = 2
    POINT = 3
    NEUTRAL = 4
    RETRACTED = 5


class GimbalControl(Enum):
    """Which program on the link has the control of a gimbal: none, this daemon, or another one."""

    FREE = 1
    OURS = 2
    OTHER = 3


@dataclass(frozen=True, slots=True)
class AngleRange:
    """Between which angles an axis turns."""

    least_rad: float
    most_rad: float

    def nearest(self, angle_rad: float) -> float:
        """Returns the angle within it that is nearest."""
        return min(max(angle_rad, self.least_rad), self.most_rad)


@dataclass(frozen=True, slots=True)
class GimbalAngles:
    """Angles of a gimbal: turned by yaw, then pitch, then roll."""

    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0

    @property
    def orientation(self) -> Quaternion:
        """The same as a rotation: x along its view, y left, z up."""
        return Quaternion.from_euler(self.roll_rad, self.pitch_rad, self.yaw_rad)


@dataclass(frozen=True, slots=True)
class GimbalInfo:
    """A gimbal.

    Args:
        number: By which it is named while the daemon runs.
        name: For people.
        abilities: What it can do.
        is_connected: Whether it is heard now.
        frame_id: Where it looks, as a frame below ``<ns>/base_link``: x along its view, y left, z up.
        roll: Its limits from the horizon; None where it does not say, or says what cannot be. So is `pitch`.
        yaw: Its limits from the nose.
        note: What is odd about it, for people. Empty if nothing is.

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
    """Where a gimbal looks, and what it does. None is what is not known.

    Args:
        stamp_s: When it looked so, as UTC since 1970.
        angles: Roll and pitch from the horizon, yaw from the nose.
        in_body: The same as an orientation in ``<ns>/base_link``: x along its view, y left, z up.
        in_odom: The same in ``<ns>/odom``.
        activity: What it was ordered last by this daemon; None also after another program has replaced that.
        target: What it looks at, while its activity is POINT.
        off_target_rad: How far it looks beside that.
        control: Which program on the link has the control of it.
        controller: Which one that is, for people; empty where it is free, or not known.
        problems: What is wrong, for people.

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
