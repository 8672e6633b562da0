"""The checks of the daemon itself, which its UAVs' health tells: the audit, and threads that ended by a defect."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

from ual.shared import guard
from ual.shared.text import sendable
from ual_daemon.frames.kept_file import KeptFile

BEGIN = "daemon: "
"""Prefix of each of the daemon's own checks in `failing_checks`."""


class Checked(Protocol):
    """Source of the checks: a vehicle."""

    daemon_checks: tuple[str, ...]
    kept_files: tuple[KeptFile, ...]


class DaemonChecks:
    """Says to vehicles which checks of the daemon fail, whenever that has changed.

    `sources` return the checks that fail, human-readable, from any thread.
    """

    def __init__(self, vehicles: Sequence[Checked], sources: Iterable[Callable[[], Sequence[str]]] = ()) -> None:
        self._vehicles = vehicles
        self._sources = (*sources, _ended_threads)

    def refresh(self) -> None:
        """Looks at the checks again. From any thread; to be called when one of them has changed."""
        found = tuple(BEGIN + sendable(each) for source in self._sources for each in source())
        for vehicle in self._vehicles:
            own = tuple(BEGIN + sendable(each) for file in vehicle.kept_files for each in file.checks)
            vehicle.daemon_checks = found + own

    def watch_files(self) -> None:
        """Tells of files for the next start that cannot be written, from now on."""
        for vehicle in self._vehicles:
            for file in vehicle.kept_files:
                file.on_change = self.refresh

    def watch_threads(self) -> None:
        """Tells of threads of this process that end by a defect, from now on."""

        def on_end(args: threading.ExceptHookArgs) -> None:
            guard.on_ended_thread(args)
            self.refresh()

        threading.excepthook = on_end


def _ended_threads() -> list[str]:
    return [f"its thread {name!r} has ended by a defect" for name in guard.ended_threads()]
