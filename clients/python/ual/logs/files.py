"""A log that grows in a file, until it is whole: it goes on where it was cut off, and no other log gets into it."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Protocol

from typing_extensions import Self

from ual.errors import InvalidArgumentError, UalError
from ual.logs.values import Log, LogChunk
from ual.shared import whole_file

OVERLAP = 4096
"""Bytes before the end of a partial file that are read again and compared, where a download goes on."""
_UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")


class Downloads(Protocol):
    """Source of logs: the used part of `ual.interface.Logs`."""

    def download(self, log_id: str, offset: int = 0) -> Iterator[LogChunk]:
        """See `ual.interface.Logs.download`."""
        ...


class PartialFile:
    """`FILE.part`, which becomes `FILE` once the log is whole. What log it is of stands in `FILE.part.json`.

    Take `offset`, download from there, and `add` each chunk; then `finish`. To be used as a context manager, which
    closes it: what has come stays for the next time.
    """

    def __init__(self, file: Path, log: Log) -> None:
        self.file = file
        self.log = log
        self.part = file.with_name(f"{file.name}.part")
        self._about = file.with_name(f"{file.name}.part.json")
        try:
            self.size = self._size_before()
            # Not buffered: what could not be written must not be tried again when the file is closed.
            self._stream = self.part.open("r+b" if self.size else "w+b", buffering=0)
        except OSError as error:
            raise _unwritable(self.part, error) from None
        try:
            self._stream.seek(self.size)
            whole_file.write(self._about, json.dumps(asdict(log)))
        except OSError as error:
            self._stream.close()
            if not self.size:
                self.part.unlink(missing_ok=True)
            raise _unwritable(self.part, error) from None
        self._hash = hashlib.sha256()
        self._is_whole = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    @property
    def offset(self) -> int:
        """Offset at which a download has to begin."""
        return max(0, self.size - OVERLAP)

    def add(self, chunk: LogChunk) -> None:
        """Writes a chunk.

        Raises:
            UalError: It is of another log, does not follow, or differs from what is there; or its hash is wrong.

        """
        if (chunk.log.id, chunk.log.time_s) != (self.log.id, self.log.time_s) or chunk.log.size_bytes < self.size:
            raise UalError(f"{self.log.id} is another log now: remove {self.part} and fetch it anew")
        if chunk.offset > self.size:
            raise UalError(f"{self.log.id}: bytes {self.size} to {chunk.offset} have not come")
        self._hash.update(chunk.data)
        data = self._compared(chunk)[: max(0, self.log.size_bytes - self.size)]
        try:
            self._write(data)
        except OSError as error:
            raise _unwritable(self.part, error) from None
        if chunk.sha256:
            self._end(chunk.sha256)

    def finish(self) -> str:
        """Renames the file. Returns the SHA-256 of all of it, in hexadecimal.

        Raises:
            UalError: It is not whole.

        """
        if not self._is_whole or self.size != self.log.size_bytes:
            raise UalError(f"{self.log.id} is not whole: {self.size} of {self.log.size_bytes} bytes have come")
        try:
            os.fsync(self._stream.fileno())
            self._stream.seek(0)
            digest = hashlib.sha256()
            while data := self._stream.read(2**20):
                digest.update(data)
            self._stream.close()
            self.part.replace(self.file)
            self._about.unlink(missing_ok=True)
        except OSError as error:
            raise _unwritable(self.file, error) from None
        return digest.hexdigest()

    def _write(self, data: bytes) -> None:
        written = 0
        while written < len(data):
            count = self._stream.write(data[written:])
            written += count
            self.size += count

    def _compared(self, chunk: LogChunk) -> bytes:
        """Returns what is new of a chunk. What is there already has to be the same."""
        known = min(self.size - chunk.offset, len(chunk.data))
        if known > 0:
            self._stream.seek(chunk.offset)
            if self._read(known) != chunk.data[:known]:
                raise UalError(f"{self.log.id} differs from what is in {self.part}: remove that and fetch it anew")
            self._stream.seek(self.size)
        return chunk.data[max(0, known) :]

    def _read(self, count: int) -> bytes:
        """Returns the next bytes; fewer at the end of the file."""
        found = b""
        while len(found) < count and (data := self._stream.read(count - len(found))):
            found += data
        return found

    def _end(self, sha256: str) -> None:
        if sha256 != self._hash.hexdigest():
            raise UalError(f"{self.log.id}: the hash of what has come is wrong: fetch it again")
        self._is_whole = True

    def _size_before(self) -> int:
        """Returns how much of this very log is there; 0 where it is of another one."""
        try:
            before = json.loads(self._about.read_text(encoding="utf-8"))
            size = self.part.stat().st_size
        except (FileNotFoundError, ValueError):
            return 0
        return size if self._is_of(before) and size <= self.log.size_bytes else 0

    def _is_of(self, before: object) -> bool:
        """Returns whether what is there is of this log, which may have grown since. One without a time may be another
        one.
        """
        now = asdict(self.log)
        if before == now:
            return True
        if not isinstance(before, dict) or self.log.time_s is None:
            return False
        length = before.get("size_bytes")
        is_shorter = isinstance(length, int) and length <= self.log.size_bytes
        return is_shorter and {**before, "size_bytes": self.log.size_bytes} == now


def fetch(
    logs: Downloads, log: Log, file: Path, on_progress: Callable[[int, int], object] = lambda _done, _all: None
) -> str:
    """Downloads a log into a file. Goes on with what a download that was cut off has left beside it.

    Args:
        logs: `Uav.logs`.
        log: One that `logs.get_all` has listed.
        file: Written as ``FILE.part`` until the log is whole. One that is there is replaced then.
        on_progress: Called with how many bytes are there, and how many there will be.

    Returns:
        The SHA-256 of the file, in hexadecimal.

    Raises:
        UalError: The link broke, the log has changed, or the file cannot be written. What has come stays.

    """
    with PartialFile(file, log) as part:
        for chunk in logs.download(log.id, part.offset):
            part.add(chunk)
            on_progress(part.size, log.size_bytes)
        return part.finish()


def file_name(log: Log, ns: str) -> str:
    """Returns a name for the file of a log, which is one on every system: ``uav_1_2026-11-25_13_22_11.ulg``."""
    name = log.id if "." in log.id else f"log_{log.id}"
    return _UNSAFE.sub("_", f"{ns}_{name}").lstrip(".-") or "log"


def _unwritable(file: Path, error: OSError) -> InvalidArgumentError:
    return InvalidArgumentError(f"cannot write {file}: {error.strerror}; what has come stays", {"field": "file"})
