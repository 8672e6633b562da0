"""The calls of `ual.interface.Gripper`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual._calls import Call, nothing, of, request
from ual._wrong_type import require
from ual.gripper import Equipment, WinchAction
from ual.v1 import gripper_pb2 as pb
from ual.wire import gripper as wire


def get_all() -> Call[Equipment]:
    return of("GetEquipment", pb.GetEquipmentRequest(), wire.equipment_from_proto)


def grip(gripper: str) -> Call[None]:
    require(gripper, str, "gripper")
    return of("Grip", request(pb.GripRequest, gripper=gripper), nothing)


def release(gripper: str) -> Call[None]:
    require(gripper, str, "gripper")
    return of("Release", request(pb.ReleaseRequest, gripper=gripper), nothing)


def order_winch(action: WinchAction, winch: str, length_m: float | None, rate_m_s: float | None) -> Call[None]:
    require(winch, str, "winch")
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
    require(position, str, "position")
    require(servo, str, "servo")
    return of("SetServo", request(pb.SetServoRequest, servo=servo, position=position, pwm_us=pwm_us), nothing)


def set_relay(state: str, relay: str) -> Call[None]:
    require(state, str, "state")
    require(relay, str, "relay")
    return of("SetRelay", request(pb.SetRelayRequest, relay=relay, state=state), nothing)
