"""What flows between a backend and the layers above it: snapshots up, setpoints down. All immutable.

The *local frame* is the autopilot's own: east, north, up in metres, its origin wherever the autopilot has it. Bodies
are x forward, y left, z up.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Generic, NamedTuple, TypeVar

from ual.geometry import Pose, Twist, Vector3
from ual.types import Battery, Capability, GeoPoint, GpsInfo, Limits
from ual_daemon.geodesy import Projection

T_co = TypeVar("T_co", covariant=True)


class LandedState(Enum):
    """What the autopilot says of the ground (MAV_LANDED_STATE); UNKNOWN where it says nothing."""

    UNKNOWN = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKING_OFF = 3
    LANDING = 4


class Control(Enum):
    """Whose references the autopilot's present mode follows."""

    REFERENCES = 1
    """Ours (PX4 OFFBOARD, ArduPilot GUIDED, ...)."""
    TAKE_OFF = 2
    """Its own take-off mode."""
    LAND = 3
    """Its own landing mode."""
    OTHER = 4
    """The safety pilot's, or another mode's of its own."""


@dataclass(frozen=True, slots=True)
class Mode:
    """The autopilot's mode: its own name, for people, and who gives the references in it."""

    name: str
    control: Control


@dataclass(frozen=True, slots=True)
class Estimator:
    """Whether the autopilot trusts its own position, and if not, why, in its words."""

    is_good: bool
    why: str = ""


NEVER_S = float("-inf")
"""The time of a sample that is sure to come but has not yet, where None would mean that there is none at all."""


@dataclass(frozen=True, slots=True)
class Sample(Generic[T_co]):
    """A value with the time (backend clock) at which it was received."""

    value: T_co
    time_s: float


class Snapshot(NamedTuple):
    """Everything the autopilot said last, immutable; None is what it has not said (yet).

    `time_s` is when the snapshot was taken and `heard_s` when the autopilot was last heard, both on the backend's
    clock; `stamp_s` is the autopilot's own time of the pose as UTC since 1970. `velocity` is linear along the local
    axes and angular in the body. `position_geo` follows from the pose by the `projection` where the autopilot does not
    tell it itself. `home_altitude_amsl_m` is what altitudes above home start from;
    `geoid_separation_m` is the ellipsoid's height minus that above mean sea level, here. `sequence` numbers the updates
    of a backend that leaves some out (`Backend.is_update_needed`), those included; 0 where the vehicle is to count.
    """

    time_s: float
    heard_s: float | None = None
    stamp_s: float = 0.0
    armed: Sample[bool] | None = None
    landed: Sample[LandedState] | None = None
    mode: Sample[Mode] | None = None
    estimator: Sample[Estimator] | None = None
    pose: Sample[Pose] | None = None
    velocity: Sample[Twist] | None = None
    position_geo: GeoPoint | None = None
    projection: Projection | None = None
    home_altitude_amsl_m: float | None = None
    geoid_separation_m: float | None = None
    battery: Battery | None = None
    gps: GpsInfo | None = None
    status_text: str = ""
    sequence: int = 0

    def at(self, time_s: float) -> Snapshot:
        """The same at another time. Fast, as every setpoint asks for it: why this is a tuple."""
        return Snapshot._make((time_s, *self[1:]))


@dataclass(frozen=True, slots=True)
class Freshness:
    """How old a value may be, in seconds, before it counts as none. Set by what the autopilot sends how often."""

    link_s: float = 1.5
    pose_s: float = 1.0
    mode_s: float = 3.0
    landed_s: float = 2.0
    estimator_s: float = 4.0


class Takes(Enum):
    """Which setpoints an autopilot takes."""

    ALL = 1
    """Positions with the motion there as feed-forward, and velocities."""
    POSITIONS = 2
    """Bare positions (and heading) only: it is flown by pure pursuit."""
    VELOCITIES = 3
    """Velocities only: it is flown by pure pursuit, and its place is held from here."""


@dataclass(frozen=True, slots=True)
class VehicleInfo:
    """What a backend knows of its vehicle; may grow while it is connected.

    `flies_takeoff_on_setpoints` says that after `Backend.take_off` the climb itself is flown with our setpoints (PX4
    OFFBOARD, the light simulation); else the autopilot climbs by itself and gets none until it is up (ArduPilot).
    `takes` says which setpoints it is sent: no others are.
    """

    autopilot: str = ""
    autopilot_version: str = ""
    is_simulation: bool = False
    capabilities: frozenset[Capability] = frozenset()
    limits: Limits = field(default_factory=Limits)
    flies_takeoff_on_setpoints: bool = True
    takes: Takes = Takes.ALL


@dataclass(frozen=True, slots=True)
class PositionSetpoint:
    """A position in the local frame, with the heading, and the motion there as feed-forward."""

    position: Vector3
    yaw_rad: float
    velocity: Vector3 = field(default_factory=Vector3)
    acceleration: Vector3 = field(default_factory=Vector3)
    yaw_rate_rad_s: float = 0.0


@dataclass(frozen=True, slots=True)
class VelocitySetpoint:
    """A velocity along the local axes, and how fast to turn to the left."""

    velocity: Vector3
    yaw_rate_rad_s: float = 0.0


Setpoint = PositionSetpoint | VelocitySetpoint
