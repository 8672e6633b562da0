"""Between the messages of `GripperService` and the value types."""

from __future__ import annotations

from ual.errors import InvalidArgumentError
from ual.gripper import (
    Equipment,
    GripperInfo,
    GripperState,
    RelayInfo,
    ServoInfo,
    WinchAction,
    WinchInfo,
    WinchStatus,
)
from ual.v1 import gripper_pb2 as pb

_STATES = {each.value: each for each in GripperState}
_ACTIONS = {each.value: each for each in WinchAction}


def equipment_to_proto(found: Equipment) -> pb.GetEquipmentResponse:
    """Makes a message."""
    return pb.GetEquipmentResponse(
        grippers=map(_gripper_to_proto, found.grippers),
        winches=map(_winch_to_proto, found.winches),
        servos=map(_servo_to_proto, found.servos),
        relays=map(_relay_to_proto, found.relays),
    )


def equipment_from_proto(message: pb.GetEquipmentResponse) -> Equipment:
    """Reads a message."""
    return Equipment(
        tuple(map(_gripper_from_proto, message.grippers)),
        tuple(map(_winch_from_proto, message.winches)),
        tuple(map(_servo_from_proto, message.servos)),
        tuple(map(_relay_from_proto, message.relays)),
    )


def action_to_proto(action: WinchAction) -> pb.WinchAction.ValueType:
    """Makes a value of the enum."""
    if not isinstance(action, WinchAction):
        raise InvalidArgumentError(f"action: {action!r:.80} is no WinchAction", {"field": "action"})
    return pb.WinchAction.ValueType(action.value)


def action_from_proto(value: pb.WinchAction.ValueType) -> WinchAction:
    """Reads a value of the enum. Raises `InvalidArgumentError` for one that is not known, or not set."""
    action = _ACTIONS.get(value)
    if action is None:
        known = ", ".join(each.name for each in WinchAction)
        raise InvalidArgumentError(f"action: {value} is none of {known}", {"field": "action"})
    return action


def _gripper_to_proto(found: GripperInfo) -> pb.Gripper:
    state = pb.GripperState.ValueType(found.state.value)
    return pb.Gripper(name=found.name, state=state, ordered=found.ordered, note=found.note)


def _gripper_from_proto(message: pb.Gripper) -> GripperInfo:
    state = _STATES.get(message.state, GripperState.UNKNOWN)
    return GripperInfo(message.name, state, message.ordered, message.note)


def _winch_to_proto(found: WinchInfo) -> pb.Winch:
    status = None if found.status is None else _status_to_proto(found.status)
    return pb.Winch(name=found.name, status=status, ordered=found.ordered, note=found.note)


def _winch_from_proto(message: pb.Winch) -> WinchInfo:
    status = _status_from_proto(message.status) if message.HasField("status") else None
    return WinchInfo(message.name, status, message.ordered, message.note)


def _status_to_proto(status: WinchStatus) -> pb.WinchStatus:
    return pb.WinchStatus(
        length_m=status.length_m,
        speed_m_s=status.speed_m_s,
        tension_n=status.tension_n,
        voltage_v=status.voltage_v,
        current_a=status.current_a,
        temperature_c=status.temperature_c,
        is_healthy=status.is_healthy,
        is_fully_retracted=status.is_fully_retracted,
        is_moving=status.is_moving,
        is_clutch_engaged=status.is_clutch_engaged,
    )


def _status_from_proto(message: pb.WinchStatus) -> WinchStatus:
    has = message.HasField
    return WinchStatus(
        message.length_m if has("length_m") else None,
        message.speed_m_s if has("speed_m_s") else None,
        message.tension_n if has("tension_n") else None,
        message.voltage_v if has("voltage_v") else None,
        message.current_a if has("current_a") else None,
        message.temperature_c if has("temperature_c") else None,
        message.is_healthy,
        message.is_fully_retracted,
        message.is_moving,
        message.is_clutch_engaged,
    )


def _servo_to_proto(found: ServoInfo) -> pb.Servo:
    return pb.Servo(
        name=found.name,
        min_pwm_us=found.min_pwm_us,
        max_pwm_us=found.max_pwm_us,
        positions=[pb.ServoPosition(name=name, pwm_us=pwm_us) for name, pwm_us in found.positions],
        pwm_us=found.pwm_us,
        position=found.position,
        ordered=found.ordered,
        note=found.note,
    )


def _servo_from_proto(message: pb.Servo) -> ServoInfo:
    return ServoInfo(
        message.name,
        message.min_pwm_us,
        message.max_pwm_us,
        tuple((each.name, each.pwm_us) for each in message.positions),
        message.pwm_us if message.HasField("pwm_us") else None,
        message.position,
        message.ordered,
        message.note,
    )


def _relay_to_proto(found: RelayInfo) -> pb.Relay:
    return pb.Relay(
        name=found.name,
        on_name=found.on_name,
        off_name=found.off_name,
        is_on=found.is_on,
        ordered=found.ordered,
        note=found.note,
    )


def _relay_from_proto(message: pb.Relay) -> RelayInfo:
    is_on = message.is_on if message.HasField("is_on") else None
    return RelayInfo(message.name, message.on_name, message.off_name, is_on, message.ordered, message.note)
