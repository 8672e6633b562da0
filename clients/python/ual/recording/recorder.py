"""Writes a recording on a thread of its own. What is to be recorded is only appended to a queue."""

from __future__ import annotations

import errno
import json
import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from ual import __version__
from ual.recording.file import File
from ual.recording.topics import Topic, json_schema, of_json
from ual.shared.guard import WorkGuard

_log = logging.getLogger(__name__)

FLUSH_S = 0.5
"""How often a chunk is ended and written to the disk. With the time that this takes, less than a second can be lost."""
_TAKE_S = 0.02
"""How often the queue is looked at. An addition does not have to wake the thread."""
MOST_ENTRIES = 50_000
"""So many entries wait at most: 50 s of one UAV with its raw packets, or a disk that writes nothing for as long."""
MOST_BYTES = 64 << 20
"""So many bytes wait at most, where entries are large."""
_ENTRY_BYTES = 400
"""About what an entry takes, beside what it brings along."""
_CLOSE_LIMIT_S = 10.0
_UNTOLD = of_json(
    "/untold",
    json_schema(
        "UalUntold",
        "An entry that could not be recorded.",
        what={"type": "string", "description": "which kind of entry"},
        why={"type": "string"},
    ),
)
METADATA = "ual"
"""The name of the metadata record of each file: version, names of the UAVs, and the clocks."""


class Output(Protocol):
    """Where an entry is written to: an open `File`."""

    def write(self, topic: Topic, data: bytes, log_ns: int, publish_ns: int, sequence: int = 0) -> None:
        """Adds a message; see `File.write`."""


class Entry(NamedTuple):
    """Something to record: `write` encodes it, on the recorder's thread. `log_ns` is when it was recorded."""

    write: Callable[[Output, Entry], None]
    log_ns: int
    value: Any


class Clock:
    """UTC that does not jump: it is read once, and goes on with the computer's monotonic clock."""

    def __init__(self) -> None:
        self.offset_ns = time.time_ns() - time.monotonic_ns()
        """What is added to the monotonic clock."""

    def now_ns(self) -> int:
        """Returns the present time, in nanoseconds since 1970."""
        return time.monotonic_ns() + self.offset_ns


@dataclass(frozen=True, slots=True)
class Turnover:
    """When a file is ended, and the next one begun."""

    size_bytes: int = 1 << 30
    age_s: float = 3600.0


class QueueFigures(NamedTuple):
    """Whether a recorder records, what waits for the disk (about how many bytes), and how many entries were dropped."""

    is_running: bool
    entries_count: int
    size_bytes: int
    lost_count: int


class Recorder:
    """Records entries into files of a directory until it is closed. `put` is for any thread, and never waits.

    Where the disk is too slow, the newest entries are dropped, and their number is logged. Where it cannot be written
    to (it is full), the recording ends, with one line in the log.
    """

    def __init__(
        self,
        directory: Path,
        name: str,
        turnover: Turnover | None = None,
        *,
        make_file: Callable[[Path, Mapping[str, Mapping[str, str]]], File] = File,
    ) -> None:
        """Opens the first file. `name` begins the files' names.

        Raises:
            OSError: The directory or the file cannot be made.

        """
        self.clock = Clock()
        self._directory = directory
        self._name = name
        self._turnover = turnover or Turnover()
        self._make_file = make_file
        self._entries: deque[Entry] = deque()
        self._bytes = 0  # about: threads that add at the same time may lose one. It begins anew with an empty queue
        self._lost_lock = threading.Lock()
        self._lost_count = 0
        self._logged_lost_count = 0
        self._guard = WorkGuard("recording")
        self._closing = threading.Event()
        self._on_file: list[Callable[[], None]] = []
        self.has_ended = False
        """Whether it records no more: it was closed, or the disk is full."""
        directory.mkdir(parents=True, exist_ok=True)
        self._file = self._open()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)

    @property
    def path(self) -> Path:
        """The file that is being written."""
        return self._file.path

    @property
    def figures(self) -> QueueFigures:
        """How the queue stands now."""
        return QueueFigures(not self.has_ended, len(self._entries), self._bytes, self._lost_count)

    @property
    def lost_count(self) -> int:
        """How many entries were dropped."""
        return self._lost_count

    def at_each_file(self, callback: Callable[[], None]) -> None:
        """Calls back when a further file begins, on the recorder's thread: to repeat what each file needs."""
        self._on_file.append(callback)

    def start(self) -> None:
        """Begins to write."""
        self._thread.start()

    def put(self, write: Callable[[Output, Entry], None], log_ns: int, value: object, size_bytes: int = 0) -> None:
        """Records a value, of about so many bytes. Never waits."""
        if self.has_ended:
            return
        if len(self._entries) >= MOST_ENTRIES or self._bytes >= MOST_BYTES:
            with self._lost_lock:
                self._lost_count += 1
            return
        self._bytes += size_bytes + _ENTRY_BYTES
        self._entries.append(Entry(write, log_ns, value))

    def close(self) -> None:
        """Writes what is left, and ends the file. Waits at most 10 s for the disk."""
        self._closing.set()
        if self._thread.ident is None:  # never started
            self._file.give_up()
            return
        self._thread.join(_CLOSE_LIMIT_S)
        if self._thread.is_alive():
            _log.error("the recording was not written to the end: the disk of %s is too slow", self._directory)

    def _run(self) -> None:
        try:
            self._record()
        except OSError as error:
            self._end(error)
        except Exception:  # noqa: BLE001  a defect concerns the recording only
            _log.exception("the recorder failed; this is a defect of UAL, please report it")
            self._end(None)

    def _record(self) -> None:
        next_flush_s = time.monotonic() + FLUSH_S
        while not self._closing.wait(_TAKE_S):
            self._take()
            now_s = time.monotonic()
            if now_s >= next_flush_s:
                self._flush(now_s)
                next_flush_s = time.monotonic() + FLUSH_S
        self.has_ended = True  # what is put from here on is not recorded
        self._take()
        self._log_lost()
        self._file.finish()

    def _take(self) -> None:
        """Writes the entries that wait now."""
        for _ in range(len(self._entries)):
            entry = self._entries.popleft()
            if not self._guard.contain(lambda entry=entry: entry.write(self._file, entry), passes=OSError):  # type: ignore[misc]
                self._write_untold(entry)
        if not self._entries:
            self._bytes = 0

    def _write_untold(self, entry: Entry) -> None:
        """Writes in place of an entry why it is missing."""
        data = json.dumps({"what": entry.write.__qualname__, "why": self._guard.last_cause}).encode()
        self._file.write(_UNTOLD, data, entry.log_ns, entry.log_ns)

    def _flush(self, now_s: float) -> None:
        self._file.flush()
        self._log_lost()
        if self._file.size_bytes >= self._turnover.size_bytes or now_s - self._opened_s >= self._turnover.age_s:
            self._file.finish()
            self._file = self._open()
            for callback in self._on_file:
                self._guard.contain(callback, passes=OSError)

    def _open(self) -> File:
        self._opened_s = time.monotonic()
        began = time.strftime("%Y%m%dT%H%M%S", time.gmtime(self.clock.now_ns() / 1e9))
        metadata = {"version": __version__, "name": self._name, "monotonic_offset_ns": str(self.clock.offset_ns)}
        for number in range(1000):  # several begin in one second
            path = self._directory / f"{self._name}_{began}{f'_{number}' if number else ''}.mcap"
            try:
                return self._make_file(path, {METADATA: metadata})
            except FileExistsError:
                continue
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(self._directory))

    def _log_lost(self) -> None:
        lost_count = self._lost_count
        if lost_count > self._logged_lost_count:
            _log.error(
                "%d records lost, %d in all: the disk of %s is too slow for the recording",
                lost_count - self._logged_lost_count,
                lost_count,
                self._directory,
            )
            self._logged_lost_count = lost_count

    def _end(self, error: OSError | None) -> None:
        """Ends the recording because of an error. The flight goes on."""
        self.has_ended = True
        self._entries.clear()
        self._file.give_up()
        if error is not None:
            _log.error("THE RECORDING HAS ENDED: %s: %s; the flight goes on", self._file.path, error.strerror or error)
