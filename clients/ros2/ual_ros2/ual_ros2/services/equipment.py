"""Equipment of a UAV in ROS, with its bounds and positions. It needs no ROS: requests are known by their fields."""

from __future__ import annotations

from collections.abc import Iterator

import ual
from ual.gripper import Equipment, GripperState, RelayInfo, ServoInfo, WinchAction, WinchInfo, WinchStatus
from ual_ros2 import values
from ual_ros2.derived.values import winch_status_fields
from ual_ros2.messages import Message
from ual_ros2.services.fields import Fields, named


async def list_all(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListEquipment."""
    return {"devices": list(devices(await uav.gripper.get_all()))}


async def order_winch(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves OrderWinch."""
    action, length_m, rate_m_s = winch_order(request)
    await uav.gripper.order_winch(action, winch=request.winch, length_m=length_m, rate_m_s=rate_m_s)
    return {}


def winch_order(request: Message) -> tuple[WinchAction, float | None, float | None]:
    """Reads an OrderWinch: the action, the length and the rate. A 0 is none, but for a rate of RATE, which stops.

    Raises:
        InvalidArgumentError: There is no such action; the message lists all.

    """
    action = named(WinchAction, request.action, "action")
    has_length = action is WinchAction.LENGTH or bool(request.length)
    has_rate = action is WinchAction.RATE or bool(request.rate)
    return action, request.length if has_length else None, request.rate if has_rate else None


def devices(found: Equipment) -> Iterator[Fields]:
    """Yields a Device for each."""
    for gripper in found.grippers:
        state = "" if gripper.state is GripperState.UNKNOWN else gripper.state.name
        yield _device("gripper", gripper.name, state, None, gripper.ordered, gripper.note)
    for winch in found.winches:
        yield {**_device("winch", winch.name, "", _rope(winch), winch.ordered, winch.note), **_of_winch(winch.status)}
    for servo in found.servos:
        device = _device("servo", servo.name, servo.position, _pulse(servo), servo.ordered, servo.note)
        yield {**device, **_of_servo(servo)}
    for relay in found.relays:
        device = _device("relay", relay.name, _switched(relay), None, relay.ordered, relay.note)
        yield {**device, "positions": [relay.on_name, relay.off_name]}


def _device(kind: str, name: str, state: str, value: float | None, ordered: str, note: str) -> Fields:
    return {
        "kind": kind,
        "name": name,
        "state": state,
        "value": values.known(value),
        "ordered": ordered,
        "note": note,
    }


def _rope(winch: WinchInfo) -> float | None:
    return None if winch.status is None else winch.status.length_m


def _pulse(servo: ServoInfo) -> float | None:
    return None if servo.pwm_us is None else float(servo.pwm_us)


def _switched(relay: RelayInfo) -> str:
    if relay.is_on is None:
        return ""
    return relay.on_name if relay.is_on else relay.off_name


def _of_servo(servo: ServoInfo) -> Fields:
    return {
        "positions": [name for name, _ in servo.positions],
        "pulses": [pwm_us for _, pwm_us in servo.positions],
        "min_pulse": servo.min_pwm_us,
        "max_pulse": servo.max_pwm_us,
    }


def _of_winch(status: WinchStatus | None) -> Fields:
    return {} if status is None else {"winch": [winch_status_fields(status)]}
