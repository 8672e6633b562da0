"""The fence and the rally points that an autopilot keeps: values and files. `ual.Uav.fence` reads and uploads them."""

from __future__ import annotations

from ual.fences.files import parse, read
from ual.fences.values import FencePlan, FenceZone, KeptFence, RallyPoint

__all__ = ["FencePlan", "FenceZone", "KeptFence", "RallyPoint", "parse", "read"]
