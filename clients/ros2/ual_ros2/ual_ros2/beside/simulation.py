"""The world around a simulated UAV in ROS. It needs no ROS: requests are known by their fields."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from typing import Any

import ual
from ual.simulation import (
    AckLate,
    AckLost,
    BatteryLow,
    Command,
    CommandRefused,
    EstimatorJumps,
    FailsafeTriggered,
    Fault,
    LinkLost,
    MotorsWeak,
    PositionLost,
)
from ual_ros2 import values
from ual_ros2.beside.fields import Fields, named, names_of, vector
from ual_ros2.messages import Message


async def is_offered(uav: ual.aio.Uav, info: ual.Info) -> bool:
    """Returns whether the daemon offers its simulation. That of a real UAV is not asked, as its info says so.

    A simulated UAV need not have one to offer: that of an autopilot's own simulator does not.
    """
    if not info.is_simulation:
        return False
    try:
        await uav.simulation.parts()
    except ual.UalError:  # a daemon that has ended meanwhile is asked again by the next connection
        return False
    return True


async def list_parts(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListSimulationParts."""
    return {"parts": names_of(await uav.simulation.parts())}


def move_sticks(uav: ual.aio.Uav, request: Message) -> Awaitable[None]:
    """Serves MoveSticks."""
    return uav.simulation.pilot_move_sticks(
        forward=request.forward, left=request.left, up=request.up, turn=request.turn
    )


async def begin_fault(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves BeginFault."""
    return {"fault_id": await uav.simulation.begin_fault(fault(request.fault), request.duration)}


async def list_faults(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListFaults."""
    found = await uav.simulation.faults()
    return {"faults": [{"fault_id": fault_id, **fault_fields(each)} for fault_id, each in found.items()]}


def set_noise(uav: ual.aio.Uav, request: Message) -> Awaitable[None]:
    """Serves SetNoise."""
    return uav.simulation.set_noise(position_m=request.position, velocity_m_s=request.velocity)


def set_wind(uav: ual.aio.Uav, request: Message) -> Awaitable[None]:
    """Serves SetWind."""
    return uav.simulation.set_wind(values.vector(request.velocity))


def place(uav: ual.aio.Uav, request: Message) -> Awaitable[None]:
    """Serves PlaceOnGround."""
    return uav.simulation.place_on_ground(values.vector(request.position), request.yaw)


def fault(message: Message) -> Fault:
    """Reads a Fault.

    Raises:
        InvalidArgumentError: Its kind, or its command, is none.

    """
    read = _READ.get(message.kind)
    if read is None:
        text = f"kind: {message.kind!r:.80} is none of {', '.join(_READ)}"
        raise ual.InvalidArgumentError(text, {"field": "kind"})
    return read(message)


def fault_fields(found: Fault) -> Fields:
    """Returns a Fault, but for its identifier."""
    kind, told = _TOLD[type(found)]
    return {"kind": kind, **told(found)}


def _command(message: Message) -> Command:
    return named(Command, message.command, "command", Command.ANY)


def _command_name(command: Command) -> str:
    return "" if command is Command.ANY else command.name


_READ: Mapping[str, Callable[[Message], Fault]] = {
    "LINK_LOST": lambda _: LinkLost(),
    "POSITION_LOST": lambda _: PositionLost(),
    "ESTIMATOR_JUMPS": lambda message: EstimatorJumps(values.vector(message.offset), message.period),
    "MOTORS_WEAK": lambda message: MotorsWeak(message.power),
    "BATTERY_LOW": lambda message: BatteryLow(100.0 * message.remaining),
    "COMMAND_REFUSED": lambda message: CommandRefused(_command(message), message.text),
    "ACK_LOST": lambda message: AckLost(_command(message)),
    "ACK_LATE": lambda message: AckLate(_command(message), message.delay),
    "FAILSAFE_TRIGGERED": lambda message: FailsafeTriggered(message.cause),
}
_TOLD: Mapping[type[Any], tuple[str, Callable[[Any], Fields]]] = {
    LinkLost: ("LINK_LOST", lambda _: {}),
    PositionLost: ("POSITION_LOST", lambda _: {}),
    EstimatorJumps: ("ESTIMATOR_JUMPS", lambda it: {"offset": vector(it.offset), "period": it.period_s}),
    MotorsWeak: ("MOTORS_WEAK", lambda it: {"power": it.power_ratio}),
    BatteryLow: ("BATTERY_LOW", lambda it: {"remaining": it.remaining_percent / 100.0}),
    CommandRefused: ("COMMAND_REFUSED", lambda it: {"command": _command_name(it.command), "text": it.text}),
    AckLost: ("ACK_LOST", lambda it: {"command": _command_name(it.command)}),
    AckLate: ("ACK_LATE", lambda it: {"command": _command_name(it.command), "delay": it.delay_s}),
    FailsafeTriggered: ("FAILSAFE_TRIGGERED", lambda it: {"cause": it.cause}),
}
