"""A log of the autopilot, and a piece of one."""

from __future__ import annotations

from ual.contract.logs import Log, LogChunk

__all__ = ["Log", "LogChunk"]
