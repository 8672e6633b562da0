"""A small file that a daemon keeps for its next start, whatever happens to the disk meanwhile."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from pathlib import Path

from ual.shared import output_file, whole_file
from ual.shared.pauses import GrowingPauses
from ual_daemon import logs
from ual_daemon.frames import small_file

UNUSABLE = (OSError, ValueError, KeyError, TypeError, RecursionError, OverflowError)
"""Errors of a kept file that cannot be read or used, whatever is in it: a daemon starts without it."""

_log = logging.getLogger(__name__)


class KeptFile:
    """A file that is replaced as a whole. `keep` writes again what could not be written, or was removed.

    Any thread may call. `what` is the human-readable loss at a restart of the daemon.
    """

    def __init__(self, path: Path, what: str) -> None:
        self.path = path
        self._what = what
        self._lock = threading.Lock()
        self._wanted: str | None = None
        self._is_durable = False
        self._written: tuple[int, int, int] | None = None  # its identity
        self._failure = ""
        self._pauses = GrowingPauses()
        self.on_change: Callable[[], object] = bool
        """Called when `checks` has changed, on the thread that writes; with nothing of this file held but its lock."""

    @property
    def checks(self) -> tuple[str, ...]:
        """Human-readable failing checks of the file: none while it is on the disk."""
        return (f"{self._what} is not saved in {self.path}: {self._failure}",) if self._failure else ()

    @property
    def is_there(self) -> bool:
        """Whether what was written last is on the disk now."""
        is_written = self._written is not None and not self._failure
        return is_written and output_file.identity_of(self.path) == self._written

    def read(self) -> bytes:
        """Returns what the daemon before has kept.

        Raises:
            OSError: There is nothing, or it cannot be read.
            ValueError: It is not this user's, or too long.

        """
        return small_file.read_own(self.path)

    def write(self, text: str, *, is_durable: bool = False) -> None:
        """Keeps a text in place of the one before. What cannot be written now is logged, and written by `keep`."""
        with self._lock:
            self._wanted, self._is_durable = text, is_durable
            self._write()

    def remove(self) -> None:
        """Removes it, if it is there."""
        with self._lock:
            self._wanted, self._written, self._failure = None, None, ""
            try:
                self.path.unlink(missing_ok=True)
            except OSError as error:
                logs.event(_log, logging.WARNING, "not_forgotten", what=self._what, file=self.path, why=_why(error))

    def keep(self, now_s: float) -> None:
        """Writes again what is not on the disk, with growing pauses. To be called about each second."""
        with self._lock:
            if self._wanted is None or not self._pauses.is_due(now_s):
                return
            if self.is_there:
                return
            self._write()
            if self._failure:
                self._pauses.failed(now_s)

    def _write(self) -> None:
        assert self._wanted is not None
        before = self._failure
        try:
            whole_file.replace(self.path, self._wanted, whole_file.READABLE_PERMISSIONS, is_durable=self._is_durable)
        except OSError as error:
            self._failure = _why(error)
            if not before:
                logs.event(_log, logging.WARNING, "not_saved", what=self._what, file=self.path, why=self._failure)
                self.on_change()
            return
        self._written, self._failure = output_file.identity_of(self.path), ""
        if before:
            logs.event(_log, logging.WARNING, "saved_again", what=self._what, file=self.path, why=before)
            self.on_change()


def _why(error: OSError) -> str:
    return error.strerror or str(error)
