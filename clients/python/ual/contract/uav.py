"""The UAV abstraction layer: one contract to fly any UAV, whatever its autopilot. As values, from ``ual.proto``.

``make proto`` writes this file: do not edit it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum, IntEnum

from ual.contract._bases import TelemetryBase
from ual.contract.odometry import Odometry
from ual.errors import UalError
from ual.geometry import Pose, Transform, Twist, Vector3


class State(Enum):
    """State of the UAV, estimated from the autopilot's data at each update."""

    UNINITIALIZED = 1
    """Nothing can be done: no fresh data, no pose, or the estimator has not converged.

    `Telemetry.state_reason` says why.
    """
    LANDED_DISARMED = 2
    """The motors are not armed."""
    LANDED_ARMED = 3
    """Armed, on the ground."""
    TAKING_OFF = 4
    """A take-off is in progress."""
    FLYING_AUTO = 5
    """In the air; the autopilot takes its references from this daemon."""
    FLYING_MANUAL = 6
    """In the air; the safety pilot, or another of the autopilot's modes, flies."""
    LANDING = 7
    """A landing is in progress."""


class AltitudeReference(Enum):
    """Reference of an altitude."""

    HOME = 1
    """Above the autopilot's home position."""
    AMSL = 2
    """Above mean sea level."""
    ELLIPSOID = 3
    """Above the WGS 84 ellipsoid (what GNSS receivers measure)."""


class PathHeading(Enum):
    """Heading of the nose on a path. It turns within the UAV's limits, and the motion waits where it must."""

    WAYPOINTS = 1
    """Turns to each waypoint's orientation during the leg before it."""
    FIXED = 2
    """Keeps the heading that it has."""
    ALONG_PATH = 3
    """Along the path."""
    POINT_OF_INTEREST = 4
    """At the point of interest."""


class TaskKind(Enum):
    """Kind of manoeuvre of a task."""

    TAKE_OFF = 1
    LAND = 2
    GO_TO_WAYPOINT = 3
    GO_TO_WAYPOINT_GEO = 4
    FOLLOW_PATH = 5
    RETURN_TO_LAUNCH = 6
    MISSION = 7
    """Of MissionService."""


class TaskStatus(Enum):
    """Status of a task."""

    RUNNING = 1
    SUCCEEDED = 2
    """It ended as it should."""
    ABORTED = 3
    """Replaced, cancelled, or taken by the safety pilot; `error` says which."""
    FAILED = 4
    """It could not be done (timeout, refused by the autopilot, link lost); `error` says why."""


class Capability(Enum):
    """Something a backend can do. What is missing here is answered with NOT_SUPPORTED."""

    ARM = 1
    TAKE_OFF = 2
    LAND = 3
    POSITION = 4
    """GoToWaypoint, FollowPath and SetPose."""
    VELOCITY = 5
    GEO = 6
    """GoToWaypointGeo."""
    RECOVER = 7
    EXTERNAL_POSE = 8
    """SetExternalPose and StreamExternalPoses."""


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
class Battery:
    """A battery. What the autopilot does not report is None.

    Args:
        remaining_percent: 0 to 100.
        current_a: Positive while discharging.
        id: The autopilot's number of the battery, from 0.
        function: What it feeds: "all", "propulsion", "avionics", "payload"; empty where the autopilot does not say.

    """

    remaining_percent: float | None = None
    voltage_v: float | None = None
    current_a: float | None = None
    id: int = 0
    function: str = ""


@dataclass(frozen=True, slots=True)
class GpsInfo:
    """The satellite receiver.

    Args:
        satellites_count: 0 where it is not reported, or none is received.
        horizontal_accuracy_m: One standard deviation.
        corrections_age_s: Time since the last RTK corrections were sent to the autopilot; None if there were none.
        baseline_m: Distance from the base station whose corrections it uses; None if it does not report that.

    """

    fix: GpsFix
    satellites_count: int | None = None
    horizontal_accuracy_m: float | None = None
    vertical_accuracy_m: float | None = None
    corrections_age_s: float | None = None
    baseline_m: float | None = None


@dataclass(frozen=True, slots=True)
class Health:
    """Health of the autopilot by its own report, before and during the flight.

    Args:
        is_ready_to_arm: Whether the autopilot's own checks permit arming; None if it does not report that.
        failing_checks: Failing checks and sensors, human-readable; empty if none fails or none is reported. The
            beginning "daemon: " marks failures of the daemon itself, such as its audit. "position: " marks problems of
            the position, and "autopilot: " texts of the autopilot that are critical or worse, for 30 s.
        link_quality: Recent fraction of the autopilot's messages that arrived, 0 to 1; None if that is not measured.
        failsafe: The active failsafe, in the words of the metadata `by`: "battery failsafe", "rc failsafe", "fence",
            ...; empty: none. While it is active, take-off and recovery are refused, unless forced.
        held_by: The holder of control in the present mode, in the same words; empty if that is this daemon, or not
            known.

    """

    is_ready_to_arm: bool | None = None
    failing_checks: tuple[str, ...] = ()
    link_quality: float | None = None
    failsafe: str = ""
    held_by: str = ""


@dataclass(frozen=True, slots=True)
class TaskInfo:
    """A manoeuvre that takes time.

    Args:
        progress: 0 to 1, where it is known.
        waypoint_index: The waypoint to which a path leads now, or the present item of a mission; counted from 0.
        error: Set when it was aborted or failed.
        description: The command, human-readable.
        is_paused: Pause has stopped the task, which still runs; Resume continues it.

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
    """Motion that a request would make, from the present (or commanded) position of the UAV.

    What is not known is None: of a landing, which the autopilot flies by itself, and of a reference. That of
    ReturnToLaunch ends where its landing begins.

    Args:
        length_m: The path.
        duration_s: How long it takes in calm air.

    """

    length_m: float | None = None
    duration_s: float | None = None


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame of the tree.

    Args:
        parent_frame_id: Empty for the root, `map`.
        transform: From this frame to its parent; None where it is not known (yet).
        is_static: False for frames that move by themselves (``<ns>/base_link``).

    """

    frame_id: str
    parent_frame_id: str
    transform: Transform | None
    is_static: bool


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
class Circle:
    """An upright cylinder.

    Args:
        center: Its z says nothing.

    """

    center: Vector3
    radius_m: float


@dataclass(frozen=True, slots=True)
class Route:
    """The path of the running task.

    Args:
        frame_id: The frame of the points, `map`.
        points: From where the task begins to where it ends, within 0.1 m of the path where that needs no more than
            2,000 points; else that many points on it. Of a goal that moves: from the commanded position of the UAV to
            the present position of the goal.
        task_id: The task; empty where a reference leads there.
        is_goal_moving: The goal moves, and so does the path to it.

    """

    frame_id: str
    points: tuple[Vector3, ...]
    task_id: str = ""
    is_goal_moving: bool = False


@dataclass(frozen=True, slots=True)
class GeoWaypoint:
    """A geographic position to fly to.

    Args:
        latitude_deg: -90 to 90.
        longitude_deg: -180 to 180.
        yaw_rad: Heading, counter-clockwise from east (REP 103); keeps the heading when None.

    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    altitude_reference: AltitudeReference = AltitudeReference.HOME
    yaw_rad: float | None = None


@dataclass(frozen=True, slots=True)
class LeaseInfo:
    """Only caller that may fly a UAV.

    Args:
        holder: The program, as it calls itself.
        identity: Whose certificate or token it showed; `local` for a program on the daemon's computer without either.
        since_s: UTC.

    """

    holder: str
    identity: str
    since_s: float


@dataclass(frozen=True, slots=True, repr=False)
class Telemetry(TelemetryBase):
    """One sample of everything known. What is not known is None.

    Args:
        state_reason: Why the state is UNINITIALIZED; else what the state follows from. Human-readable.
        stamp_s: Time of the pose, UTC.
        frame_id: Frame of pose, velocity and reference_pose (``<ns>/odom``, or the configured `pose_frame_id`).
        velocity: Along the axes of the header's frame.
        transform: `map` to ``<ns>/base_link``.
        reference_pose: Commanded pose of the UAV; set while the daemon sends setpoints.
        battery: The battery that the flight depends on: the emptiest of those that feed more than the payload.
        flight_mode: The autopilot's own name of its mode, human-readable.
        task: The running task.
        sequence: Counts the samples of this daemon from its start.
        status_text: The autopilot's newest words to the operator (status text), human-readable.
        frame_lost: Cause, time and remedy if the position of ``<ns>/odom`` is lost (FRAME_LOST), human-readable; empty
            while it is known. While it is lost, a pose in a lost frame is None, nor is `odometry`.
        missed_count: Samples that this subscriber lost since its last one.
        batteries: All batteries in the order of their ids, if the autopilot reports each; `battery` is one of them.

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


@dataclass(frozen=True, slots=True)
class Geofence:
    """Bounds of flight: the UAV stays inside all of the following at once. What is None does not limit it.

    Args:
        frame_id: The frame of all others, `map`.
        corners: The corners of a polygon in order; their z is ignored. None: no polygon.
        circle: Of the autopilot's own fence, less the reserve that UAL keeps.
        min_z_m: The highest of all lower edges: of the configured fence, of the floor, and of the autopilot's own
            fence.
        max_z_m: The lowest of all upper edges.

    """

    frame_id: str = "map"
    corners: tuple[Vector3, ...] = ()
    circle: Circle | None = None
    min_z_m: float | None = None
    max_z_m: float | None = None


@dataclass(frozen=True, slots=True)
class Info:
    """Identity of a UAV, and what it can do.

    Args:
        backend: Name of the backend: "light", "mavlink", ...
        autopilot: Name of the autopilot, empty until known: "PX4", ...
        autopilot_version: Empty until known.
        is_simulation: True when SimulationService is offered or the vehicle says that it is simulated.
        ual_version: Version of the daemon.
        is_arming_allowed: True where Arm and Disarm are permitted.
        url: The autopilot's address, human-readable.
        has_safety_pilot: Whether a person can take over at any time (a transmitter, a simulated pilot). Where that is
            not so, Abort ends take-offs and landings, too.

    """

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
