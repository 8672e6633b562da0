"""The fence and the rally points that an autopilot keeps: values and files. `ual.Uav.fence` reads and uploads them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ual.fences.values import FencePlan, FenceZone, KeptFence, RallyPoint
from ual.shared.late import late

if TYPE_CHECKING:
    from ual.fences.files import parse, read

__all__ = ["FencePlan", "FenceZone", "KeptFence", "RallyPoint", "parse", "read"]

if not TYPE_CHECKING:  # a type checker would take any name for one of ours
    __getattr__ = late("ual.fences", "files", "parse", "read")
