"""The calls of `ual.interface.Gripper`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual._calls import Call, nothing, of, request
from ual.gripper import Equipment, WinchAction
from ual.v1 import gripper_pb2 as pb
from ual.wire import gripper as wire


def get_all() -> Call[Equipment]:
    return of("GetEquipment", pb.GetEquipmentRequest(), wire.equipment_from_proto)


def grip(gripper: str) -> Call[None]:
    return of("Grip", request(pb.GripRequest, gripper=gripper), nothing)


def release(gripper: str) -> Call[None]:
    return of("Release", request(pb.ReleaseRequest, gripper=gripper), nothing)


def order_winch(action: WinchAction, winch: str, length_m: float | None, rate_m_s: float | None) -> Call[None]:
    return of(
        "OrderWinch",
        request(
            pb.OrderWinchRequest,
            winch=winch,
            action=wire.winch_action_to_proto(action, "action"),
            length_m=length_m,
            rate_m_s=rate_m_s,
        ),
        nothing,
    )


def set_servo(position: str, servo: str, pwm_us: int | None) -> Call[None]:
    return of("SetServo", request(pb.SetServoRequest, servo=servo, position=position, pwm_us=pwm_us), nothing)


def set_relay(state: str, relay: str) -> Call[None]:
    return of("SetRelay", request(pb.SetRelayRequest, relay=relay, state=state), nothing)


MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {
    "get_all": get_all,
    "grip": grip,
    "release": release,
    "order_winch": order_winch,
    "set_servo": set_servo,
    "set_relay": set_relay,
}
