"""Payload of a UAV, between ROS messages and values of UAL."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

import ual
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
from ual_ros2.services import equipment


@pytest.mark.parametrize(
    ("action", "length", "rate", "meant"),
    [
        ("HOLD", 0.0, 0.0, (WinchAction.HOLD, None, None)),
        ("LENGTH", -2.0, 0.0, (WinchAction.LENGTH, -2.0, None)),
        ("LENGTH", 0.0, 0.5, (WinchAction.LENGTH, 0.0, 0.5)),  # the daemon says what is wrong
        ("RATE", 0.0, 0.0, (WinchAction.RATE, None, 0.0)),
        ("RETRACT", 1.0, 0.5, (WinchAction.RETRACT, 1.0, 0.5)),  # as above
    ],
)
def test_an_order_of_a_winch(action: str, length: float, rate: float, meant: object) -> None:
    assert equipment.winch_order(SimpleNamespace(action=action, length=length, rate=rate)) == meant


def test_an_action_that_is_none() -> None:
    with pytest.raises(ual.InvalidArgumentError, match="'drop' is none of RELAX, LENGTH"):
        equipment.winch_order(SimpleNamespace(action="drop", length=0.0, rate=0.0))


def test_devices_say_what_is_known() -> None:
    found = Equipment(
        (GripperInfo("claw", GripperState.OPEN, "release"), GripperInfo("hand", note="not said")),
        (WinchInfo("hook", WinchStatus(length_m=2.5)), WinchInfo("other")),
        (ServoInfo("door", 1000, 2000, (("open", 1100),), 1100, "open"),),
        (RelayInfo("lamp", "lit", "dark", False), RelayInfo("fan", "on", "off")),
    )
    told = [tuple(each.values()) for each in equipment.devices(found)]
    assert [each[:3] for each in told] == [
        ("gripper", "claw", "OPEN"),
        ("gripper", "hand", ""),
        ("winch", "hook", ""),
        ("winch", "other", ""),
        ("servo", "door", "open"),
        ("relay", "lamp", "dark"),
        ("relay", "fan", ""),
    ]
    assert [each[3] for each in told if not math.isnan(float(str(each[3])))] == [2.5, 1100.0]
    assert (told[0][4], told[1][5]) == ("release", "not said")
