"""Payload of the autopilot, through MAVROS' service cmd/command: orders, and texts about the gripper."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import LinkLostError, NotSupportedError, UalError
from ual.gripper import GripperState, WinchStatus
from ual_daemon.backends.engine.command import Command
from ual_daemon.backends.engine.loop import Posted
from ual_daemon.backends.firmwares.gripper_codec import GRIPPER, SET_ACTUATOR, GripperCodec, PayloadOrder
from ual_daemon.backends.firmwares.gripper_orders import OrderedGripper
from ual_daemon.backends.mavros import commands
from ual_daemon.backends.mavros.commands import MavrosCall
from ual_daemon.backends.mavros.session import MavrosSession

_SAYS_NOTHING = "MAVROS does not pass on what the autopilot says of its {}"


class MavrosGripper(OrderedGripper):
    """Payload devices of one backend's autopilot.

    MAVROS waits for an acknowledgement for 5 s, and takes no second order of the same kind meanwhile. So each order is
    sent once, also one that holds.

    Args:
        session: Returns the session, in reach or not; None before there was one.
        command: Passes a command to the autopilot, with a human-readable name.
        post: Has something done on the link's thread.
    """

    def __init__(
        self,
        session: Callable[[], MavrosSession | None],
        command: Callable[[str, Command[MavrosCall]], Future[None]],
        post: Callable[[Posted], None],
    ) -> None:
        self._session = session
        self._command = command
        self._post = post

    @override
    def gripper_state(self, instance: int) -> Future[GripperState]:
        session, future = self._known(), Future[GripperState]()
        if session.gripper_state is GripperState.UNKNOWN:
            raise UalError(f"{session.autopilot.name} has not said it since the last order or boot")
        future.set_result(session.gripper_state)
        return future

    @override
    def winch_status(self, instance: int) -> Future[WinchStatus]:
        raise NotSupportedError(_SAYS_NOTHING.format("winch"))

    @override
    def servo_pwm_us(self, channel: int) -> Future[int]:
        raise NotSupportedError(_SAYS_NOTHING.format("servos"))

    @override
    def relay_is_on(self, number: int) -> Future[bool]:
        raise NotSupportedError(_SAYS_NOTHING.format("relays"))

    @override
    def _order(self, order: PayloadOrder) -> Future[None]:
        if order.id == SET_ACTUATOR:
            raise NotSupportedError("through MAVROS no actuator of PX4 is moved: the bridge has no NaN for the others")
        if order.id == GRIPPER:
            session = self._known()
            self._post(lambda _: session.forget_gripper())
        return self._command(order.what, commands.move(order))

    @override
    def _codec(self) -> GripperCodec:
        autopilot = self._known().autopilot
        if autopilot.gripper is None:
            raise NotSupportedError(f"UAL moves nothing that {autopilot.name} carries")
        return autopilot.gripper

    def _known(self) -> MavrosSession:
        session = self._session()
        if session is None:
            raise LinkLostError("no autopilot is heard through MAVROS")
        return session
