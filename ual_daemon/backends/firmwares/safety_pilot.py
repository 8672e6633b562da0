"""A simulated safety pilot for a simulated PX4 or ArduCopter. It never arms anything with a flight controller."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Protocol

from typing_extensions import override

from ual.errors import PermissionDeniedError
from ual_daemon.backends import futures
from ual_daemon.backends.base import SafetyPilot
from ual_daemon.backends.firmwares.autopilot import SimulationVerdict

ARMING_LIMIT_S = 5.0


class PilotedVehicle(Protocol):
    """The vehicle, which may be simulated."""

    @property
    def label(self) -> str:
        """Human-readable name of the vehicle."""
        ...

    def judge_simulation(self) -> SimulationVerdict:
        """Judges whether it is a simulator, and surely not a flight controller. From any thread."""
        ...

    def is_ready_to_arm(self) -> bool:
        """Returns whether its data say that arming would succeed. From any thread."""
        ...


class LinkPilot(SafetyPilot):
    """Arms through our own link. From any thread.

    `vehicle` returns the autopilot while its link is up, `arm` is the backend's command.
    """

    def __init__(self, vehicle: Callable[[], PilotedVehicle | None], arm: Callable[[], Future[None]]) -> None:
        self._vehicle = vehicle
        self._arm = arm

    @override
    def may_arm(self) -> bool:
        vehicle = self._vehicle()
        if vehicle is None:
            return False
        verdict = vehicle.judge_simulation()
        if verdict.is_simulated is False:
            raise PermissionDeniedError(
                f"this {vehicle.label} is no simulator: {verdict.why}; its safety pilot arms it"
            )
        return bool(verdict.is_simulated) and vehicle.is_ready_to_arm()

    @override
    def arm(self) -> None:
        if not self.may_arm():  # it may be another vehicle by now
            return
        late = f"the autopilot has not answered the arming for {ARMING_LIMIT_S:g} s"
        futures.wait(self._arm(), ARMING_LIMIT_S, late)
