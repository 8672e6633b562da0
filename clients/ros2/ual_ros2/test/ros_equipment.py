"""What a UAV carries by the services of the node."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ual_msgs import srv

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
from ual.interface import Gripper

Call = Callable[..., Any]


class RosGripper(Gripper):
    """All of it."""

    def __init__(self, call: Call) -> None:
        self._call = call

    def get_all(self) -> Equipment:
        return equipment_of(self._call(srv.ListEquipment, "list_equipment").devices)

    def grip(self, gripper: str = "") -> None:
        self._call(srv.MoveGripper, "grip", gripper=gripper)

    def release(self, gripper: str = "") -> None:
        self._call(srv.MoveGripper, "release", gripper=gripper)

    def order_winch(
        self,
        action: WinchAction,
        *,
        winch: str = "",
        length_m: float | None = None,
        rate_m_s: float | None = None,
    ) -> None:
        given = {"length": length_m or 0.0, "rate": rate_m_s or 0.0}
        self._call(srv.OrderWinch, "order_winch", winch=winch, action=action.name, **given)

    def set_servo(self, position: str = "", *, servo: str = "", pwm_us: int | None = None) -> None:
        self._call(srv.SetServo, "set_servo", servo=servo, position=position, pwm_us=pwm_us or 0)

    def set_relay(self, state: str, *, relay: str = "") -> None:
        self._call(srv.SetRelay, "set_relay", relay=relay, state=state)


def equipment_of(devices: Any) -> Equipment:
    """What a list of devices tells."""

    def made(kind: str, make: Callable[[Any], Any]) -> tuple[Any, ...]:
        return tuple(make(each) for each in devices if each.kind == kind)

    return Equipment(made("gripper", _gripper), made("winch", _winch), made("servo", _servo), made("relay", _relay))


def _gripper(device: Any) -> GripperInfo:
    state = GripperState[device.state] if device.state else GripperState.UNKNOWN
    return GripperInfo(device.name, state, device.ordered, device.note)


def _winch(device: Any) -> WinchInfo:
    return WinchInfo(device.name, next(map(_winch_status, device.winch), None), device.ordered, device.note)


def _winch_status(told: Any) -> WinchStatus:
    numbers = (told.length, told.speed, told.tension, told.voltage, told.current, told.temperature)
    length_m, speed_m_s, tension_n, voltage_v, current_a, temperature_c = (
        None if math.isnan(each) else each for each in numbers
    )
    return WinchStatus(
        length_m,
        speed_m_s,
        tension_n,
        voltage_v,
        current_a,
        temperature_c,
        told.is_healthy,
        told.is_fully_retracted,
        told.is_moving,
        told.is_clutch_engaged,
    )


def _servo(device: Any) -> ServoInfo:
    return ServoInfo(
        device.name,
        device.min_pulse,
        device.max_pulse,
        tuple(zip(device.positions, map(int, device.pulses), strict=True)),
        None if math.isnan(device.value) else int(device.value),
        device.state,
        device.ordered,
        device.note,
    )


def _relay(device: Any) -> RelayInfo:
    on_name, off_name = device.positions
    is_on = device.state == on_name if device.state else None
    return RelayInfo(device.name, on_name, off_name, is_on, device.ordered, device.note)
