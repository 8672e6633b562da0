"""The parachute of a MAVLink vehicle: a component of its own, or a part of an ArduPilot."""

from __future__ import annotations

from concurrent.futures import Future
from functools import partial

from typing_extensions import override

from ual.errors import LinkLostError, NotSupportedError, RejectedByAutopilotError
from ual_daemon.backends import futures
from ual_daemon.backends.chain import caught, then_wait
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.command_long import CommandLong, command_of
from ual_daemon.backends.mavlink.offers.protocol_access import Orders
from ual_daemon.backends.mavlink.wire.messages import mavlink
from ual_daemon.backends.offers.parachute import ParachuteAction, ParachuteDriver

_COMPONENT: int = mavlink.MAV_COMP_ID_PARACHUTE
_COMMAND: int = mavlink.MAV_CMD_DO_PARACHUTE


class MavlinkParachute(ParachuteDriver):
    """The parachute of one backend's vehicle. It takes orders while its messages arrive, at any autopilot."""

    def __init__(self, orders: Orders) -> None:
        self._orders = orders

    @override
    def order(self, action: ParachuteAction) -> Future[None]:
        what = f"{action.name.lower()} its parachute"
        give = self._orders.reach.run_on_loop
        is_there: Future[bool] = give(what, lambda protocols, future: protocols.components.ask(_COMPONENT, future))

        def begin(is_component: bool) -> Future[None]:
            if not is_component:
                return self._order_autopilot(action, what)
            command = CommandLong(_COMMAND, (float(action),))
            return give(what, lambda protocols, future: protocols.components.order(_COMPONENT, command, what, future))

        return then_wait(is_there, begin)

    def _order_autopilot(self, action: ParachuteAction, what: str) -> Future[None]:
        session = self._orders.reach.session()
        if session is None:
            return futures.failed(LinkLostError(f"cannot {what}: no autopilot is heard"))
        if not isinstance(session.dialect, ArduCopter):
            missing = f"{session.dialect.name} has no parachute, and no component {_COMPONENT} is heard"
            return futures.failed(NotSupportedError(f"cannot {what}: {missing}"))
        command = command_of(_COMMAND, (float(action),), what, group="parachute")
        give = partial(self._orders.give, what, command)
        if action is not ParachuteAction.RELEASE:
            return caught(give(), _refused)
        reach = self._orders.reach
        return caught(
            reach.run_on_loop(what, lambda protocols, future: protocols.parachute.begin(give, future)), _refused
        )


def _refused(error: BaseException) -> Future[None]:
    """Returns an error, as that of a vehicle without a parachute where the autopilot was built without one."""
    if isinstance(error, RejectedByAutopilotError) and error.metadata.get("result") == "UNSUPPORTED":
        return futures.failed(NotSupportedError(error.message))
    return futures.failed(error)


def make_driver(orders: Orders) -> MavlinkParachute:
    """Makes that of one backend."""
    return MavlinkParachute(orders)
