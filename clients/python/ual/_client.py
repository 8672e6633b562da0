"""The client: one UAV, flown through its daemon."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from typing_extensions import Self

from ual import _calls, _views
from ual._connection import Connection
from ual._dry_run import DryRun
from ual._setpoints import Setpoints
from ual._subscription import Subscription, Subscriptions
from ual._target import Target
from ual._task import Task
from ual.geometry import PointStamped, Pose, PoseStamped, Transform, Twist, TwistStamped, Vector3
from ual.simulation import Fault
from ual.types import AltitudeReference, Frame, Info, Odometry, PathHeading, State, TaskInfo, Telemetry, Waypoints

_log = logging.getLogger(__name__)

T = TypeVar("T")


class Uav:
    """One UAV, flown through its daemon; its members are those of `ual.interface.Uav`.

    ``Uav("uav_2")`` finds the daemon of that namespace on this computer; ``Uav(address="host:50051")`` or
    ``Uav(address="unix:/run/ual/uav_2.sock")`` goes elsewhere; ``$UAL_NS`` and ``$UAL_ADDRESS`` stand in for what is
    not given, and where nothing is, it is the only UAV of this computer. `tls_ca` is a file with the certificates to
    trust, for a daemon that uses TLS. Nothing is connected until the first call, and a daemon that was restarted is
    found again.
    """

    def __init__(self, ns: str | None = None, *, address: str | None = None, tls_ca: str | Path | None = None) -> None:
        self._connection = Connection(Target(ns, address, tls_ca))
        self._setpoints = Setpoints(self._connection)
        self._dry_run = DryRun(self._connection)
        self._simulation = Simulation(self._connection)
        self._is_simulation = False
        self._subscriptions = Subscriptions(self._connection)

    @property
    def ns(self) -> str:
        """The namespace; asks the daemon where none was given."""
        return self._connection.target.ns or self.info().namespace

    @property
    def address(self) -> str:
        """Where the daemon is, or would be."""
        return self._connection.target.address()

    def close(self) -> None:
        """Ends the setpoints, the subscriptions and the connection. The UAV goes on as the interface says."""
        self._setpoints.settle()
        self._subscriptions.close()
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def info(self) -> Info:
        return self._connection.run(_calls.get_info())

    def is_ready(self) -> bool:
        return _views.is_ready(self.telemetry())

    def is_idle(self) -> bool:
        return _views.is_idle(self.telemetry())

    def state(self) -> State:
        return self.telemetry().state

    def pose(self) -> PoseStamped:
        return _views.pose(self.telemetry())

    def velocity(self) -> TwistStamped:
        return _views.velocity(self.telemetry())

    def odometry(self) -> Odometry:
        return _views.odometry(self.telemetry())

    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        return self._connection.run(_calls.get_transform(target_frame_id, source_frame_id))

    def reference_pose(self) -> PoseStamped | None:
        return _views.reference_pose(self.telemetry())

    def telemetry(self) -> Telemetry:
        return self._connection.run(_calls.get_telemetry())

    def subscribe(self, callback: Callable[[Telemetry], None], rate_hz: float = 0.0) -> Subscription:
        return self._subscriptions.open(callback, _calls.rate(rate_hz))

    def frames(self) -> list[Frame]:
        return self._connection.run(_calls.list_frames())

    def add_frame(self, transform: Transform) -> None:
        self._connection.run(_calls.add_frame(transform))

    def arm(self, *, timeout_s: float | None = None) -> None:
        self._command(_calls.arm(), timeout_s)

    def disarm(self, *, timeout_s: float | None = None) -> None:
        self._command(_calls.disarm(), timeout_s)

    def take_off(self, height_m: float, *, blocking: bool = True, timeout_s: float | None = None) -> Task:
        return self._command_task(_calls.take_off(height_m, blocking), timeout_s)

    def land(self, *, blocking: bool = True, timeout_s: float | None = None) -> Task:
        return self._command_task(_calls.land(blocking), timeout_s)

    def go_to_waypoint(
        self,
        waypoint: PoseStamped | Pose,
        *,
        max_speed_m_s: float | None = None,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> Task:
        return self._command_task(_calls.go_to_waypoint(waypoint, max_speed_m_s, blocking), timeout_s)

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
    ) -> Task:
        call = _calls.go_to_waypoint_geo(
            latitude_deg, longitude_deg, altitude_m, altitude_reference, yaw_rad, max_speed_m_s, blocking
        )
        return self._command_task(call, timeout_s)

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
        call = _calls.follow_path(
            waypoints, corner_radius_m, max_speed_m_s, leg_speeds_m_s, heading, point_of_interest, blocking
        )
        return self._command_task(call, timeout_s)

    def set_pose(self, pose: PoseStamped | Pose) -> None:
        self._setpoints.send(_calls.pose_setpoint(pose))

    def set_velocity(self, velocity: TwistStamped | Twist) -> None:
        self._setpoints.send(_calls.velocity_setpoint(velocity))

    def recover_from_manual(self, *, timeout_s: float | None = None) -> None:
        self._command(_calls.recover_from_manual(), timeout_s)

    def set_home(self, set_z: bool = False) -> None:
        self._command(_calls.set_home(set_z))

    def abort(self, freeze: bool = False) -> None:
        self._command(_calls.abort(freeze))

    def task(self, task_id: str) -> Task:
        return self._task(_calls.get_task(task_id), None)

    @property
    def dry_run(self) -> DryRun:
        """The motions, as questions: what would happen, without anything moving."""
        return self._dry_run

    @property
    def simulation(self) -> Simulation:
        """The world around a simulated UAV. `NotSupportedError` for a real one."""
        if not self._is_simulation:
            self._simulation.faults()
            self._is_simulation = True
        return self._simulation

    def _command(self, call: _calls.Call[T], timeout_s: float | None = None) -> T:
        """Makes a call that comes after the setpoints given before it: none of them may overtake an abort."""
        self._setpoints.settle()
        return self._connection.run(call, timeout_s)

    def _command_task(self, call: _calls.Call[TaskInfo], timeout_s: float | None) -> Task:
        return Task(self._connection, self._command(call, timeout_s))

    def _task(self, call: _calls.Call[TaskInfo], timeout_s: float | None) -> Task:
        return Task(self._connection, self._connection.run(call, timeout_s))


class Simulation:
    """The world around a simulated UAV; see ``ual/v1/simulation.proto``."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def pilot_arm(self) -> None:
        self._connection.run(_calls.pilot_arm())

    def pilot_disarm(self) -> None:
        self._connection.run(_calls.pilot_disarm())

    def pilot_take_over(self) -> None:
        self._connection.run(_calls.pilot_take_over())

    def pilot_move_sticks(self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0) -> None:
        self._connection.run(_calls.pilot_move_sticks(forward, left, up, turn))

    def pilot_give_back(self) -> None:
        self._connection.run(_calls.pilot_give_back())

    def begin_fault(self, fault: Fault, duration_s: float = 0.0) -> str:
        return self._connection.run(_calls.begin_fault(fault, duration_s))

    def end_fault(self, fault_id: str = "") -> None:
        self._connection.run(_calls.end_fault(fault_id))

    def faults(self) -> dict[str, Fault]:
        return self._connection.run(_calls.list_faults())

    def set_speed_factor(self, speed_factor: float) -> None:
        self._connection.run(_calls.set_speed_factor(speed_factor))

    def step(self, duration_s: float) -> None:
        self._connection.run(_calls.step(duration_s))

    def set_noise(self, *, position_m: float, velocity_m_s: float) -> None:
        self._connection.run(_calls.set_noise(position_m, velocity_m_s))

    def set_wind(self, velocity_m_s: Vector3) -> None:
        self._connection.run(_calls.set_wind(velocity_m_s))
