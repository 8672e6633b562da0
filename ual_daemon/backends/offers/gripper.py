"""Interface of a backend's grippers, winches, servos and relays; see `ual_daemon.services.gripper`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from concurrent.futures import Future
from typing import NamedTuple

from ual.gripper import GripperState, WinchAction, WinchStatus


class WinchOrder(NamedTuple):
    """Order to a winch; see `ual.interface.Gripper.order_winch`."""

    action: WinchAction
    length_m: float | None = None
    rate_m_s: float | None = None

    @property
    def holds(self) -> bool:
        """Whether it stops, holds or takes in the load, and so can be repeated. What is not sure may let it go."""
        stops = self.action is WinchAction.RATE and not self.rate_m_s
        return stops or self.action in (WinchAction.HOLD, WinchAction.LOCK, WinchAction.RETRACT)


class ServoOrder(NamedTuple):
    """A pulse width for the servo of a channel, and the bounds of its pulse."""

    channel: int
    pwm_us: int
    min_pwm_us: int
    max_pwm_us: int


class GripperDriver(ABC):
    """Payload devices of one autopilot. From any thread; no method waits.

    Each future ends by itself, also where nothing answers. An order ends with its acknowledgement, or with a
    `RejectedByAutopilotError`, a `LinkLostError`, or a `NotSupportedError`. A `UalTimeoutError` says that it is not
    known whether it was obeyed. Cancelling its future withdraws it, if it was not sent yet.

    An order that holds a load is repeated until it is acknowledged: a grip, and a `WinchOrder` that `holds`. All others
    may let one go: they are sent once, and never more than 1 s after they were requested. A newer order of the same
    device replaces the one before; the caller cancels that.

    A question that the autopilot does not answer ends with a `UalError`, which says why.
    """

    @abstractmethod
    def grip(self, instance: int) -> Future[None]:
        """Closes a gripper, counted from 1."""

    @abstractmethod
    def release(self, instance: int) -> Future[None]:
        """Opens a gripper."""

    @abstractmethod
    def gripper_state(self, instance: int) -> Future[GripperState]:
        """Returns the reports of a gripper."""

    @abstractmethod
    def order_winch(self, instance: int, order: WinchOrder) -> Future[None]:
        """Has a winch do something; counted from 1."""

    @abstractmethod
    def winch_status(self, instance: int) -> Future[WinchStatus]:
        """Returns what a winch says now."""

    @abstractmethod
    def set_servo(self, order: ServoOrder) -> Future[None]:
        """Moves a servo."""

    @abstractmethod
    def servo_pwm_us(self, channel: int) -> Future[int]:
        """Returns the pulse width that is put out at a channel now."""

    @abstractmethod
    def set_relay(self, number: int, *, is_on: bool) -> Future[None]:
        """Switches a relay, counted from 1."""

    @abstractmethod
    def relay_is_on(self, number: int) -> Future[bool]:
        """Returns whether a relay is on now."""
