"""The file in which a daemon keeps which mission it flies, so that it finds it again after a restart."""

from __future__ import annotations

import json
import logging
from dataclasses import asdict, dataclass
from pathlib import Path

from ual_daemon import logs
from ual_daemon.frames import small_file

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class FlownMission:
    """A mission that is flown: by which vehicle, which one (`KeptMission.digest`), as which task.

    `paused_at` is the item at which the autopilot holds, counted from 1; 0 while it is not paused.
    """

    vehicle: str
    digest: str
    task_id: str
    paused_at: int = 0


class MissionFile:
    """A small file of JSON. What cannot be read or written is logged, and ignored. Any thread may call."""

    def __init__(self, path: Path) -> None:
        self._path = path

    @classmethod
    def beside(cls, home_file: Path) -> MissionFile:
        """Returns the one that belongs to a file of home."""
        return cls(home_file.with_suffix(".mission"))

    def read(self) -> FlownMission | None:
        """Returns what is flown; None if there is nothing, or nothing that can be used."""
        try:
            values = json.loads(small_file.read_own(self._path))
            vehicle, digest, task_id = (str(values[name]) for name in ("vehicle", "digest", "task_id"))
            return FlownMission(vehicle, digest, task_id, int(values.get("paused_at", 0)))
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
            logs.event(_log, logging.WARNING, "mission_file_ignored", file=str(self._path), why=repr(error))
            return None

    def write(self, flown: FlownMission) -> None:
        """Keeps what is flown."""
        try:
            small_file.replace(self._path, json.dumps(asdict(flown)) + "\n")
        except OSError as error:
            logs.event(_log, logging.WARNING, "mission_not_saved", file=str(self._path), why=repr(error))

    def remove(self) -> None:
        """Forgets it."""
        try:
            self._path.unlink(missing_ok=True)
        except OSError as error:
            logs.event(_log, logging.WARNING, "mission_not_forgotten", file=str(self._path), why=repr(error))
