"""The values between a backend and the layers above it: snapshots go up, setpoints go down. All are immutable.

The *local frame* is the autopilot's own: east, north, up in metres, with the autopilot's origin. Body axes are x
forward, y left, z up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum, Flag, auto
from typing import Generic, NamedTuple, TypeVar

from ual.geometry import Pose, Twist, Vector3
from ual.types import Battery, Capability, GeoPoint, GpsInfo, Health, Limits
from ual_daemon.geodesy import Projection, is_zero

T_co = TypeVar("T_co", covariant=True)


class LandedState(Enum):
    """Whether the vehicle is on the ground, as the autopilot reports it (MAV_LANDED_STATE); UNKNOWN if it does not."""

    UNKNOWN = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKING_OFF = 3
    LANDING = 4


class Control(Enum):
    """What controls the vehicle in the autopilot's present mode."""

    REFERENCES = 1
    """The daemon's setpoints (PX4 OFFBOARD, ArduPilot GUIDED, ...)."""
    TAKE_OFF = 2
    """The autopilot's take-off mode."""
    LAND = 3
    """The autopilot's landing mode."""
    OTHER = 4
    """The safety pilot, or another mode of the autopilot."""


class Cause(Enum):
    """Who or what took the control from UAL, or holds it; the value is the metadata `by` of errors."""

    SAFETY_PILOT = "safety pilot"
    """A mode that is flown by sticks, or a mode that the transmitter's switch selected."""
    GROUND_STATION = "ground station"
    """Another mode of the autopilot, without a failsafe or a switch: a ground station or another program."""
    BATTERY = "battery failsafe"
    RC = "rc failsafe"
    """The transmitter is lost."""
    FENCE = "fence"
    """The autopilot's own geofence."""
    GROUND_STATION_LOST = "ground station failsafe"
    """The link to the ground station is lost."""
    POSITION = "position failsafe"
    """The estimator has no good position."""
    SETPOINTS = "setpoint failsafe"
    """No setpoints came: taking control back is the remedy, so it needs no force."""
    COLLISION = "collision"
    """It has hit something (a simulator tells)."""
    FAILSAFE = "failsafe"
    """A failsafe whose reason the autopilot does not say."""
    OPEN = ""
    """Not known yet: the mode has just changed, and its reason may follow within a moment."""

    @property
    def is_failsafe(self) -> bool:
        """Whether the autopilot itself took the control, to save the vehicle or those below it."""
        return self in _FAILSAFES

    @property
    def needs_force(self) -> bool:
        """Whether UAL overrides it only with force."""
        return self.is_failsafe and self is not Cause.SETPOINTS


_FAILSAFES = frozenset(
    {
        Cause.BATTERY,
        Cause.RC,
        Cause.FENCE,
        Cause.GROUND_STATION_LOST,
        Cause.POSITION,
        Cause.SETPOINTS,
        Cause.COLLISION,
        Cause.FAILSAFE,
    }
)


@dataclass(frozen=True, slots=True)
class Mode:
    """The autopilot's mode: its name, human-readable, and what controls the vehicle in it.

    `is_autonomous` is whether the autopilot surely flies by itself in it, without sticks (hold, return): a landing may
    replace such a mode, and never one that the pilot flies.
    """

    name: str
    control: Control
    is_autonomous: bool = False


@dataclass(frozen=True, slots=True)
class Estimator:
    """Whether the autopilot trusts its position estimate, and if not, why, in the autopilot's words."""

    is_good: bool
    why: str = ""

    def is_regained_after(self, last: Sample[Estimator] | None) -> bool:
        """Whether the last word was that the position is not good. Then a pose from before this one is not good."""
        return self.is_good and last is not None and not last.value.is_good


NEVER_S = float("-inf")
"""The time of a sample that will come but has not come yet. (None instead of a sample means that none will come.)"""


@dataclass(frozen=True, slots=True)
class Sample(Generic[T_co]):
    """A value with the time (backend clock) at which it was received."""

    value: T_co
    time_s: float


class FenceLimit(NamedTuple):
    """One limit of an autopilot's own fence: metres, and the name of the autopilot's parameter."""

    value_m: float
    parameter: str


class Zone(NamedTuple):
    """A polygon or a circle on Earth of an autopilot's own fence: to be kept inside (an inclusion) or outside of.

    `points` are latitude and longitude in degrees. They are the corners of a polygon in order (its last side leads back
    to the first), or the centre of a circle, which has a radius. `name` is human-readable:
    ``inclusion polygon 1 of 2``.
    """

    name: str
    is_inclusion: bool
    points: tuple[tuple[float, float], ...]
    radius_m: float | None = None


class AutopilotFence(NamedTuple):
    """The fence that the autopilot itself applies; None: no such limit. The limits are around its home, heights above.

    `zones` are anywhere on Earth: it stays outside all exclusions, and inside all inclusions, or with
    `unites_inclusions` inside at least one.
    `unread` says what else it has that is not known here, such as a polygon; empty if there is nothing.
    `is_cut_by_unread` is whether it surely has that: a goal that is admitted may then lie beyond it.
    """

    radius: FenceLimit | None = None
    highest: FenceLimit | None = None
    lowest: FenceLimit | None = None
    unread: str = ""
    is_cut_by_unread: bool = False
    zones: tuple[Zone, ...] = ()
    unites_inclusions: bool = False

    @property
    def limits(self) -> tuple[FenceLimit, ...]:
        """All limits that it has."""
        return tuple(each for each in (self.radius, self.highest, self.lowest) if each is not None)


NO_FENCE = AutopilotFence()


class LinkReport(NamedTuple):
    """How the link to the autopilot has been of late; None for what a backend does not measure.

    `rate_hz` is the autopilot's messages per second, `loss` the part of them that did not arrive (0 to 1), and
    `round_trip_s` the time of the newest request and answer. `lost_count` is how often the link was lost, and
    `reboots_count` how often the autopilot has rebooted, both since the start.
    """

    rate_hz: float | None = None
    loss: float | None = None
    round_trip_s: float | None = None
    lost_count: int | None = None
    reboots_count: int | None = None


class ControlState(NamedTuple):
    """Who flies it: armed, on the ground or not, its mode, and what keeps UAL from flying.

    Attributes:
        armed: Whether it is armed.
        landed: Whether it is on the ground. None: this autopilot does not say it.
        mode: The mode.
        failsafe: The failsafe that is active, whatever the mode.
        held_by: Who or what holds the control in the present mode, where that is not UAL. None where the backend cannot
            say: it is then taken for the safety pilot.
        other_sender: What shows that another program sends setpoints, too, human-readable; empty if nothing does.

    """

    armed: Sample[bool] | None = None
    landed: Sample[LandedState] | None = None
    mode: Sample[Mode] | None = None
    failsafe: Cause | None = None
    held_by: Cause | None = None
    other_sender: str = ""

    @property
    def is_on_ground(self) -> bool:
        """Whether it surely stands on the ground."""
        return self.landed is not None and self.landed.value is LandedState.ON_GROUND

    @property
    def mode_name(self) -> str:
        """The name of the mode; empty while it is not known."""
        return "" if self.mode is None else self.mode.value.name

    @property
    def settled_mode(self) -> str:
        """The name of the mode; empty if it may be the one from before the arming, which the arming has changed.

        PX4 tells the arming by an event, and the mode that it was made to enter for it up to a second later.
        """
        mode, armed, landed = self.mode, self.armed, self.landed
        is_on_ground = landed is None or landed.value is LandedState.ON_GROUND
        if mode is None or (armed is not None and is_on_ground and mode.time_s < armed.time_s):
            return ""
        return mode.value.name


class MotionState(NamedTuple):
    """Where it is and how it moves, by the autopilot's estimate, and whether that is good.

    Attributes:
        estimator: Whether the autopilot trusts its estimate.
        pose: The pose of the body in the local frame.
        velocity: Linear along the local axes, angular in the body.
        position_geo: The position on Earth, where the autopilot sends it. Else it is computed from the pose by the
            projection.
        stamp_s: The autopilot's time of the pose as UTC since 1970.
        measured_s: The same on the autopilot's own clock (0: it does not say), of which only differences count. UTC is
            estimated, and is corrected when the delay of the link changes.

    """

    estimator: Sample[Estimator] | None = None
    pose: Sample[Pose] | None = None
    velocity: Sample[Twist] | None = None
    position_geo: GeoPoint | None = None
    stamp_s: float = 0.0
    measured_s: float = 0.0


class EarthReference(NamedTuple):
    """How the local frame lies on Earth, and where home is. It seldom changes.

    Attributes:
        projection: Between local metres and Earth. None while it may be that of an earlier local frame.
        home_geo: Where home lies, if the autopilot says so; its altitude is the next one.
        home_altitude_amsl_m: What altitudes above home are relative to.
        geoid_separation_m: The height above the ellipsoid minus the height above mean sea level, at this place.

    """

    projection: Projection | None = None
    home_geo: GeoPoint | None = None
    home_altitude_amsl_m: float | None = None
    geoid_separation_m: float | None = None

    @property
    def home(self) -> Vector3 | None:
        """The autopilot's home in the local frame; None if that is not known."""
        place, altitude_m, projection = self.home_geo, self.home_altitude_amsl_m, self.projection
        if place is None or altitude_m is None or projection is None:
            return None
        if is_zero(place.latitude_deg, place.longitude_deg):  # none was set
            return None
        return projection.to_local(place.latitude_deg, place.longitude_deg, altitude_m)


class Condition(NamedTuple):
    """How the vehicle is, for people above all.

    Attributes:
        battery: The battery.
        gps: The receiver of satellites. None: the backend reports none.
        status_text: The newest text of the autopilot, or what the backend has to say instead.
        health: What else the autopilot says of itself. Its `failsafe` and `held_by` are filled in above.
        has_rangefinder: Whether the autopilot uses a distance sensor that looks down.

    """

    battery: Battery | None = None
    gps: GpsInfo | None = None
    status_text: str = ""
    health: Health | None = None
    has_rangefinder: bool = False


class LinkState(NamedTuple):
    """What is wrong with the link, and how often the autopilot has booted. It seldom changes.

    Attributes:
        trouble: What is wrong, or what is heard instead of the autopilot; empty while nothing is wrong. It ends the
            reason of the state while nothing is heard from the autopilot.
        refused: Which requests for data the autopilot has refused. It ends the reason of the state while that data is
            missing.
        conflict: Why it is not sure that the values are those of one vehicle. Nothing may be flown then.
        boots_count: Changes when the autopilot has rebooted, or is another one. Each boot begins a local frame of its
            own, whose place on Earth only a projection of that boot says.
        boots_in_frame_count: Changes instead where the local frame is the same after the reboot, because something
            outside lays it (motion capture).

    """

    trouble: str = ""
    refused: str = ""
    conflict: str = ""
    boots_count: int = 0
    boots_in_frame_count: int = 0


class Snapshot(NamedTuple):
    """The newest values from the autopilot, in groups; None for a value that it has not sent (yet).

    A group is immutable, too: where nothing of it has changed, it may be the same object from one snapshot to the next.

    Attributes:
        time_s: When the snapshot was taken. All times but `stamp_s` and `measured_s` are on the backend's clock.
        heard_s: When the last message came from the autopilot.
        updated_s: When the backend last looked for data, which every backend says. What came later is not in the
            values; while that is long ago no setpoint is sent.
        scheduling_gap: That the backend had no time to look for data lately, human-readable; empty if it had.
        sequence: Numbers the updates of a backend that may leave some out (`Backend.is_update_needed`), and counts
            these, too. 0: the vehicle is to count.
        control: Who flies it.
        motion: Where it is and how it moves.
        earth: How the local frame lies on Earth, and where home is.
        condition: How the vehicle is.
        link: What is wrong with the link, and reboots.
        autopilot_fence: The limits that the autopilot itself keeps to; None: it has none.

    """

    time_s: float
    heard_s: float | None = None
    updated_s: float = math.inf
    scheduling_gap: str = ""
    sequence: int = 0
    control: ControlState = ControlState()
    motion: MotionState = MotionState()
    earth: EarthReference = EarthReference()
    condition: Condition = Condition()
    link: LinkState = LinkState()
    autopilot_fence: AutopilotFence | None = None

    def with_trouble(self, why: str) -> Snapshot:
        """Returns the same values, with what is wrong with the link, which people are to read at once, too."""
        return self._replace(link=self.link._replace(trouble=why), condition=self.condition._replace(status_text=why))

    def at(self, time_s: float) -> Snapshot:
        """Returns the same values at another time. Every setpoint needs this: `Snapshot` is a tuple to make it fast."""
        return Snapshot._make((time_s, *self[1:]))


@dataclass(frozen=True, slots=True)
class Freshness:
    """How old a value may become, in seconds, before it is ignored. Depends on how often the autopilot sends it."""

    link_s: float = 1.5
    pose_s: float = 1.0
    mode_s: float = 3.0
    landed_s: float = 2.0
    estimator_s: float = 4.0


class Takes(Flag):
    """Which setpoints an autopilot takes. UAL sends no others."""

    POSITION = auto()
    """Positions and headings."""
    FEED_FORWARD = auto()
    """With a position: its velocity, acceleration and yaw rate, which the autopilot really flies."""
    VELOCITY = auto()
    """Velocities and yaw rates. Without feed-forward, UAL flies paths with them; without positions, it holds, too."""
    ALL = POSITION | FEED_FORWARD | VELOCITY


class SetpointLoss(Enum):
    """What the vehicle does when setpoints stop in the mode that takes them; the value is human-readable."""

    HOLDS = "holds its position"
    """By itself, or by a failsafe that ends in a safe mode (PX4, ArduPilot, the light simulation)."""
    COASTS = "goes on with the last setpoint"
    """A velocity that was sent last is flown on and on (AirSim, until its duration ends)."""
    FALLS = "stops its motors"
    """It comes down (Crazyflie). It is held from the first update on, also by a daemon that was not commanded in this
    flight; any other one is left to whoever flies it."""


class VelocityGains(NamedTuple):
    """How UAL flies to a position with velocities alone.

    The velocity that is sent is that of the trajectory, plus `response_s` times its acceleration, plus `position_per_s`
    times the distance from it; the yaw rate likewise, without acceleration. `response_s` is the time in which the
    vehicle follows a step of the velocity (to 63 %): 0 where that is not known.
    """

    position_per_s: float = 0.8
    """PX4's own is 0.95 (MPC_XY_P), ArduPilot's 1 (PSC_POSXY_P)."""
    yaw_per_s: float = 1.5
    response_s: float = 0.0


class VelocityResponse(NamedTuple):
    """How the vehicle follows a step of a commanded velocity along one axis; see `ual_daemon.tracker.drift`.

    It hears what is commanded through a low pass of `delay_s` (the link). It then accelerates by what is missing of
    the velocity over `time_s`, within its limits of acceleration and jerk. Its acceleration follows that through a low
    pass of `rise_s`, where this is known apart (a multirotor tilts). `holds_place` says that the autopilot itself
    integrates the velocity to a place and holds that: an error of its estimated velocity does not carry it away.
    """

    time_s: float = 0.5
    acceleration_m_s2: float = 9.81
    """Horizontally, that of a tilt of 45 degrees."""
    jerk_m_s3: float = 1000.0
    delay_s: float = 0.2
    holds_place: bool = False
    rise_s: float = 0.0


class VelocityResponses(NamedTuple):
    """How the vehicle follows velocities along its axes."""

    horizontal: VelocityResponse = VelocityResponse()
    vertical: VelocityResponse = VelocityResponse()


@dataclass(frozen=True, slots=True)
class VehicleInfo:
    """What a backend knows of its vehicle. Values may become known only once it is connected.

    `flies_takeoff_on_setpoints` says that after `Backend.take_off` the daemon's setpoints fly the climb (PX4 OFFBOARD,
    the light simulation). Otherwise the autopilot climbs by itself and gets no setpoints until it is up (ArduPilot).
    `flies_landing_on_setpoints` says that UAL lands it by velocities, and then stops its motors
    (`Backend.disarm_landed`): it has no landing of its own that UAL may use. It takes velocities, holds by itself
    without them, and tells its mode at least four times a second. Only setpoints that `takes` allows are sent.
    `identity` says which vehicle it is, so that what was saved for it is not used for another (`Backend.outlived`); it
    is empty while that is not known. `cruise_speed_m_s` is the horizontal speed at which the autopilot itself flies to
    a goal, where nobody asks for another one. `acceleration_share` is the part of the autopilot's acceleration limits
    that `limits` have: references on the way use no more, a stop uses all. `clearance_m` is how far its body, and the
    air under it, need the ground to be where it does not land. `limitation` says, human-readable, why it has fewer
    capabilities than others. `note` says what is unusual about it (limits that are assumed, a link that carries
    little). Both end the reason of the state. `drops_positions_beyond_fence` says that the autopilot ignores positions
    beyond its own fence, silently, also those that lead back inside; it follows velocities there (ArduPilot).
    `setpoint_rate_hz` is how often UAL sends a setpoint by itself (those of a caller's stream are passed on as they
    come), and `setpoint_loss` what the vehicle does when they stop. `velocity_gains` are used where `takes` has no
    feed-forward, `velocity_responses` while velocities are commanded. `has_safety_pilot` says whether a person can take
    over from UAL at any time (a transmitter, a simulated pilot); where nobody can, UAL aborts take-offs and landings,
    too.
    """

    autopilot: str = ""
    autopilot_version: str = ""
    is_simulation: bool = False
    capabilities: frozenset[Capability] = frozenset()
    limits: Limits = field(default_factory=Limits)
    flies_takeoff_on_setpoints: bool = True
    flies_landing_on_setpoints: bool = False
    takes: Takes = Takes.ALL
    velocity_gains: VelocityGains = field(default_factory=VelocityGains)
    velocity_responses: VelocityResponses = field(default_factory=VelocityResponses)
    setpoint_rate_hz: float = 50.0
    setpoint_loss: SetpointLoss = SetpointLoss.HOLDS
    has_safety_pilot: bool = True
    identity: str = ""
    limitation: str = ""
    note: str = ""
    cruise_speed_m_s: float = math.inf
    acceleration_share: float = 1.0
    clearance_m: float = 0.5
    drops_positions_beyond_fence: bool = False


@dataclass(frozen=True, slots=True)
class PositionSetpoint:
    """A position and heading in the local frame, with velocity, acceleration and yaw rate as feed-forward."""

    position: Vector3
    yaw_rad: float
    velocity: Vector3 = field(default_factory=Vector3)
    acceleration: Vector3 = field(default_factory=Vector3)
    yaw_rate_rad_s: float = 0.0


@dataclass(frozen=True, slots=True)
class VelocitySetpoint:
    """A velocity along the local axes and a yaw rate (positive: to the left).

    An acceleration is added as feed-forward by backends whose autopilot takes one.
    """

    velocity: Vector3
    yaw_rate_rad_s: float = 0.0
    acceleration: Vector3 | None = None


@dataclass(frozen=True, slots=True)
class ExternalPose:
    """A pose of the body in the local frame, measured from outside: for the autopilot's estimator.

    It is checked already: newer than the one before, not old, and not a jump. `time_s` is when it was measured on the
    backend's clock, and `stamp_s` the same as UTC (`Backend.utc_s`). The standard deviations are those of each axis, in
    metres and radians; None where they are not known. `resets_count` changes when the source of the poses has moved its
    origin, or has come back elsewhere: the pose is then a jump that is to be taken.
    """

    pose: Pose
    time_s: float
    stamp_s: float
    position_std_dev_m: float | None = None
    orientation_std_dev_rad: float | None = None
    resets_count: int = 0


Setpoint = PositionSetpoint | VelocitySetpoint


class Packet(NamedTuple):
    """A packet on the link to the autopilot, as it was on the wire.

    `encoding` names the protocol, and `peer` the other end (empty where there is only one). `time_s` is when it was
    received or had left, on the backend's clock, and `utc_s` the same moment as UTC since 1970. Without `data` it says
    that what had arrived was discarded, because the computer had no time for it, with all that may have changed.
    """

    encoding: str
    data: bytes
    is_sent: bool
    peer: str
    time_s: float
    utc_s: float
