"""Destination of an audit's lines: a file, in which they are chained, or a pipe to the process that writes the file.

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
from typing import Any, NamedTuple

from typing_extensions import override

from ual import __version__
from ual.access import audit
from ual.shared import output_file
from ual_daemon import logs

_log = logging.getLogger(__name__)

_FILE_PERMISSIONS = 0o600
_LONGEST_ENTRY_BYTES = 8 << 20
"""Bytes from its end in which the last whole line of a file is searched."""
_LONGEST_ADDITION_BYTES = 4 << 20
_LEAST_SPACE_BYTES = 64 << 10
"""Free bytes that a disk needs to take further lines."""
_OUTLINE = frozenset({"event", "time", "ns", "id", "identity", "caller", "agent", "method"})
"""Fields that are written of an entry that is too long."""


class AuditError(Exception):
    """The audit cannot be written; the message says why."""


def utc_now() -> datetime:
    """Returns the time of a line."""
    return datetime.now(timezone.utc)


def time_text(time: datetime) -> str:
    """Returns it as it is written."""
    return time.isoformat(timespec="microseconds")


class AuditOutput(ABC):
    """Destination of the lines of an audit."""

    name: str
    """Name in the log."""

    def __init__(self, file: int) -> None:
        self._file = file
        self._unwritten = b""
        self._begun_bytes = 0  # of the first unwritten line: these are in the file

    @property
    def has_unwritten(self) -> bool:
        """Whether something was added that is not written."""
        return bool(self._unwritten)

    @property
    def unwritten_bytes(self) -> int:
        """Bytes that were added and are not written yet."""
        return len(self._unwritten)

    @abstractmethod
    def add(self, entry: dict[str, Any]) -> None:
        """Adds a line, to be written."""

    def file_loss(self, now: datetime) -> str:
        """Returns what has become of the file since the last time, human-readable; empty if it is there. One that is
        lost is begun again, with what is not written.

        Raises:
            AuditError: It is lost, and cannot be begun again now.

        """
        return ""

    def has_space(self) -> bool:
        """Returns whether the disk has space for further lines, as far as it says so."""
        return True

    def write(self) -> None:
        """Writes what was added.

        Raises:
            OSError: It cannot be written now; what is left is written the next time.

        """
        written = self._begun_bytes
        try:
            while written < len(self._unwritten):
                written += os.write(self._file, self._unwritten[written:])
        except OSError:
            self._keep(written)
            raise
        self._unwritten, self._begun_bytes = b"", 0

    def _keep(self, written: int) -> None:
        """Keeps what is not written, from the beginning of its first line."""
        begin = self._unwritten.rfind(b"\n", 0, written) + 1
        self._unwritten, self._begun_bytes = self._unwritten[begin:], written - begin
        if self._begun_bytes and self._takes_back(self._unwritten[: self._begun_bytes]):
            self._begun_bytes = 0

    def _takes_back(self, begun: bytes) -> bool:
        """Returns whether the beginning of a line is not in the file any more."""
        return False

    def close(self) -> None:
        """Ends it, once everything is written."""
        os.close(self._file)


class AuditFile(AuditOutput):
    """A file of chained lines.

    Raises:
        AuditError: The file cannot be written, or another daemon writes it.

    """

    def __init__(self, path: Path, now: Callable[[], datetime] = utc_now) -> None:
        opened = _open(path)
        super().__init__(opened.file)
        self._path = path
        self.name = str(path)
        self._added: list[dict[str, Any]] = []  # what is not written, as entries: another file has another chain
        self._is_synced = True
        self._begin(opened, now())
        try:
            self.write()
        except OSError as error:
            os.close(self._file)
            raise AuditError(f"cannot write the audit {path}: {error.strerror}") from None

    def _begin(self, opened: _OpenedFile, now: datetime, **why: str) -> None:
        """Begins to write to a file that was opened."""
        self._file, self._head, self._begun_bytes = opened.file, opened.head, 0
        self._unwritten = b"" if opened.torn is None else b"\n"
        entry: dict[str, Any] = {"event": audit.OPENED, "time": time_text(now), "version": __version__, **why}
        if opened.torn is not None:
            entry[audit.TORN] = hashlib.sha256(opened.torn).hexdigest()
        self.add(entry)

    @override
    def add(self, entry: dict[str, Any]) -> None:
        text, head = audit.encoded_entry(entry, self._head)
        if len(text) > _LONGEST_ADDITION_BYTES:
            outline = {name: value for name, value in entry.items() if name in _OUTLINE}
            entry = {**outline, audit.UNTOLD: f"{len(text)} bytes, and a line has at most {_LONGEST_ADDITION_BYTES}"}
            text, head = audit.encoded_entry(entry, self._head)
        self._head = head
        self._unwritten += text + b"\n"
        self._added.append(entry)

    @override
    def file_loss(self, now: datetime) -> str:
        loss = output_file.loss_of(self._path, self._file)
        if loss:
            opened = _open(self._path)
            os.close(self._file)
            added, self._added = self._added, []
            self._begin(opened, now, **{audit.AFTER: loss, "previous_hash": self._head})
            for entry in added:
                self.add(entry)
        return loss

    @override
    def has_space(self) -> bool:
        return output_file.has_space(self._file, _LEAST_SPACE_BYTES)

    @override
    def write(self) -> None:
        if self._unwritten:
            self._is_synced = False
            super().write()
            self._added.clear()
        if not self._is_synced:
            os.fdatasync(self._file)
            self._is_synced = True

    @override
    def _keep(self, written: int) -> None:
        del self._added[: self._unwritten.count(b"\n", 0, written)]
        super()._keep(written)

    @override
    def _takes_back(self, begun: bytes) -> bool:
        try:
            begin = os.fstat(self._file).st_size - len(begun)
            is_last = begin >= 0 and os.pread(self._file, len(begun), begin) == begun
            if is_last:
                os.ftruncate(self._file, begin)
        except OSError:  # it may only be appended to
            return False
        return is_last

    @override
    def close(self) -> None:
        super().close()
        logs.event(_log, logging.INFO, "audit_ends", file=self.name, head=self._head)

    def leave(self) -> None:
        """Closes it in a process that does not write it."""
        super().close()


class AuditPipe(AuditOutput):
    """The lines of a worker of a fleet, which its supervisor chains and writes: one file for all."""

    name = "of the supervisor"

    @override
    def add(self, entry: dict[str, Any]) -> None:
        self._unwritten += json.dumps(entry).encode() + b"\n"


class _OpenedFile(NamedTuple):
    """A file to append to: the hash of its last whole line, and what an incomplete line after it has."""

    file: int
    head: str
    torn: bytes | None


def _open(path: Path) -> _OpenedFile:
    """Opens the file, which no other daemon may write at the same time."""
    try:
        file = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, _FILE_PERMISSIONS)
    except OSError as error:
        raise AuditError(f"cannot write the audit {path}: {error.strerror}") from None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return _OpenedFile(file, *_head(file, path))
    except BlockingIOError:
        os.close(file)
        raise AuditError(f"another daemon writes the audit {path}: each needs a file of its own") from None
    except AuditError:
        os.close(file)
        raise
    except OSError as error:
        os.close(file)
        raise AuditError(f"cannot read the audit {path}: {error.strerror}") from None


def _head(file: int, path: Path) -> tuple[str, bytes | None]:
    """Returns the hash of the last whole line, and what an incomplete line after it has."""
    size = os.fstat(file).st_size
    data = os.pread(file, _LONGEST_ENTRY_BYTES, max(0, size - _LONGEST_ENTRY_BYTES))
    lines = data.split(b"\n")
    torn = lines.pop() or None
    for text in reversed(lines):
        found = audit.hash_of(text)
        if found is not None:
            return found, torn
    if lines:
        raise AuditError(f"{path} is no audit: its last line has no hash. Name another file")
    return audit.START, torn
