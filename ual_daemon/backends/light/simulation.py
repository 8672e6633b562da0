"""The world around one light vehicle, as `ual.interface.Simulation`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ual.errors import WrongStateError
from ual.geometry import Vector3
from ual.simulation import Fault
from ual_daemon import validation
from ual_daemon.backends.light.faults import Faults
from ual_daemon.backends.light.physics import FlightMode
from ual_daemon.backends.light.world import Vehicles, World

if TYPE_CHECKING:
    from ual_daemon.backends.light.backend import LightBackend

_MAX_SIGMA = 1000.0


class LightSimulation:
    """The safety pilot, faults, time, noise and wind of one vehicle."""

    def __init__(self, backend: LightBackend, world: World, index: int, faults: Faults) -> None:
        self._backend = backend
        self._world = world
        self._index = index
        self._faults = faults

    def pilot_arm(self) -> None:
        """The safety pilot arms."""
        self._backend.pilot_arm()

    def pilot_disarm(self) -> None:
        """The safety pilot disarms."""
        self._backend.pilot_disarm()

    def pilot_take_over(self) -> None:
        """The safety pilot flies; the UAV hovers until he moves the sticks."""
        self._backend.pilot_switch(FlightMode.MANUAL)

    def pilot_move_sticks(self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0) -> None:
        """The safety pilot moves the sticks, each -1 to 1."""
        sticks = (
            validation.number(forward, "forward", at_most=1.0),
            validation.number(left, "left", at_most=1.0),
            validation.number(up, "up", at_most=1.0),
            validation.number(turn, "turn", at_most=1.0),
        )

        def move(fleet: Vehicles) -> None:
            if fleet.mode[self._index] != FlightMode.MANUAL:
                raise WrongStateError("the safety pilot does not fly; let him take over first")
            fleet.sticks[self._index] = sticks

        self._backend.pilot(move)

    def pilot_give_back(self) -> None:
        """The safety pilot lets go, and switches back to following the daemon's references."""
        self._backend.pilot_switch(FlightMode.GUIDED)

    def begin_fault(self, fault: Fault, duration_s: float = 0.0) -> str:
        """A fault begins, for a simulated duration or (0) until `end_fault`. Its id."""
        self._backend.snapshot()  # a link that is lost leaves what was said last
        return self._faults.begin(fault, duration_s)

    def end_fault(self, fault_id: str = "") -> None:
        """A fault ends, or (empty) all of them."""
        self._faults.end(fault_id)

    def faults(self) -> dict[str, Fault]:
        """The faults under way by their ids."""
        return self._faults.active()

    def set_speed_factor(self, speed_factor: float) -> None:
        """How fast simulated time runs: 0 (stands still) to 100, or infinity."""
        self._world.set_speed_factor(speed_factor)

    def step(self, duration_s: float) -> None:
        """Runs standing time on."""
        self._world.step(duration_s)

    def set_noise(self, *, position_m: float, velocity_m_s: float) -> None:
        """Standard deviations of the estimates."""
        self._backend.set_noise(
            validation.not_negative(position_m, "position_m", at_most=_MAX_SIGMA),
            validation.not_negative(velocity_m_s, "velocity_m_s", at_most=_MAX_SIGMA),
        )

    def set_wind(self, velocity_m_s: Vector3) -> None:
        """Steady wind: where it blows to, along `map` axes."""
        self._world.wind_to(self._index, validation.vector(velocity_m_s, "velocity_m_s", at_most=100.0))
