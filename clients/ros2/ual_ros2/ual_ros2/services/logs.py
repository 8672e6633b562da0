"""The autopilot's logs in ROS. It needs no ROS: requests are known by their fields.

A caller in ROS names a log and no file: so only logs can be written, into the one directory that the node was given.
"""

from __future__ import annotations

import asyncio
from pathlib import Path

import ual
from ual.logs import Log, PartialFile, file_name
from ual_ros2.messages import Message
from ual_ros2.services.fields import Fields

_NOWHERE = "this node writes no logs: start it with -p log_directory:=DIRECTORY"


class LogDownloads:
    """Downloads logs into a directory.

    Args:
        directory: Where to; None: each download is refused.

    """

    def __init__(self, directory: Path | None) -> None:
        self._directory = directory
        self._under_way: dict[int, PartialFile] = {}
        self._files: set[Path] = set()
        """Files that are being written: each by one download."""

    async def download(self, uav: ual.aio.Uav, goal: Message) -> Fields:
        """Serves DownloadLog. What was cut off goes on where it ended."""
        if self._directory is None:
            raise ual.PermissionDeniedError(_NOWHERE, {"needed": "log_directory"})
        log = await _found(uav, goal.log_id)
        file = self._directory / file_name(log, uav.ns)
        if file in self._files:
            raise ual.WrongStateError(f"{goal.log_id!r:.80} is being downloaded already: wait for it, or cancel it")
        self._files.add(file)
        try:
            return await self._download_into(file, uav, log, goal)
        finally:
            self._files.discard(file)

    async def _download_into(self, file: Path, uav: ual.aio.Uav, log: Log, goal: Message) -> Fields:
        with await asyncio.to_thread(PartialFile, file, log) as part:
            self._under_way[id(goal)] = part
            try:
                return {"file": str(file), "sha256": await _written(uav, part)}
            finally:
                del self._under_way[id(goal)]

    def progress(self, goal: Message) -> Fields | None:
        """Returns how far a download is; None while it has not begun."""
        part = self._under_way.get(id(goal))
        return None if part is None else {"done": part.size, "size": part.log.size_bytes}


async def _found(uav: ual.aio.Uav, log_id: str) -> Log:
    for each in await uav.logs.get_all():
        if each.id == log_id:
            return each
    raise ual.InvalidArgumentError(f"log_id: there is no log {log_id!r:.80}: list_logs has all", {"field": "log_id"})


async def _written(uav: ual.aio.Uav, part: PartialFile) -> str:
    """Writes on a thread of its own: a slow disk delays no setpoint."""
    chunks = uav.logs.download(part.log.id, part.offset)
    async for chunk in chunks:
        await asyncio.to_thread(part.add, chunk)
    return await asyncio.to_thread(part.finish)
