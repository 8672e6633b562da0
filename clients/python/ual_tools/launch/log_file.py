"""The log file of a program that `ual launch` runs: lines are appended, whatever happens to the disk meanwhile."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

from ual.shared import output_file
from ual.shared.pauses import GrowingPauses

_APPEND = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
_FILE_PERMISSIONS = 0o666
_ROTATION_CHECK_S = 0.5
"""Seconds between two checks that the file is still at its path: it may be moved away each night."""


class LogFile:
    """A file of lines. What cannot be written is counted, and noted in the file once it can be written again.

    Args:
        path: It is made, if it is not there.
        tell: Takes that it cannot be written, and that it can again; human-readable.
        now_s: The time, in seconds, of a clock that does not jump.

    Raises:
        OSError: It cannot be opened now.

    """

    def __init__(self, path: Path, tell: Callable[[str], None], now_s: Callable[[], float] = time.monotonic) -> None:
        self._path, self._tell, self._now_s = path, tell, now_s
        self._file: int | None = os.open(path, _APPEND, _FILE_PERMISSIONS)
        self._check_s = now_s() + _ROTATION_CHECK_S
        self._pauses = GrowingPauses()
        self._missing_count = 0

    def write(self, line: str) -> bool:
        """Appends a line. Returns whether it is in the file."""
        now_s = self._now_s()
        is_written = self._pauses.is_due(now_s) and self._try(line, now_s)
        self._missing_count += not is_written
        return is_written

    def close(self) -> None:
        """Closes it."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def _try(self, line: str, now_s: float) -> bool:
        try:
            file = self._opened(now_s)
            if self._missing_count:
                _append(file, f"{self._missing_count} lines are missing here: the file could not be written\n")
                self._tell(f"{self._path} is written again, {self._missing_count} lines are missing in it")
                self._missing_count = 0
            _append(file, f"{line}\n")
        except OSError as error:
            if not self._missing_count:
                self._tell(f"{self._path} cannot be written: {error.strerror}; it is tried again")
            self._pauses.failed(now_s)
            return False
        return True

    def _opened(self, now_s: float) -> int:
        """Returns the file, opened again where it was moved or removed."""
        if self._file is not None and now_s < self._check_s and not self._missing_count:
            return self._file
        if self._file is None or output_file.loss_of(self._path, self._file):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            # Before the last is closed: there may be no descriptor.
            file = os.open(self._path, _APPEND, _FILE_PERMISSIONS)
            self.close()
            self._file = file
        self._check_s = now_s + _ROTATION_CHECK_S
        return self._file


def _append(file: int, text: str) -> None:
    """Appends text, all of it or nothing."""
    data = text.encode(errors="replace")
    written = os.write(file, data)
    try:
        while written < len(data):
            written += os.write(file, data[written:])
    except OSError:
        os.ftruncate(file, os.fstat(file).st_size - written)
        raise
