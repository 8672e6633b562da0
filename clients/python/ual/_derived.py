"""The members that are one call each. ``make clients`` writes this file: do not edit it."""

from __future__ import annotations

from abc import abstractmethod
from typing import TypeVar

from typing_extensions import override

from ual import _calls, interface
from ual._calls import Call
from ual._connection import Connection
from ual._service_calls import simulation as _simulation_calls
from ual._service_calls import uav as _uav_calls
from ual._setpoints import Setpoints
from ual.geometry import Pose, PoseStamped, Transform, Twist, TwistStamped, Vector3
from ual.simulation import Fault, SimulationPart
from ual.types import Frame, Geofence, Info, LeaseInfo, Route, Telemetry

T = TypeVar("T")


class UavMembers(interface.Uav):
    """Members of `ual.Uav`."""

    _connection: Connection
    _setpoints: Setpoints
    _external_poses: Setpoints

    @abstractmethod
    def _command(self, call: Call[T], timeout_s: float | None = None) -> T:
        """Makes a call that comes after the setpoints given before it."""

    @override
    def info(self) -> Info:
        return self._connection.run(_uav_calls.info())

    @override
    def telemetry(self) -> Telemetry:
        return self._connection.run(_uav_calls.telemetry())

    @override
    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        return self._connection.run(
            _uav_calls.transform(target_frame_id=target_frame_id, source_frame_id=source_frame_id)
        )

    @override
    def frames(self) -> list[Frame]:
        return self._connection.run(_uav_calls.frames())

    @override
    def geofence(self) -> Geofence:
        return self._connection.run(_uav_calls.geofence())

    @override
    def route(self) -> Route | None:
        return self._connection.run(_uav_calls.route())

    @override
    def add_frame(self, transform: Transform) -> None:
        self._connection.run(_uav_calls.add_frame(transform))

    @override
    def remove_frame(self, frame_id: str) -> None:
        self._connection.run(_uav_calls.remove_frame(frame_id))

    @override
    def set_home(self, set_z: bool = False) -> None:
        self._command(_uav_calls.set_home(set_z))

    @override
    def arm(self, *, timeout_s: float | None = None) -> None:
        self._command(_uav_calls.arm(), timeout_s)

    @override
    def disarm(self, *, timeout_s: float | None = None) -> None:
        self._command(_uav_calls.disarm(), timeout_s)

    @override
    def lease_info(self) -> LeaseInfo | None:
        return self._connection.run(_uav_calls.lease_info())

    @override
    def set_pose(self, pose: PoseStamped | Pose) -> None:
        self._setpoints.send(_calls.set_pose(pose))

    @override
    def set_velocity(self, velocity: TwistStamped | Twist) -> None:
        self._setpoints.send(_calls.set_velocity(velocity))

    @override
    def set_external_pose(
        self,
        pose: PoseStamped | Pose,
        *,
        position_std_dev_m: float | None = None,
        orientation_std_dev_rad: float | None = None,
    ) -> None:
        self._external_poses.send(
            _calls.set_external_pose(
                pose, position_std_dev_m=position_std_dev_m, orientation_std_dev_rad=orientation_std_dev_rad
            )
        )

    @override
    def recover_from_manual(self, *, force: bool = False, timeout_s: float | None = None) -> None:
        self._command(_calls.recover_from_manual(force=force), timeout_s)

    @override
    def abort(self, freeze: bool = False) -> None:
        self._command(_calls.abort(freeze))

    @override
    def pause(self) -> None:
        self._command(_calls.pause())

    @override
    def resume(self) -> None:
        self._command(_calls.resume())


class SimulationMembers(interface.Simulation):
    """Members of `ual.Uav.simulation`."""

    _connection: Connection

    @override
    def parts(self) -> frozenset[SimulationPart]:
        return self._connection.run(_simulation_calls.parts())

    @override
    def pilot_arm(self) -> None:
        self._connection.run(_simulation_calls.pilot_arm())

    @override
    def pilot_disarm(self) -> None:
        self._connection.run(_simulation_calls.pilot_disarm())

    @override
    def pilot_take_over(self) -> None:
        self._connection.run(_simulation_calls.pilot_take_over())

    @override
    def pilot_move_sticks(self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0) -> None:
        self._connection.run(_simulation_calls.pilot_move_sticks(forward=forward, left=left, up=up, turn=turn))

    @override
    def pilot_give_back(self) -> None:
        self._connection.run(_simulation_calls.pilot_give_back())

    @override
    def begin_fault(self, fault: Fault, duration_s: float = 0.0) -> str:
        return self._connection.run(_simulation_calls.begin_fault(fault=fault, duration_s=duration_s))

    @override
    def end_fault(self, fault_id: str = "") -> None:
        self._connection.run(_simulation_calls.end_fault(fault_id))

    @override
    def faults(self) -> dict[str, Fault]:
        return self._connection.run(_simulation_calls.faults())

    @override
    def set_speed_factor(self, speed_factor: float) -> None:
        self._connection.run(_simulation_calls.set_speed_factor(speed_factor))

    @override
    def step(self, duration_s: float) -> None:
        self._connection.run(_simulation_calls.step(duration_s))

    @override
    def set_noise(self, *, position_m: float, velocity_m_s: float) -> None:
        self._connection.run(_simulation_calls.set_noise(position_m=position_m, velocity_m_s=velocity_m_s))

    @override
    def set_wind(self, velocity_m_s: Vector3) -> None:
        self._connection.run(_simulation_calls.set_wind(velocity_m_s))

    @override
    def place_on_ground(self, position: Vector3, yaw_rad: float = 0.0) -> None:
        self._connection.run(_simulation_calls.place_on_ground(position=position, yaw_rad=yaw_rad))
