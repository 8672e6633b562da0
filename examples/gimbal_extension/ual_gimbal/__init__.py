"""A gimbal below a UAV, simulated or by MAVLink: an extension of UAL."""

from __future__ import annotations

from ual_gimbal.interface import Attitude, Gimbal

__all__ = ["Attitude", "Gimbal"]
