"""Orders to what an autopilot carries, whatever protocol passes them on."""

from __future__ import annotations

from abc import abstractmethod
from concurrent.futures import Future

from typing_extensions import override

from ual_daemon.backends.firmwares.gripper_codec import GripperCodec, PayloadOrder
from ual_daemon.backends.offers.gripper import GripperDriver, ServoOrder, WinchOrder


class OrderedGripper(GripperDriver):
    """Encodes each order as its autopilot takes it. A backend passes it on."""

    @abstractmethod
    def _codec(self) -> GripperCodec:
        """Returns how the autopilot takes orders. Raises `LinkLostError` or `NotSupportedError`."""

    @abstractmethod
    def _order(self, order: PayloadOrder) -> Future[None]:
        """Passes an order on."""

    @override
    def grip(self, instance: int) -> Future[None]:
        return self._order(self._codec().grip(instance, is_closing=True))

    @override
    def release(self, instance: int) -> Future[None]:
        return self._order(self._codec().grip(instance, is_closing=False))

    @override
    def order_winch(self, instance: int, order: WinchOrder) -> Future[None]:
        return self._order(self._codec().winch(instance, order))

    @override
    def set_servo(self, order: ServoOrder) -> Future[None]:
        return self._order(self._codec().servo(order))

    @override
    def set_relay(self, number: int, *, is_on: bool) -> Future[None]:
        return self._order(self._codec().relay(number, is_on=is_on))
