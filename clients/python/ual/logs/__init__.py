"""The autopilot's logs: what `Uav.logs` returns, and how one gets into a file, whole. See docs/how-to/logs.md."""

from __future__ import annotations

from ual.logs.files import PartialFile, fetch, file_name
from ual.logs.values import Log, LogChunk

__all__ = ["Log", "LogChunk", "PartialFile", "fetch", "file_name"]
