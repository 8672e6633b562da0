"""The autopilot's logs: what `Uav.logs` returns, and how one gets into a file, whole. See docs/how-to/logs.md."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ual.logs.values import Log, LogChunk
from ual.shared.late import late

if TYPE_CHECKING:
    from ual.logs.files import PartialFile, fetch, file_name

__all__ = ["Log", "LogChunk", "PartialFile", "fetch", "file_name"]

if not TYPE_CHECKING:  # a type checker would take any name for one of ours
    __getattr__ = late("ual.logs", "files", "PartialFile", "fetch", "file_name")
