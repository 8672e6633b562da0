"""Every call of `GripperService`; see `ual._calls`. ``make clients`` writes `ual.interface.Gripper` from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual._calls import Call, built, of
from ual.gripper import Equipment, WinchAction
from ual.v1 import gripper_pb2 as pb
from ual.wire import gripper as convert


def get_all() -> Call[Equipment]:
    return of("GetEquipment", pb.GetEquipmentRequest(), convert.equipment_from_proto)


def grip(gripper: str) -> Call[None]:
    return _order("Grip", built(lambda: pb.GripRequest(gripper=gripper), "gripper", gripper))


def release(gripper: str) -> Call[None]:
    return _order("Release", built(lambda: pb.ReleaseRequest(gripper=gripper), "gripper", gripper))


def order_winch(action: WinchAction, winch: str, length_m: float | None, rate_m_s: float | None) -> Call[None]:
    number = convert.action_to_proto(action)
    request = built(
        lambda: pb.OrderWinchRequest(winch=winch, action=number, length_m=length_m, rate_m_s=rate_m_s),
        "winch",
        (winch, length_m, rate_m_s),
    )
    return _order("OrderWinch", request)


def set_servo(position: str, servo: str, pwm_us: int | None) -> Call[None]:
    request = built(
        lambda: pb.SetServoRequest(servo=servo, position=position, pwm_us=pwm_us), "servo", (servo, position, pwm_us)
    )
    return _order("SetServo", request)


def set_relay(state: str, relay: str) -> Call[None]:
    return _order("SetRelay", built(lambda: pb.SetRelayRequest(relay=relay, state=state), "relay", (relay, state)))


def _order(method: str, request: Any) -> Call[None]:  # noqa: ANN401 (the request of a method)
    return of(method, request, lambda _: None)


MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {
    "get_all": get_all,
    "grip": grip,
    "release": release,
    "order_winch": order_winch,
    "set_servo": set_servo,
    "set_relay": set_relay,
}
"""The members of `ual.interface.Gripper`, each with its call."""
