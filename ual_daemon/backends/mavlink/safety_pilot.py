"""A simulated safety pilot for a simulated PX4 or ArduCopter: arms it, and never anything with a flight controller."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError

from ual.errors import PermissionDeniedError, UalTimeoutError
from ual_daemon.backends.mavlink.session.vehicle import MavlinkVehicle

ARMING_LIMIT_S = 5.0


class SimulatedPilot:
    """Arms by our own link; see `ual_daemon.backends.base.SafetyPilot`. From any thread.

    `vehicle` is the autopilot in reach, `arm` the backend's command.
    """

    def __init__(self, vehicle: Callable[[], MavlinkVehicle | None], arm: Callable[[], Future[None]]) -> None:
        self._vehicle = vehicle
        self._arm = arm

    def may_arm(self) -> bool:
        vehicle = self._vehicle()
        if vehicle is None:
            return False
        reality = vehicle.reality()
        if reality.is_simulated is False:
            raise PermissionDeniedError(
                f"this {vehicle.dialect.name} (system {vehicle.system_id}) is no simulator: {reality.why}; "
                "its safety pilot arms it"
            )
        return bool(reality.is_simulated) and vehicle.is_ready_to_arm()

    def arm(self) -> None:
        if not self.may_arm():  # it may be another vehicle by now
            return
        future = self._arm()
        try:
            future.result(ARMING_LIMIT_S)
        except FutureTimeoutError:
            future.cancel()
            raise UalTimeoutError(f"the autopilot has not answered the arming for {ARMING_LIMIT_S:g} s") from None
