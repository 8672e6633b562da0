"""The value types of the interface: what `ual.v1` says in protobuf, as plain immutable Python values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from enum import Enum, IntEnum
from typing import TYPE_CHECKING

from typing_extensions import override

from ual.errors import UalError
from ual.geometry import PointStamped, Pose, PoseStamped, Transform, Twist, TwistStamped, Vector3

if TYPE_CHECKING:
    from typing_extensions import Self


class State(Enum):
    """State of the UAV; see `ual.v1.State` for the order in which it is estimated."""

    UNINITIALIZED = 1
    LANDED_DISARMED = 2
    LANDED_ARMED = 3
    TAKING_OFF = 4
    FLYING_AUTO = 5
    FLYING_MANUAL = 6
    LANDING = 7


class AltitudeReference(Enum):
    """Reference of an altitude: home, mean sea level, or the WGS 84 ellipsoid."""

    HOME = 1
    AMSL = 2
    ELLIPSOID = 3


class PathHeading(Enum):
    """Heading of the nose on a path: as each waypoint says, as at the beginning, along the path, or at a point."""

    WAYPOINTS = 1
    FIXED = 2
    ALONG_PATH = 3
    POINT_OF_INTEREST = 4


class TaskKind(Enum):
    """Kind of manoeuvre of a task."""

    TAKE_OFF = 1
    LAND = 2
    GO_TO_WAYPOINT = 3
    GO_TO_WAYPOINT_GEO = 4
    FOLLOW_PATH = 5
    RETURN_TO_LAUNCH = 6
    MISSION = 7


class TaskStatus(Enum):
    """Status of a task."""

    RUNNING = 1
    SUCCEEDED = 2
    ABORTED = 3
    FAILED = 4


class Capability(Enum):
    """Something a backend can do; what it cannot is answered with `NotSupportedError`."""

    ARM = 1
    TAKE_OFF = 2
    LAND = 3
    POSITION = 4
    VELOCITY = 5
    GEO = 6
    RECOVER = 7
    EXTERNAL_POSE = 8


class GpsFix(IntEnum):
    """Quality of a satellite fix, in rising order."""

    NONE = 1
    FIX_2D = 2
    FIX_3D = 3
    DIFFERENTIAL = 4
    RTK_FLOAT = 5
    RTK_FIXED = 6


@dataclass(frozen=True, slots=True)
class GeoPoint:
    """A position on Earth (WGS 84). An altitude that is not known is None."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float | None = None
    altitude_home_m: float | None = None
    altitude_ellipsoid_m: float | None = None


@dataclass(frozen=True, slots=True)
class GeoWaypoint:
    """A geographic position to fly to, and the heading there, counter-clockwise from east (None: the one before)."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    altitude_reference: AltitudeReference = AltitudeReference.HOME
    yaw_rad: float | None = None


Waypoints = Sequence[PoseStamped | Pose] | Sequence[GeoWaypoint]
"""Of a path: poses, in any frames, or geographic positions."""


@dataclass(frozen=True, slots=True)
class TakeOffRequest:
    """Climb straight up to `height_m` (metres, more than 0) above the ground that the UAV stands on.

    `force`: although a failsafe is active.
    """

    height_m: float
    force: bool = False


@dataclass(frozen=True, slots=True)
class LandRequest:
    """Land where the UAV is."""


@dataclass(frozen=True, slots=True)
class GoToWaypointRequest:
    """Fly straight to a pose, at most at `max_speed_m_s` in any direction (None: only the UAV's limits)."""

    waypoint: PoseStamped
    max_speed_m_s: float | None = None


@dataclass(frozen=True, slots=True)
class GoToWaypointGeoRequest:
    """Fly straight to a position on Earth, at most at `max_speed_m_s` (None: only the UAV's limits)."""

    waypoint: GeoWaypoint
    max_speed_m_s: float | None = None


@dataclass(frozen=True, slots=True)
class FollowPathRequest:
    """Fly through waypoints, all poses or all geographic. See `ual.interface.TaskCommands.follow_path`."""

    waypoints: Sequence[PoseStamped | GeoWaypoint]
    corner_radius_m: float = 0.0
    max_speed_m_s: float | None = None
    leg_speeds_m_s: Sequence[float] = ()
    heading: PathHeading = PathHeading.WAYPOINTS
    point_of_interest: PointStamped | None = None
    holds_s: Sequence[float] = ()


@dataclass(frozen=True, slots=True)
class ReturnToLaunchRequest:
    """Fly home and land there, at least `height_m` above the ground (None: as the daemon is configured)."""

    height_m: float | None = None


@dataclass(frozen=True, slots=True)
class RecoverFromManualRequest:
    """Take control back from the safety pilot, and hold the pose found; with `force` out of a failsafe, too."""

    force: bool = False


@dataclass(frozen=True, slots=True)
class ExternalPose:
    """Pose of the UAV, measured from outside at `pose.stamp_s` (UTC since 1970; 0: just now).

    The standard deviations are those of each axis, in metres and radians; None where they are not known.
    """

    pose: PoseStamped
    position_std_dev_m: float | None = None
    orientation_std_dev_rad: float | None = None


TaskRequest = (
    TakeOffRequest
    | LandRequest
    | GoToWaypointRequest
    | GoToWaypointGeoRequest
    | FollowPathRequest
    | ReturnToLaunchRequest
)
"""Request that begins a task. Nothing in it is checked yet: the vehicle in the daemon does that, once for all
callers.
"""
Setpoint = PoseStamped | TwistStamped
"""A reference that is sent as it is: `set_pose` and `set_velocity`."""
MotionRequest = TaskRequest | RecoverFromManualRequest | Setpoint
"""Whatever moves the UAV, and so can be asked for as a dry run."""


@dataclass(frozen=True, slots=True)
class Battery:
    """A battery; the current is positive while discharging. What is not reported is None.

    `id` is the autopilot's number of it. `function` is what it feeds (``all``, ``propulsion``, ``avionics``,
    ``payload``), empty where the autopilot does not say.
    """

    remaining_percent: float | None = None
    voltage_v: float | None = None
    current_a: float | None = None
    id: int = 0
    function: str = ""


@dataclass(frozen=True, slots=True)
class GpsInfo:
    """The satellite receiver; accuracies are one standard deviation, None where not reported.

    `satellites_count` is None where it is not reported, or none is received. `corrections_age_s` is how long ago the
    last corrections (RTK) came to it, or were sent to it where it does not tell (None: none were). `baseline_m` is its
    distance from the base station (None: not told).
    """

    fix: GpsFix
    satellites_count: int | None = None
    horizontal_accuracy_m: float | None = None
    vertical_accuracy_m: float | None = None
    corrections_age_s: float | None = None
    baseline_m: float | None = None


@dataclass(frozen=True, slots=True)
class Health:
    """Health of the autopilot before and during the flight, and failing checks of the daemon.

    `is_ready_to_arm` is whether its own checks would let it be armed (None: it does not say), and `failing_checks` are
    those that fail, human-readable. Those of the daemon itself, such as its audit, begin with ``daemon: ``. Texts of
    the autopilot that are critical or worse begin with ``autopilot: ``, for 30 s, and what is wrong with the position
    with ``position: ``.
    `link_quality` is the part of its messages that arrived of late, 0 to 1 (None: not measured). `failsafe` is the
    one that is active, in the words of the metadata `by` of errors (``battery failsafe``, ``rc failsafe``, ``fence``,
    ...; empty: none). `held_by` is who or what holds the control in the present mode, in the same words (empty: UAL,
    or not known).
    """

    is_ready_to_arm: bool | None = None
    failing_checks: tuple[str, ...] = ()
    link_quality: float | None = None
    failsafe: str = ""
    held_by: str = ""


@dataclass(frozen=True, slots=True)
class Odometry:
    """Pose of the child frame (``<ns>/base_link``) in `frame_id` (``<ns>/odom``), twist in the child frame."""

    pose: Pose
    twist: Twist
    frame_id: str
    child_frame_id: str
    stamp_s: float


@dataclass(frozen=True, slots=True)
class TaskInfo:
    """State of a task at one moment.

    `progress` is 0 to 1 and `distance_left_m` metres, None where that cannot be told. `waypoint_index` is the waypoint
    a path flies to. `error` says why it was aborted or failed. `is_paused` says that it runs, but holds on its way.
    """

    id: str
    kind: TaskKind
    status: TaskStatus
    progress: float | None = None
    distance_left_m: float | None = None
    elapsed_s: float = 0.0
    waypoint_index: int | None = None
    error: UalError | None = None
    description: str = ""
    is_paused: bool = False


@dataclass(frozen=True, slots=True)
class Plan:
    """Plan of a motion: its length in metres and its duration in seconds, None where that cannot be told."""

    length_m: float | None = None
    duration_s: float | None = None


class _LateFields:
    """The base of a dataclass whose fields may be made when they are first read. Any thread may be the first."""

    __slots__ = ("_make",)

    @classmethod
    def late(cls, make: Callable[[str], object], **known: object) -> Self:
        """A value with these fields; each other one is made by its name."""
        new = object.__new__(cls)
        object.__setattr__(new, "_make", make)
        for name, value in known.items():
            object.__setattr__(new, name, value)
        return new

    if not TYPE_CHECKING:  # to a type checker, any name would be a field

        def __getattr__(self, name: str) -> object:
            """Python asks here for what is not there."""
            if name not in self.__dataclass_fields__:
                text = f"{type(self).__name__!r} object has no attribute {name!r}"
                raise AttributeError(text, name=name, obj=self)  # with both, Python says "Did you mean"
            value = self._make(name)
            object.__setattr__(self, name, value)
            return value


@dataclass(frozen=True, slots=True, repr=False)
class Telemetry(_LateFields):
    """One sample of everything known; what is not known is None.

    `frame_id` is the frame of `pose`, `velocity` and `reference_pose`. `stamp_s` is the time of the pose, UTC since
    1970. `frame_lost` says why it is not known where ``<ns>/odom`` is (`ual.errors.FrameLostError`), and is empty while
    it is known. `missed_count` is how many samples this subscriber lost since its last one. `batteries` are all of
    them, where the autopilot tells of each. `battery` is the one that a flight depends on: of several the emptiest that
    does not feed the payload only.
    """

    state: State
    state_reason: str = ""
    stamp_s: float = 0.0
    frame_id: str = ""
    pose: Pose | None = None
    velocity: Twist | None = None
    odometry: Odometry | None = None
    transform: Transform | None = None
    reference_pose: Pose | None = None
    position_geo: GeoPoint | None = None
    battery: Battery | None = None
    gps: GpsInfo | None = None
    flight_mode: str = ""
    armed: bool = False
    task: TaskInfo | None = None
    sequence: int = 0
    status_text: str = ""
    frame_lost: str = ""
    missed_count: int = 0
    health: Health | None = None
    batteries: tuple[Battery, ...] = ()

    @override
    def __repr__(self) -> str:
        """Returns the known values, a line for each field."""
        lines = (
            f"  {each.name}={value!r}," for each in fields(self) if (value := getattr(self, each.name)) not in _UNTOLD
        )
        return "\n".join(("Telemetry(", *lines, ")"))


_UNTOLD: tuple[object, ...] = (None, "", ())


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame of the tree; `transform` takes it to its parent, None where not known (yet)."""

    frame_id: str
    parent_frame_id: str
    transform: Transform | None
    is_static: bool


@dataclass(frozen=True, slots=True)
class Circle:
    """An upright cylinder, seen from above; the z of its `center` says nothing."""

    center: Vector3
    radius_m: float


@dataclass(frozen=True, slots=True)
class Geofence:
    """Geofence of a UAV, which may fly inside all of the following at once. What is None, or empty, does not limit it.

    All is in `frame_id`, ``map``. `corners` are those of a polygon in order, as seen from above; their z says nothing.
    `circle` is that of the autopilot's own fence, less the reserve that UAL keeps. `min_z_m` is the highest of all
    lower edges (of the configured fence, of the floor, of the autopilot's own fence), `max_z_m` the lowest of all upper
    ones. The autopilot's own fence may have polygons and circles beside these: motions into them are refused, but they
    are not told here.
    """

    frame_id: str = "map"
    corners: tuple[Vector3, ...] = ()
    circle: Circle | None = None
    min_z_m: float | None = None
    max_z_m: float | None = None


@dataclass(frozen=True, slots=True)
class Route:
    """The way that is flown, in `frame_id`, ``map``.

    `points` lead from where the task begins to where it ends, within 0.1 m of the way. Where that needs more than
    2,000 points, they are that many on it. Of a goal that moves (`is_goal_moving`) they lead from where the UAV is
    told to be now to where the goal is now. `task_id` is empty where a reference leads there.
    """

    frame_id: str
    points: tuple[Vector3, ...]
    task_id: str = ""
    is_goal_moving: bool = False


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits that the tracker and the velocity references keep. The defaults are those of a small multirotor."""

    horizontal_speed_m_s: float = 1.6
    climb_speed_m_s: float = 1.2
    descent_speed_m_s: float = 1.2
    horizontal_acceleration_m_s2: float = 2.0
    vertical_acceleration_m_s2: float = 1.5
    yaw_rate_rad_s: float = 1.0


@dataclass(frozen=True, slots=True)
class Info:
    """Identity of a UAV, and its capabilities."""

    namespace: str
    backend: str
    autopilot: str = ""
    autopilot_version: str = ""
    is_simulation: bool = False
    capabilities: frozenset[Capability] = frozenset()
    limits: Limits = field(default_factory=Limits)
    ual_version: str = ""
    is_arming_allowed: bool = False
    url: str = ""
    has_safety_pilot: bool = True


@dataclass(frozen=True, slots=True)
class LeaseInfo:
    """Lease of a UAV: the name of the only program that may fly it, and the time of its begin (UTC, seconds since the
    epoch).

    `identity` is the name of the certificate or token that was shown, and ``local`` for a program on the daemon's
    computer without either.
    """

    holder: str
    identity: str
    since_s: float
