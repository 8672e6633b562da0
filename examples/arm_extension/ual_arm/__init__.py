"""A simulated two-joint arm below a UAV: an extension of UAL."""

from __future__ import annotations

from ual_arm.interface import Arm
from ual_arm.values import Joints

__all__ = ["Arm", "Joints"]
