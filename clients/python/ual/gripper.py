"""What a UAV carries to hold, drop and switch, as values. `ual.Uav.gripper` orders it: ``docs/how-to/gripper.md``."""

from __future__ import annotations

from ual.contract.gripper import (
    Equipment,
    GripperInfo,
    GripperState,
    RelayInfo,
    ServoInfo,
    WinchAction,
    WinchInfo,
    WinchStatus,
)

__all__ = [
    "Equipment",
    "GripperInfo",
    "GripperState",
    "RelayInfo",
    "ServoInfo",
    "WinchAction",
    "WinchInfo",
    "WinchStatus",
]
