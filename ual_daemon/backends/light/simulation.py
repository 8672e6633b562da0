"""The world around one light vehicle, as `ual.interface.Simulation`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from typing_extensions import override

from ual.errors import WrongStateError
from ual.geometry import Vector3
from ual.interface import Simulation
from ual.simulation import FailsafeTriggered, Fault, SimulationPart
from ual_daemon import validation
from ual_daemon.backends.light.faults import Faults
from ual_daemon.backends.light.physics import FlightMode
from ual_daemon.backends.light.world import Vehicles, World
from ual_daemon.backends.values import Cause

_MAX_NOISE_VALUE = 1000.0


class Simulated(Protocol):
    """Commands and reports of a simulated vehicle."""

    def snapshot(self) -> object:
        """Takes its newest data."""
        ...

    def pilot(self, action: Callable[[Vehicles], str | None]) -> None:
        """Does what the safety pilot commands."""
        ...

    def pilot_arm(self) -> None:
        """The safety pilot arms."""
        ...

    def pilot_disarm(self) -> None:
        """The safety pilot disarms."""
        ...

    def pilot_switch(self, mode: FlightMode) -> None:
        """The safety pilot switches the mode."""
        ...

    def trigger_failsafe(self, cause: Cause) -> None:
        """The autopilot leaves GUIDED by a failsafe, and holds its position."""
        ...

    def place_on_ground(self, position: Vector3, yaw_rad: float) -> None:
        """Puts the vehicle on the ground, which is there at the height of the place."""
        ...

    def set_noise(self, position_m: float, velocity_m_s: float) -> None:
        """Sets the standard deviations of the estimates."""
        ...


class LightSimulation(Simulation):
    """The safety pilot, faults, time, noise and wind of one vehicle."""

    def __init__(self, backend: Simulated, world: World, index: int, faults: Faults) -> None:
        self._backend = backend
        self._world = world
        self._index = index
        self._faults = faults

    @override
    def parts(self) -> frozenset[SimulationPart]:
        return frozenset(SimulationPart)

    @override
    def pilot_arm(self) -> None:
        self._backend.pilot_arm()

    @override
    def pilot_disarm(self) -> None:
        self._backend.pilot_disarm()

    @override
    def pilot_take_over(self) -> None:
        """The safety pilot takes over. The UAV hovers until the sticks are moved."""
        self._backend.pilot_switch(FlightMode.MANUAL)

    @override
    def pilot_move_sticks(self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0) -> None:
        """The safety pilot moves the sticks, each from -1 to 1."""
        sticks = (
            validation.number(forward, "forward", at_most=1.0),
            validation.number(left, "left", at_most=1.0),
            validation.number(up, "up", at_most=1.0),
            validation.number(turn, "turn", at_most=1.0),
        )

        def move(fleet: Vehicles) -> None:
            if fleet.mode[self._index] != FlightMode.MANUAL:
                raise WrongStateError("the safety pilot does not fly: the pilot must take over first")
            fleet.sticks[self._index] = sticks

        self._backend.pilot(move)

    @override
    def pilot_give_back(self) -> None:
        """The safety pilot releases the sticks and switches the autopilot back to the daemon's setpoints."""
        self._backend.pilot_switch(FlightMode.GUIDED)

    @override
    def begin_fault(self, fault: Fault, duration_s: float = 0.0) -> str:
        """Begins a fault, for a simulated duration or (0) until `end_fault`. Returns the fault's id."""
        self._backend.snapshot()  # while the link is lost, this remains the newest data
        fault_id = self._faults.begin(fault, duration_s)
        if isinstance(fault, FailsafeTriggered):
            self._backend.trigger_failsafe(Cause(fault.cause))
        return fault_id

    @override
    def end_fault(self, fault_id: str = "") -> None:
        """Ends a fault, or (empty) all faults."""
        self._faults.end(fault_id)

    @override
    def faults(self) -> dict[str, Fault]:
        """Returns the active faults by their ids."""
        return self._faults.active()

    @override
    def set_speed_factor(self, speed_factor: float) -> None:
        """Sets how fast simulated time runs: 0 (stands still) to 100, or infinity."""
        self._world.set_speed_factor(speed_factor)

    @override
    def step(self, duration_s: float) -> None:
        """Advances time that stands still."""
        self._world.step(duration_s)

    @override
    def set_noise(self, *, position_m: float, velocity_m_s: float) -> None:
        """Sets the standard deviations of the estimates."""
        self._backend.set_noise(
            validation.not_negative(position_m, "position_m", at_most=_MAX_NOISE_VALUE),
            validation.not_negative(velocity_m_s, "velocity_m_s", at_most=_MAX_NOISE_VALUE),
        )

    @override
    def set_wind(self, velocity_m_s: Vector3) -> None:
        """Sets a steady wind: the velocity of the air, along the axes of `map`."""
        self._world.set_wind(self._index, validation.vector(velocity_m_s, "velocity_m_s", at_most=100.0))

    @override
    def place_on_ground(self, position: Vector3, yaw_rad: float = 0.0) -> None:
        """Puts the vehicle on the ground, which is there at the height of the place."""
        self._backend.place_on_ground(
            validation.position(position, "position"),
            validation.heading(yaw_rad, "yaw_rad"),
        )
