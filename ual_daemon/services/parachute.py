"""The parachute of a UAV. One order is in progress at a time, and a release replaces another one."""

from __future__ import annotations

from concurrent.futures import Future
from functools import partial

from ual_daemon.backends.offers.parachute import ParachuteAction, ParachuteDriver
from ual_daemon.services.gripper import EquippedVehicle
from ual_daemon.services.vehicle import driver_of, require_change
from ual_daemon.vehicle.equipment import PayloadDevice

_PARACHUTE = PayloadDevice("parachute", "of the UAV")


class VehicleParachute:
    """The parachute of one UAV. From any thread; no method waits."""

    def __init__(self, vehicle: EquippedVehicle) -> None:
        self._vehicle = vehicle

    def ordered(self) -> str:
        """See `ual.interface.Parachute`."""
        return self._vehicle.equipment.ordered(_PARACHUTE)

    def enable(self, lease_id: str) -> Future[None]:
        """See `ual.interface.Parachute`."""
        return self._order(ParachuteAction.ENABLE, lease_id)

    def disable(self, lease_id: str) -> Future[None]:
        """See `ual.interface.Parachute`."""
        return self._order(ParachuteAction.DISABLE, lease_id)

    def release(self, lease_id: str) -> Future[None]:
        """See `ual.interface.Parachute`."""
        return self._order(ParachuteAction.RELEASE, lease_id)

    def _order(self, action: ParachuteAction, lease_id: str) -> Future[None]:
        offer = driver_of(self._vehicle, ParachuteDriver, "parachutes")  # type: ignore[type-abstract]  # only looked for
        text = action.name.lower()
        require = partial(require_change, self._vehicle, f"{text} the parachute", lease_id)
        is_release = action is ParachuteAction.RELEASE
        give = partial(offer.order, action)
        return self._vehicle.equipment.give(_PARACHUTE, text, give, holds=is_release, require=require)
