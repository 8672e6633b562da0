"""The services of a UAV in this process. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from typing_extensions import override

from ual import interface
from ual.gripper import Equipment, WinchAction
from ual_daemon.extensions.shipped.answers import answer
from ual_daemon.extensions.shipped.gripper import EquippedVehicle, VehicleGripper


class Gripper(interface.Gripper):
    """`ual.interface.Gripper`, in this process."""

    def __init__(self, vehicle: EquippedVehicle, lease_id: Callable[[], str]) -> None:
        self._of_vehicle = VehicleGripper(vehicle)
        self._lease_id = lease_id

    @override
    def get_all(self) -> Equipment:
        return answer(self._of_vehicle.get_all(), "GetEquipment")

    @override
    def grip(self, gripper: str = "") -> None:
        answer(self._of_vehicle.grip(gripper=gripper, lease_id=self._lease_id()), "Grip")

    @override
    def release(self, gripper: str = "") -> None:
        answer(self._of_vehicle.release(gripper=gripper, lease_id=self._lease_id()), "Release")

    @override
    def order_winch(
        self, action: WinchAction, *, winch: str = "", length_m: float | None = None, rate_m_s: float | None = None
    ) -> None:
        answer(
            self._of_vehicle.order_winch(
                action=action, winch=winch, length_m=length_m, rate_m_s=rate_m_s, lease_id=self._lease_id()
            ),
            "OrderWinch",
        )

    @override
    def set_servo(self, position: str = "", *, servo: str = "", pwm_us: int | None = None) -> None:
        answer(
            self._of_vehicle.set_servo(position=position, servo=servo, pwm_us=pwm_us, lease_id=self._lease_id()),
            "SetServo",
        )

    @override
    def set_relay(self, state: str, *, relay: str = "") -> None:
        answer(self._of_vehicle.set_relay(state=state, relay=relay, lease_id=self._lease_id()), "SetRelay")
