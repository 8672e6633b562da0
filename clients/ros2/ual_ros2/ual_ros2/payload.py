"""What a UAV carries, between ROS messages and values of UAL. It needs no ROS: messages are known by their fields."""

from __future__ import annotations

from collections.abc import Iterator

import ual
from ual.gripper import Equipment, GripperState, RelayInfo, ServoInfo, WinchAction, WinchInfo
from ual_ros2 import values
from ual_ros2.messages import Message


def winch_order(request: Message) -> tuple[WinchAction, float | None, float | None]:
    """Reads an OrderWinch: the action, the length and the rate. A 0 is none, but for a rate of RATE, which stops."""
    try:
        action = WinchAction[request.action]
    except KeyError:
        known = ", ".join(each.name for each in WinchAction)
        text = f"action: {request.action!r:.80} is none of {known}"
        raise ual.InvalidArgumentError(text, {"field": "action"}) from None
    has_length = action is WinchAction.LENGTH or bool(request.length)
    has_rate = action is WinchAction.RATE or bool(request.rate)
    return action, request.length if has_length else None, request.rate if has_rate else None


def devices(found: Equipment) -> Iterator[dict[str, object]]:
    """Yields the fields of a Device for each."""
    for gripper in found.grippers:
        state = "" if gripper.state is GripperState.UNKNOWN else gripper.state.name
        yield _device("gripper", gripper.name, state, None, gripper.ordered, gripper.note)
    for winch in found.winches:
        yield _device("winch", winch.name, "", _line(winch), winch.ordered, winch.note)
    for servo in found.servos:
        yield _device("servo", servo.name, servo.position, _pulse(servo), servo.ordered, servo.note)
    for relay in found.relays:
        yield _device("relay", relay.name, _switched(relay), None, relay.ordered, relay.note)


def _device(kind: str, name: str, state: str, value: float | None, ordered: str, note: str) -> dict[str, object]:
    return {
        "kind": kind,
        "name": name,
        "state": state,
        "value": values.known(value),
        "ordered": ordered,
        "note": note,
    }


def _line(winch: WinchInfo) -> float | None:
    return None if winch.status is None else winch.status.length_m


def _pulse(servo: ServoInfo) -> float | None:
    return None if servo.pwm_us is None else float(servo.pwm_us)


def _switched(relay: RelayInfo) -> str:
    if relay.is_on is None:
        return ""
    return relay.on_name if relay.is_on else relay.off_name
