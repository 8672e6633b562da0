"""A simulated autopilot's safety pilot as `ual.interface.Simulation`, and the backend that offers it."""

from __future__ import annotations

from typing_extensions import override

from tests.simulators.ardupilot import ArduPilot
from tests.simulators.autopilot import Autopilot, Sticks
from ual.errors import NotSupportedError
from ual.interface import Simulation
from ual.simulation import SimulationPart
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.mavlink import MavlinkBackend


class PilotedBackend(MavlinkBackend):
    """The MAVLink backend, with the safety pilot of the simulated autopilot that it flies."""

    def __init__(self, options: BackendOptions, autopilot: Autopilot) -> None:
        super().__init__(options)
        self._simulation = PilotSimulation(autopilot)

    def simulation(self) -> Simulation:
        return self._simulation


class PilotSimulation(Simulation):
    """The safety pilot. The other members of a simulation are not supported."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot

    @override
    def parts(self) -> frozenset[SimulationPart]:
        return frozenset((SimulationPart.PILOT,))

    @override
    def pilot_arm(self) -> None:
        autopilot = self._autopilot
        autopilot.pilot_readies()
        assert autopilot.pilot_arm(), autopilot.said

    @override
    def pilot_disarm(self) -> None:
        assert self._autopilot.pilot_disarm()

    @override
    def pilot_take_over(self) -> None:
        self._autopilot.pilot_take_over()

    @override
    def pilot_move_sticks(self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0) -> None:
        self._autopilot.pilot_moves(Sticks(forward, -left, up, -turn))

    @override
    def pilot_give_back(self) -> None:
        if not isinstance(self._autopilot, ArduPilot):
            raise NotSupportedError("PX4's pilot cannot give back: PX4 takes OFFBOARD only while setpoints come")
        self._autopilot.pilot_give_back()
