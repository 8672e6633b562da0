"""A simulated autopilot's safety pilot as `ual.interface.Simulation`, and the backend that offers it."""

from __future__ import annotations

from tests.simulators.ardupilot import ArduPilot
from tests.simulators.autopilot import Autopilot, Sticks
from ual.errors import NotSupportedError
from ual.geometry import Vector3
from ual.interface import Simulation
from ual.simulation import Fault
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.mavlink import MavlinkBackend


class PilotedBackend(MavlinkBackend):
    """The MAVLink backend, with the safety pilot of the simulated autopilot that it flies."""

    def __init__(self, options: BackendOptions, autopilot: Autopilot) -> None:
        super().__init__(options)
        self._simulation = PilotSimulation(autopilot)

    def simulation(self) -> Simulation:
        return self._simulation


class PilotSimulation:
    """The safety pilot. The other members of a simulation are not supported."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot

    def pilot_arm(self) -> None:
        autopilot = self._autopilot
        autopilot.pilot_readies()
        assert autopilot.pilot_arm(), autopilot.said

    def pilot_disarm(self) -> None:
        assert self._autopilot.pilot_disarm()

    def pilot_take_over(self) -> None:
        self._autopilot.pilot_take_over()

    def pilot_move_sticks(self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0) -> None:
        self._autopilot.pilot_moves(Sticks(forward, -left, up, -turn))

    def pilot_give_back(self) -> None:
        if not isinstance(self._autopilot, ArduPilot):
            raise NotSupportedError("PX4's pilot cannot give back: PX4 takes OFFBOARD only while setpoints come")
        self._autopilot.pilot_give_back()

    def begin_fault(self, fault: Fault, duration_s: float = 0.0) -> str:
        raise self._refusal()

    def end_fault(self, fault_id: str = "") -> None:
        raise self._refusal()

    def faults(self) -> dict[str, Fault]:
        return {}

    def set_speed_factor(self, speed_factor: float) -> None:
        raise self._refusal()

    def step(self, duration_s: float) -> None:
        raise self._refusal()

    def set_noise(self, *, position_m: float, velocity_m_s: float) -> None:
        raise self._refusal()

    def set_wind(self, velocity_m_s: Vector3) -> None:
        raise self._refusal()

    @staticmethod
    def _refusal() -> NotSupportedError:
        return NotSupportedError("a simulated autopilot offers its safety pilot only")
