"""Where the lines of an audit go: into a file, in which they are chained, or through a pipe to who writes the file.

Imports no gRPC: the supervisor of a fleet opens the file before it forks its workers.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import logging
import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from typing_extensions import override

from ual import __version__
from ual.access import audit
from ual_daemon import logs

_log = logging.getLogger(__name__)

_MODE = 0o600
_LONGEST_LINE = 8 << 20


class AuditError(Exception):
    """The audit cannot be written; the message says why."""


def utc_now() -> datetime:
    """Returns the time of a line."""
    return datetime.now(timezone.utc)


def time_text(time: datetime) -> str:
    """Returns it as it is written."""
    return time.isoformat(timespec="microseconds")


class Lines(ABC):
    """Where the lines of an audit go."""

    name: str
    """What the log calls it."""

    def __init__(self, file: int) -> None:
        self._file = file
        self._unwritten = b""

    @property
    def has_unwritten(self) -> bool:
        """Whether something was added that is not written."""
        return bool(self._unwritten)

    @abstractmethod
    def add(self, entry: dict[str, Any]) -> None:
        """Adds a line, to be written."""

    def write(self) -> None:
        """Writes what was added.

        Raises:
            OSError: It cannot be written now; what is left is written the next time.

        """
        while self._unwritten:
            self._unwritten = self._unwritten[os.write(self._file, self._unwritten) :]

    def close(self) -> None:
        """Ends it, once everything is written."""
        os.close(self._file)


class AuditFile(Lines):
    """A file of chained lines.

    Raises:
        AuditError: The file cannot be written, or another daemon writes it.

    """

    def __init__(self, path: Path, now: Callable[[], datetime] = utc_now) -> None:
        super().__init__(_opened(path))
        self._path = path
        self.name = str(path)
        self._head, torn = _head(self._file, path)
        self._unwritten = b"" if torn is None else b"\n"
        self._begin(torn, now())

    def _begin(self, torn: bytes | None, now: datetime) -> None:
        entry: dict[str, Any] = {"event": audit.OPENED, "time": time_text(now), "version": __version__}
        if torn is not None:
            entry[audit.TORN] = hashlib.sha256(torn).hexdigest()
        self.add(entry)
        try:
            self.write()
        except OSError as error:
            raise AuditError(f"cannot write the audit {self._path}: {error.strerror}") from None

    @override
    def add(self, entry: dict[str, Any]) -> None:
        text, self._head = audit.line(entry, self._head)
        self._unwritten += text + b"\n"

    @override
    def write(self) -> None:
        if self._unwritten:
            super().write()
            os.fdatasync(self._file)

    @override
    def close(self) -> None:
        super().close()
        logs.event(_log, logging.INFO, "audit_ends", file=self.name, head=self._head)

    def leave(self) -> None:
        """Closes it in a process that does not write it."""
        super().close()


class AuditPipe(Lines):
    """The lines of a worker of a fleet, which its supervisor chains and writes: one file for all."""

    name = "of the supervisor"

    @override
    def add(self, entry: dict[str, Any]) -> None:
        self._unwritten += json.dumps(entry).encode() + b"\n"


def _opened(path: Path) -> int:
    """Opens the file, which no other daemon may write at the same time."""
    try:
        file = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, _MODE)
    except OSError as error:
        raise AuditError(f"cannot write the audit {path}: {error.strerror}") from None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(file)
        raise AuditError(f"another daemon writes the audit {path}: each needs a file of its own") from None
    return file


def _head(file: int, path: Path) -> tuple[str, bytes | None]:
    """Returns the hash of the last whole line, and what an incomplete line after it has."""
    size = os.fstat(file).st_size
    data = os.pread(file, _LONGEST_LINE, max(0, size - _LONGEST_LINE))
    lines = data.split(b"\n")
    torn = lines.pop() or None
    for text in reversed(lines):
        found = audit.hash_of(text)
        if found is not None:
            return found, torn
    if lines:
        raise AuditError(f"{path} is no audit: its last line has no hash. Name another file")
    return audit.START, torn
