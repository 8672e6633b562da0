"""The client: one UAV, flown through its daemon."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from typing_extensions import override

from ual import _calls, interface
from ual._connection import Connection
from ual._lease import Lease
from ual._setpoints import EXTERNAL_POSES, Setpoints
from ual._subscription import Subscription, Subscriptions
from ual._target import Target
from ual._task import Task
from ual.credentials import Credentials
from ual.geometry import Pose, PoseStamped, Transform, Twist, TwistStamped, Vector3, stamped_pose, stamped_twist
from ual.simulation import Fault, SimulationPart
from ual.types import ExternalPose, Frame, Geofence, Info, LeaseInfo, Plan, Route, TaskRequest, Telemetry

if TYPE_CHECKING:
    from ual.network import Network

T = TypeVar("T")


class Uav(interface.Uav):
    """One UAV, flown through its daemon. Its members are those of `ual.interface.Uav`.

    Nothing is connected until the first call. A daemon that was restarted is found again.

    Args:
        ns: The namespace of a daemon on this computer, such as ``uav_2``. Default: ``$UAL_NS``.
        address: Where the daemon is, ``host:50051`` or ``unix:/run/ual/uav_2.sock``. Default: ``$UAL_ADDRESS``. Where
            neither is given, it is the only UAV of this computer.
        tls_ca: A file with the certificates to trust, for a daemon that uses TLS.
        credentials: What shows the daemon who calls. Default: the environment's (`Credentials.from_environment`).
        network: Where `ns` is looked for instead of on this computer (`ual.network.Network`); it stays open meanwhile.

    Example:
        >>> with ual.Uav("uav_1") as uav:
        ...     uav.take_off(3.0)
        ...     uav.go_to_waypoint(ual.Pose.at(4.0, 2.0, 3.0))
        ...     uav.land()

    """

    def __init__(
        self,
        ns: str | None = None,
        *,
        address: str | None = None,
        tls_ca: str | Path | None = None,
        credentials: Credentials | None = None,
        network: Network | None = None,
    ) -> None:
        self._connection = Connection(Target(ns, address, tls_ca, credentials, network))
        self._lease: Lease | None = None
        self._setpoints = Setpoints(self._connection)
        self._external_poses = Setpoints(self._connection, kind=EXTERNAL_POSES)
        self._dry_run = interface.DryRun(lambda motion: self._connection.run(_calls.dry_run(motion)))
        self._simulation = Simulation(self._connection)
        self._is_simulation = False
        self._subscriptions = Subscriptions(self._connection)

    def __repr__(self) -> str:
        return f"<ual.Uav {self._connection.described}>"

    @property
    @override
    def ns(self) -> str:
        """The namespace. Asks the daemon where none was given."""
        return self._connection.target.ns or self.info().namespace

    @property
    def address(self) -> str:
        """Where the daemon is, or would be."""
        return self._connection.target.address()

    @override
    def close(self) -> None:
        """Ends the setpoints, the subscriptions, the lease and the connection.

        A task of the UAV goes on, unless there was a lease; a velocity does not.
        """
        self._setpoints.settle()
        if self._lease is not None:
            self._lease.release()
        self._external_poses.settle()
        self._subscriptions.close()
        self._connection.close()

    @override
    def info(self) -> Info:
        info = self._connection.run(_calls.get_info())
        self._connection.target.note_ns(info.namespace)
        return info

    @override
    def telemetry(self) -> Telemetry:
        return self._connection.run(_calls.get_telemetry())

    @override
    def subscribe(self, callback: Callable[[Telemetry], None], rate_hz: float = 0.0) -> Subscription:
        return self._subscriptions.open(callback, _calls.rate(rate_hz))

    @override
    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        return self._connection.run(_calls.get_transform(target_frame_id, source_frame_id))

    @override
    def frames(self) -> list[Frame]:
        return self._connection.run(_calls.list_frames())

    @override
    def geofence(self) -> Geofence:
        return self._connection.run(_calls.get_geofence())

    @override
    def route(self) -> Route | None:
        return self._connection.run(_calls.get_route())

    @override
    def add_frame(self, transform: Transform) -> None:
        self._connection.run(_calls.add_frame(transform))

    @override
    def remove_frame(self, frame_id: str) -> None:
        self._connection.run(_calls.remove_frame(frame_id))

    @override
    def set_home(self, set_z: bool = False) -> None:
        self._command(_calls.set_home(set_z))

    @override
    def arm(self, *, timeout_s: float | None = None) -> None:
        self._command(_calls.arm(), timeout_s)

    @override
    def disarm(self, *, timeout_s: float | None = None) -> None:
        self._command(_calls.disarm(), timeout_s)

    @override
    def _begin(self, request: TaskRequest, blocking: bool, timeout_s: float | None) -> Task:
        return Task(self._connection, self._command(_calls.begin_task(request, blocking), timeout_s))

    @override
    def set_pose(self, pose: PoseStamped | Pose) -> None:
        self._setpoints.send(_calls.setpoint(stamped_pose(pose), "pose"))

    @override
    def set_velocity(self, velocity: TwistStamped | Twist) -> None:
        self._setpoints.send(_calls.setpoint(stamped_twist(velocity), "velocity"))

    @override
    def set_external_pose(
        self,
        pose: PoseStamped | Pose,
        *,
        position_std_dev_m: float | None = None,
        orientation_std_dev_rad: float | None = None,
    ) -> None:
        measured = ExternalPose(stamped_pose(pose), position_std_dev_m, orientation_std_dev_rad)
        self._external_poses.send(_calls.external_pose(measured))

    @override
    def recover_from_manual(self, *, force: bool = False, timeout_s: float | None = None) -> None:
        self._command(_calls.recover_from_manual(force), timeout_s)

    @override
    def abort(self, freeze: bool = False) -> None:
        self._command(_calls.abort(freeze))

    @override
    def pause(self) -> None:
        self._command(_calls.pause())

    @override
    def resume(self) -> None:
        self._command(_calls.resume())

    @override
    def lease(self, holder: str = "", *, take: bool = False) -> Lease:
        self._lease = Lease(self._connection, holder, take=take, settle=self._setpoints.settle)
        return self._lease

    @override
    def extension(self, name: str) -> Any:
        from ual import extension

        return extension.client_of(name, self._connection)

    @override
    def lease_info(self) -> LeaseInfo | None:
        return self._connection.run(_calls.get_lease())

    @override
    def task(self, task_id: str) -> Task:
        return Task(self._connection, self._connection.run(_calls.get_task(task_id)))

    @property
    @override
    def dry_run(self) -> interface.DryRun[Plan]:
        return self._dry_run

    @property
    @override
    def simulation(self) -> Simulation:
        if not self._is_simulation:
            self._simulation.parts()
            self._is_simulation = True
        return self._simulation

    def _command(self, call: _calls.Call[T], timeout_s: float | None = None) -> T:
        """Makes a call that comes after the setpoints given before it: none of them may overtake an abort."""
        self._setpoints.settle()
        return self._connection.run(call, timeout_s)


class Simulation(interface.Simulation):
    """The world around a simulated UAV, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Simulation of {self._connection.described}>"

    @override
    def parts(self) -> frozenset[SimulationPart]:
        return self._connection.run(_calls.list_parts())

    @override
    def pilot_arm(self) -> None:
        self._connection.run(_calls.pilot_arm())

    @override
    def pilot_disarm(self) -> None:
        self._connection.run(_calls.pilot_disarm())

    @override
    def pilot_take_over(self) -> None:
        self._connection.run(_calls.pilot_take_over())

    @override
    def pilot_move_sticks(self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0) -> None:
        self._connection.run(_calls.pilot_move_sticks(forward, left, up, turn))

    @override
    def pilot_give_back(self) -> None:
        self._connection.run(_calls.pilot_give_back())

    @override
    def begin_fault(self, fault: Fault, duration_s: float = 0.0) -> str:
        return self._connection.run(_calls.begin_fault(fault, duration_s))

    @override
    def end_fault(self, fault_id: str = "") -> None:
        self._connection.run(_calls.end_fault(fault_id))

    @override
    def faults(self) -> dict[str, Fault]:
        return self._connection.run(_calls.list_faults())

    @override
    def set_speed_factor(self, speed_factor: float) -> None:
        self._connection.run(_calls.set_speed_factor(speed_factor))

    @override
    def step(self, duration_s: float) -> None:
        self._connection.run(_calls.step(duration_s))

    @override
    def set_noise(self, *, position_m: float, velocity_m_s: float) -> None:
        self._connection.run(_calls.set_noise(position_m, velocity_m_s))

    @override
    def set_wind(self, velocity_m_s: Vector3) -> None:
        self._connection.run(_calls.set_wind(velocity_m_s))

    @override
    def place_on_ground(self, position: Vector3, yaw_rad: float = 0.0) -> None:
        self._connection.run(_calls.place_on_ground(position, yaw_rad))
