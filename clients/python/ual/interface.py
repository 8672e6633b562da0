"""The interface, as protocols: what the class (`ual_daemon.UAL`) and the client (`ual.Uav`) both are.

Each member may be called from any thread at any time, and raises the errors of `ual.errors`. Names without a frame are
in ``<ns>/odom``. `timeout_s` is how long the caller is ready to wait (None: as long as it can take); when it passes,
the call raises `UalTimeoutError`, and a go-to or path that it waited for is cancelled: the UAV holds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Protocol

from ual.geometry import PointStamped, Pose, PoseStamped, Transform, Twist, TwistStamped, Vector3
from ual.simulation import Fault
from ual.types import (
    AltitudeReference,
    Frame,
    Info,
    Odometry,
    PathHeading,
    Plan,
    State,
    TaskInfo,
    TaskKind,
    Telemetry,
    Waypoints,
)

if TYPE_CHECKING:
    from typing_extensions import Self


class Task(Protocol):
    """A manoeuvre under way, or ended."""

    @property
    def id(self) -> str: ...

    @property
    def kind(self) -> TaskKind: ...

    def info(self) -> TaskInfo:
        """How it stands now."""
        ...

    def done(self) -> bool:
        """True once it has ended, however."""
        ...

    def wait(self, timeout_s: float | None = None) -> TaskInfo:
        """Waits until it has ended, and raises its error if it was aborted or failed.

        Raises `UalTimeoutError` when it has not ended after `timeout_s`; it then goes on.
        """
        ...

    def cancel(self) -> None:
        """Ends it; the UAV stops and holds. Nothing happens if it has ended. Take-off and landing cannot be cancelled:
        `WrongStateError`.
        """
        ...

    def watch(self, rate_hz: float = 10.0) -> Iterator[TaskInfo]:
        """How it stands, again and again, until it has ended; the last one says how."""
        ...


class Subscription(Protocol):
    """A running subscription; ends by `close` or on leaving its ``with`` block."""

    def close(self) -> None: ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *exc: object) -> None: ...


class Simulation(Protocol):
    """The world around a simulated UAV; see ``ual/v1/simulation.proto``."""

    def pilot_arm(self) -> None: ...

    def pilot_disarm(self) -> None: ...

    def pilot_take_over(self) -> None: ...

    def pilot_move_sticks(
        self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0
    ) -> None: ...

    def pilot_give_back(self) -> None: ...

    def begin_fault(self, fault: Fault, duration_s: float = 0.0) -> str: ...

    def end_fault(self, fault_id: str = "") -> None: ...

    def faults(self) -> dict[str, Fault]: ...

    def set_speed_factor(self, speed_factor: float) -> None: ...

    def step(self, duration_s: float) -> None: ...

    def set_noise(self, *, position_m: float, velocity_m_s: float) -> None: ...

    def set_wind(self, velocity_m_s: Vector3) -> None: ...


class DryRun(Protocol):
    """The members of `Uav` that move it, with the same arguments, as questions: nothing moves, begins, or is sent. Each
    raises what the member of `Uav` would raise at once, or tells what the motion would be.
    """

    def take_off(self, height_m: float) -> Plan: ...

    def land(self) -> Plan: ...

    def go_to_waypoint(self, waypoint: PoseStamped | Pose, *, max_speed_m_s: float | None = None) -> Plan: ...

    def go_to_waypoint_geo(
        self,
        latitude_deg: float,
        longitude_deg: float,
        altitude_m: float,
        altitude_reference: AltitudeReference = AltitudeReference.HOME,
        *,
        yaw_rad: float | None = None,
        max_speed_m_s: float | None = None,
    ) -> Plan: ...

    def follow_path(
        self,
        waypoints: Waypoints,
        *,
        corner_radius_m: float = 0.0,
        max_speed_m_s: float | None = None,
        leg_speeds_m_s: Sequence[float] = (),
        heading: PathHeading = PathHeading.WAYPOINTS,
        point_of_interest: PointStamped | Vector3 | None = None,
    ) -> Plan: ...

    def set_pose(self, pose: PoseStamped | Pose) -> Plan: ...

    def set_velocity(self, velocity: TwistStamped | Twist) -> Plan: ...

    def recover_from_manual(self) -> Plan: ...


class Uav(Protocol):
    """One UAV, whatever its autopilot. For states, errors and units see ``ual/v1/ual.proto``, which is the manual."""

    @property
    def ns(self) -> str:
        """The namespace."""
        ...

    def close(self) -> None: ...

    def info(self) -> Info: ...

    def is_ready(self) -> bool:
        """True when the state is not UNINITIALIZED."""
        ...

    def is_idle(self) -> bool:
        """True when no task runs."""
        ...

    def state(self) -> State: ...

    def pose(self) -> PoseStamped:
        """The pose, in ``<ns>/odom`` or the configured ``pose_frame_id``. `WrongStateError` while it is not known."""
        ...

    def velocity(self) -> TwistStamped:
        """The velocity along the axes of the frame of `pose`. `WrongStateError` while it is not known."""
        ...

    def odometry(self) -> Odometry: ...

    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        """What takes coordinates in the source frame (default ``<ns>/base_link``) to the target (default ``map``)."""
        ...

    def reference_pose(self) -> PoseStamped | None:
        """Where the UAV is told to be; None while no reference is given."""
        ...

    def telemetry(self) -> Telemetry: ...

    def subscribe(self, callback: Callable[[Telemetry], None], rate_hz: float = 0.0) -> Subscription:
        """Calls back with new samples, at most `rate_hz` (0: every update), on a thread that is not the caller's.

        A callback that is too slow gets the newest sample and sees in `missed_count` how many it lost.
        """
        ...

    def frames(self) -> list[Frame]: ...

    def add_frame(self, transform: Transform) -> None:
        """Adds, or moves, the frame `transform.child_frame_id` in its parent `transform.frame_id` (empty: ``map``).

        It may be moved often (50 Hz); `transform.stamp_s` is when it was there, 0 where that is not known.
        """
        ...

    def arm(self, *, timeout_s: float | None = None) -> None: ...

    def disarm(self, *, timeout_s: float | None = None) -> None: ...

    def take_off(self, height_m: float, *, blocking: bool = True, timeout_s: float | None = None) -> Task: ...

    def land(self, *, blocking: bool = True, timeout_s: float | None = None) -> Task: ...

    def go_to_waypoint(
        self,
        waypoint: PoseStamped | Pose,
        *,
        max_speed_m_s: float | None = None,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> Task:
        """Flies straight to a pose, at most at `max_speed_m_s` (0.01 or more) in any direction, and within the limits
        of the UAV; None: only these.
        """
        ...

    def go_to_waypoint_geo(
        self,
        latitude_deg: float,
        longitude_deg: float,
        altitude_m: float,
        altitude_reference: AltitudeReference = AltitudeReference.HOME,
        *,
        yaw_rad: float | None = None,
        max_speed_m_s: float | None = None,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> Task: ...

    def follow_path(
        self,
        waypoints: Waypoints,
        *,
        corner_radius_m: float = 0.0,
        max_speed_m_s: float | None = None,
        leg_speeds_m_s: Sequence[float] = (),
        heading: PathHeading = PathHeading.WAYPOINTS,
        point_of_interest: PointStamped | Vector3 | None = None,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> Task:
        """Flies through waypoints.

        It leaves the straight legs at most `corner_radius_m` from a corner, or (0) stops at each. `max_speed_m_s` is as
        in `go_to_waypoint`; `leg_speeds_m_s`, empty or one for each waypoint, is the same for the leg that ends there
        (0: only `max_speed_m_s`). The nose points as `heading` says, where only `PathHeading.WAYPOINTS` heeds the
        orientations of the waypoints; `point_of_interest` belongs to `PathHeading.POINT_OF_INTEREST`.
        """
        ...

    def set_pose(self, pose: PoseStamped | Pose) -> None: ...

    def set_velocity(self, velocity: TwistStamped | Twist) -> None: ...

    def recover_from_manual(self, *, timeout_s: float | None = None) -> None: ...

    def set_home(self, set_z: bool = False) -> None: ...

    def abort(self, freeze: bool = False) -> None: ...

    def task(self, task_id: str) -> Task:
        """A task, running or ended lately, by its id. `InvalidArgumentError` if there is none."""
        ...

    @property
    def dry_run(self) -> DryRun:
        """The motions, as questions: what would happen, without anything moving."""
        ...

    @property
    def simulation(self) -> Simulation:
        """The world around a simulated UAV. `NotSupportedError` for a real one."""
        ...
