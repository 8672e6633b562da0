"""The file in which a daemon keeps which mission it flies, so that it finds it again after a restart."""

from __future__ import annotations

import json
import logging
from dataclasses import asdict, dataclass
from pathlib import Path

from ual_daemon import logs
from ual_daemon.frames.kept_file import UNUSABLE, KeptFile

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class RunningMission:
    """A mission that is flown: by which vehicle, which one (`KeptMission.digest`), as which task.

    `paused_at` is the item at which the autopilot holds, counted from 1; 0 while it is not paused.
    """

    vehicle: str
    digest: str
    task_id: str
    paused_at: int = 0


class MissionFile:
    """A small file of JSON. What cannot be read is logged, and ignored. Any thread may call."""

    def __init__(self, path: Path) -> None:
        self.kept = KeptFile(path, "which mission is flown")

    @classmethod
    def next_to(cls, home_file: Path) -> MissionFile:
        """Returns the one that belongs to a file of home."""
        return cls(home_file.with_suffix(".mission"))

    def read(self) -> RunningMission | None:
        """Returns what is flown; None if there is nothing, or nothing that can be used."""
        try:
            values = json.loads(self.kept.read())
            vehicle, digest, task_id = (str(values[name]) for name in ("vehicle", "digest", "task_id"))
            return RunningMission(vehicle, digest, task_id, int(values.get("paused_at", 0)))
        except FileNotFoundError:
            return None
        except UNUSABLE as error:
            logs.event(_log, logging.WARNING, "mission_file_ignored", file=str(self.kept.path), why=repr(error))
            return None

    def write(self, flown: RunningMission) -> None:
        """Keeps what is flown."""
        self.kept.write(json.dumps(asdict(flown)) + "\n")

    def remove(self) -> None:
        """Forgets it."""
        self.kept.remove()
