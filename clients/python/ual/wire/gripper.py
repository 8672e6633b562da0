"""Between the messages of ``gripper.proto`` and their values. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Mapping

from ual.gripper import Equipment, GripperInfo, GripperState, RelayInfo, ServoInfo, WinchAction, WinchInfo, WinchStatus
from ual.v1 import gripper_pb2 as pb
from ual.wire.enums import member_of, number_of

_GRIPPER_STATE: Mapping[int, GripperState] = {each.value: each for each in GripperState}

_WINCH_ACTION: Mapping[int, WinchAction] = {each.value: each for each in WinchAction}


def winch_action_to_proto(value: WinchAction, field: str) -> pb.WinchAction.ValueType:
    """Makes a number of an enum. Raises `InvalidArgumentError` for what is no member of it."""
    return pb.WinchAction.ValueType(number_of(value, WinchAction, field))


def winch_action_from_proto(number: int, field: str) -> WinchAction:
    """Reads a number of an enum. Raises `InvalidArgumentError` for one that is not known, or not set."""
    return member_of(number, _WINCH_ACTION, field)


def gripper_info_to_proto(value: GripperInfo) -> pb.Gripper:
    """Makes a message."""
    return pb.Gripper(
        name=value.name,
        state=pb.GripperState.ValueType(value.state.value),
        ordered=value.ordered,
        note=value.note,
    )


def gripper_info_from_proto(message: pb.Gripper) -> GripperInfo:
    """Reads a message."""
    return GripperInfo(
        message.name,
        _GRIPPER_STATE.get(message.state, GripperState.UNKNOWN),
        message.ordered,
        message.note,
    )


def winch_status_to_proto(value: WinchStatus) -> pb.WinchStatus:
    """Makes a message."""
    return pb.WinchStatus(
        length_m=value.length_m,
        speed_m_s=value.speed_m_s,
        tension_n=value.tension_n,
        voltage_v=value.voltage_v,
        current_a=value.current_a,
        temperature_c=value.temperature_c,
        is_healthy=value.is_healthy,
        is_fully_retracted=value.is_fully_retracted,
        is_moving=value.is_moving,
        is_clutch_engaged=value.is_clutch_engaged,
    )


def winch_status_from_proto(message: pb.WinchStatus) -> WinchStatus:
    """Reads a message."""
    return WinchStatus(
        message.length_m if message.HasField("length_m") else None,
        message.speed_m_s if message.HasField("speed_m_s") else None,
        message.tension_n if message.HasField("tension_n") else None,
        message.voltage_v if message.HasField("voltage_v") else None,
        message.current_a if message.HasField("current_a") else None,
        message.temperature_c if message.HasField("temperature_c") else None,
        message.is_healthy,
        message.is_fully_retracted,
        message.is_moving,
        message.is_clutch_engaged,
    )


def servo_position_to_proto(value: tuple[str, int]) -> pb.ServoPosition:
    """Makes a message."""
    name, pwm_us = value
    return pb.ServoPosition(
        name=name,
        pwm_us=pwm_us,
    )


def servo_position_from_proto(message: pb.ServoPosition) -> tuple[str, int]:
    """Reads a message."""
    return (
        message.name,
        message.pwm_us,
    )


def servo_info_to_proto(value: ServoInfo) -> pb.Servo:
    """Makes a message."""
    return pb.Servo(
        name=value.name,
        min_pwm_us=value.min_pwm_us,
        max_pwm_us=value.max_pwm_us,
        positions=map(servo_position_to_proto, value.positions),
        pwm_us=value.pwm_us,
        position=value.position,
        ordered=value.ordered,
        note=value.note,
    )


def servo_info_from_proto(message: pb.Servo) -> ServoInfo:
    """Reads a message."""
    return ServoInfo(
        message.name,
        message.min_pwm_us,
        message.max_pwm_us,
        tuple(map(servo_position_from_proto, message.positions)),
        message.pwm_us if message.HasField("pwm_us") else None,
        message.position,
        message.ordered,
        message.note,
    )


def relay_info_to_proto(value: RelayInfo) -> pb.Relay:
    """Makes a message."""
    return pb.Relay(
        name=value.name,
        on_name=value.on_name,
        off_name=value.off_name,
        is_on=value.is_on,
        ordered=value.ordered,
        note=value.note,
    )


def relay_info_from_proto(message: pb.Relay) -> RelayInfo:
    """Reads a message."""
    return RelayInfo(
        message.name,
        message.on_name,
        message.off_name,
        message.is_on if message.HasField("is_on") else None,
        message.ordered,
        message.note,
    )


def winch_info_to_proto(value: WinchInfo) -> pb.Winch:
    """Makes a message."""
    return pb.Winch(
        name=value.name,
        status=None if value.status is None else winch_status_to_proto(value.status),
        ordered=value.ordered,
        note=value.note,
    )


def winch_info_from_proto(message: pb.Winch) -> WinchInfo:
    """Reads a message."""
    return WinchInfo(
        message.name,
        winch_status_from_proto(message.status) if message.HasField("status") else None,
        message.ordered,
        message.note,
    )


def equipment_to_proto(value: Equipment) -> pb.GetEquipmentResponse:
    """Makes a message."""
    return pb.GetEquipmentResponse(
        grippers=map(gripper_info_to_proto, value.grippers),
        winches=map(winch_info_to_proto, value.winches),
        servos=map(servo_info_to_proto, value.servos),
        relays=map(relay_info_to_proto, value.relays),
    )


def equipment_from_proto(message: pb.GetEquipmentResponse) -> Equipment:
    """Reads a message."""
    return Equipment(
        tuple(map(gripper_info_from_proto, message.grippers)),
        tuple(map(winch_info_from_proto, message.winches)),
        tuple(map(servo_info_from_proto, message.servos)),
        tuple(map(relay_info_from_proto, message.relays)),
    )
