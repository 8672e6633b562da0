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
from ual.shared import output_file
from ual.shared.guard import WorkGuard
from ual.shared.pauses import GrowingPauses

_log = logging.getLogger(__name__)

FLUSH_S = 0.5
"""Seconds between two ends of a chunk, which is then written to the disk. With the time that this takes, less than a
second can be lost.
"""
_QUEUE_POLL_S = 0.02
"""Seconds between two looks at the queue. An addition does not have to wake the thread."""
MOST_ENTRIES = 50_000
"""Most entries that wait: 50 s of one UAV with its raw packets, or a disk that writes nothing for that time."""
MOST_WAITING_BYTES = 64 << 20
"""Most bytes that wait, where entries are large."""
_ENTRY_BYTES = 400
"""About what an entry takes, besides what it brings along."""
_CLOSE_TIMEOUT_S = 10.0
_UNTOLD = of_json(
    "/untold",
    json_schema(
        "UalUntold",
        "What could not be recorded.",
        what={"type": "string", "description": "which kind of entry, or how many entries"},
        why={"type": "string"},
    ),
)
METADATA = "ual"
"""The name of the metadata record of each file: version, names of the UAVs, and the clocks."""


class Output(Protocol):
    """Destination of entries: an open `File`."""

    def write(self, topic: Topic, data: bytes, log_ns: int, publish_ns: int, sequence: int = 0) -> None:
        """Adds a message; see `File.write`."""


class Entry(NamedTuple):
    """Something to record: `write` encodes it, on the recorder's thread. `log_ns` is when it was recorded."""

    write: Callable[[Output, Entry], None]
    log_ns: int
    value: Any


_JUMP_S = 10.0
"""Least step in seconds that counts as a jump of the computer's clock; slewing within a file amounts to less."""


class SteadyUtc:
    """UTC that does not jump within a file: it is read once, and goes on with the computer's monotonic clock."""

    def __init__(self) -> None:
        self.offset_ns = _offset_ns()
        """Offset from the monotonic clock."""

    def follow(self) -> float:
        """Reads UTC again where the computer's clock was set meanwhile. Returns by how many seconds; 0: it was not."""
        jump_s = (_offset_ns() - self.offset_ns) / 1e9
        if abs(jump_s) < _JUMP_S:
            return 0.0
        self.offset_ns = _offset_ns()
        return jump_s

    def now_ns(self) -> int:
        """Returns the present time, in nanoseconds since 1970."""
        return time.monotonic_ns() + self.offset_ns


def _offset_ns() -> int:
    return time.time_ns() - time.monotonic_ns()


@dataclass(frozen=True, slots=True)
class Turnover:
    """Conditions for the end of a file, and the begin of the next one."""

    size_bytes: int = 1 << 30
    age_s: float = 3600.0


class QueueFigures(NamedTuple):
    """Whether entries get to the disk, what waits for it (about how many bytes), and how many entries were lost."""

    is_running: bool
    entries_count: int
    size_bytes: int
    lost_count: int


class Recorder:
    """Records entries into files of a directory until it is closed. `put` is for any thread, and never waits.

    Where the disk is too slow, the newest entries are dropped, and their number is logged. Where it cannot be written
    to (it is full, gone, or there is no descriptor), entries wait, and it is tried again with growing pauses. The next
    file then tells what is missing. A file that was removed or moved is followed by the next one.
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
        self.clock = SteadyUtc()
        self._directory = directory
        self._name = name
        self._turnover = turnover or Turnover()
        self._make_file = make_file
        self._entries: deque[Entry] = deque()
        self._bytes = 0  # about: threads that add at the same time may lose one. It begins again with an empty queue
        self._lost_lock = threading.Lock()
        self._lost_count = 0
        self._logged_lost_count = 0
        self._guard = WorkGuard("recording")
        self._closing = threading.Event()
        self._on_file: list[Callable[[], None]] = []
        self.has_ended = False
        """Whether it records no more: it was closed."""
        self.on_change: Callable[[], object] = bool
        """Called when `trouble` has changed, on the recorder's thread."""
        self._trouble = ""
        self._since = ""
        self._lost_before_count = 0
        self._pauses = GrowingPauses()
        self._unflushed: list[Entry] = []  # of the present file: a fault of the disk may lose what it has of them
        self._file = self._open()
        self._path = self._path_before = self._file.path
        self._is_open = True
        self._next_failure = ""
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)

    @property
    def path(self) -> Path:
        """The file that is being written."""
        return self._path

    @property
    def trouble(self) -> str:
        """Why nothing can be written now, human-readable; empty while the recording goes on."""
        return self._trouble

    @property
    def figures(self) -> QueueFigures:
        """Figures of the queue now."""
        return QueueFigures(not (self.has_ended or self._trouble), len(self._entries), self._bytes, self._lost_count)

    @property
    def lost_count(self) -> int:
        """Entries that were dropped."""
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
        if len(self._entries) >= MOST_ENTRIES or self._bytes >= MOST_WAITING_BYTES:
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
        self._thread.join(_CLOSE_TIMEOUT_S)
        if self._thread.is_alive():
            _log.error("the recording was not written to the end: the disk of %s is too slow", self._directory)

    def _run(self) -> None:
        next_flush_s = time.monotonic() + FLUSH_S
        while not self._closing.wait(_QUEUE_POLL_S):
            now_s = time.monotonic()
            is_due = now_s >= next_flush_s
            self._contain(lambda is_due=is_due: self._turn(is_due=is_due))  # type: ignore[misc]
            if is_due:
                next_flush_s = time.monotonic() + FLUSH_S
        self.has_ended = True  # what is put from here on is not recorded
        self._contain(self._finish)

    def _contain(self, work: Callable[[], None]) -> None:
        """Does a part of the work. A fault concerns the recording only, and lasts as long as its cause."""
        try:
            work()
        except OSError as error:
            self._fail(error.strerror or str(error))
        except Exception as error:  # noqa: BLE001  a defect concerns the recording only
            self._guard.note(error)
            self._fail(self._guard.last_cause)

    def _turn(self, *, is_due: bool) -> None:
        """Writes the entries that wait now; where a flush is due, brings them to the disk."""
        if self._is_open:
            self._take()
        if not is_due or not (self._is_open or self._pauses.is_due(time.monotonic())):
            return
        if not self._is_open:
            self._begin_file()  # first what may be missing, before the queue: a disk that is full again takes no more
        self._flush()

    def _finish(self) -> None:
        """Writes what is left, and ends the file."""
        if not self._is_open:
            self._begin_file()
        self._take()
        self._file.flush()
        self._on_flushed()
        self._log_lost()
        self._file.finish()

    def _take(self) -> None:
        """Writes the entries that wait now."""
        for _ in range(len(self._entries)):
            entry = self._entries.popleft()
            self._unflushed.append(entry)
            self._write(entry)
        if not self._entries:
            self._bytes = 0

    def _write(self, entry: Entry) -> None:
        if not self._guard.contain(lambda: entry.write(self._file, entry), passes=OSError):
            self._write_untold(entry.write.__qualname__, self._guard.last_cause, entry.log_ns)

    def _write_untold(self, what: str, why: str, log_ns: int) -> None:
        """Writes what is missing, and why, in its place."""
        self._file.write(_UNTOLD, json.dumps({"what": what, "why": why}).encode(), log_ns, log_ns)

    def _flush(self) -> None:
        self._file.flush()
        self._follow_loss()
        self._on_flushed()
        self._log_lost()
        self._follow_clock()
        age_s = time.monotonic() - self._opened_s
        if self._file.size_bytes >= self._turnover.size_bytes or age_s >= self._turnover.age_s:
            self._turn_over()

    def _on_flushed(self) -> None:
        self._unflushed.clear()
        if self._trouble:
            self._recover()

    def _follow_loss(self) -> None:
        """Goes on in the next file where the present one was removed, moved or replaced."""
        loss = output_file.loss_of(self._file.path, self._file.fileno())
        if loss and os.fstat(self._file.fileno()).st_nlink:
            self._unflushed.clear()  # they are in it, elsewhere
        if loss and self._turn_over():
            _log.error("the recording %s %s: it goes on in %s", self._path_before, loss, self._path)
            why = f"the file before, {self._path_before.name}, {loss}"
            self._write_untold("the file before", why, self.clock.now_ns())

    def _follow_clock(self) -> None:
        """Goes on in a file of the right date where the computer's clock was set: a computer may begin in 1970."""
        if jump_s := self.clock.follow():
            self._turn_over()
            why = f"the computer's clock was set by {jump_s:+.1f} s: times before it are of the old clock"
            _log.warning("the recording goes on in %s: %s", self._path, why)
            self._write_untold("the file before", f"{self._path_before.name}: {why}", self.clock.now_ns())

    def _turn_over(self) -> bool:
        """Begins the next file, and ends the last. Where there can be none now, the last one goes on.

        Returns whether it was begun.
        """
        if not self._pauses.is_due(time.monotonic()):
            return False
        last = self._file
        try:
            file = self._open()
        except OSError as error:
            self._pauses.failed(time.monotonic())
            if not self._next_failure:
                _log.error("the next file of the recording cannot be made: %s; the last one goes on", error.strerror)
            self._next_failure = error.strerror or str(error)
            return False
        self._next_failure = ""
        try:
            last.finish()
        except OSError:  # what was flushed is in it
            last.give_up()
        self._begin(file)
        return True

    def _begin_file(self) -> None:
        """Opens a file after a fault."""
        self._begin(self._open())

    def _begin(self, file: File) -> None:
        """Goes on in a file, which begins with what is not certain to be in the last one."""
        self._file, self._path_before, self._path, self._is_open = file, self._path, file.path, True
        for callback in self._on_file:
            self._guard.contain(callback, passes=OSError)
        for entry in self._unflushed:
            self._write(entry)

    def _recover(self) -> None:
        """Tells in the file and in the log that it records again, and what is missing."""
        count = self._lost_count - self._lost_before_count
        why, since, self._trouble = self._trouble, self._since, ""
        missing = f"{count} records are missing" if count else "nothing is missing"
        _log.error("the recording has recovered: %s; %s (%s, since %s)", self._path, missing, why, since)
        self._logged_lost_count = self._lost_count
        if count:
            self._write_untold(f"{count} entries", f"{why}, since {since}", self.clock.now_ns())
        self._guard.contain(self.on_change)

    def _fail(self, why: str) -> None:
        """Takes note that nothing can be written now. The flight goes on."""
        if self._is_open:
            self._is_open = False
            self._file.give_up()
        self._pauses.failed(time.monotonic())
        is_new, self._trouble = not self._trouble, why
        if self.has_ended:
            count = len(self._unflushed) + len(self._entries)
            _log.error("THE RECORDING IS NOT COMPLETE: %d records could not be written: %s", count, why)
        elif is_new:
            self._since, self._lost_before_count = utc_text(self.clock.now_ns()), self._logged_lost_count
            _log.error("THE RECORDING STANDS STILL: %s: %s; it is tried again, and the flight goes on", self._path, why)
            self._guard.contain(self.on_change)

    def _open(self) -> File:
        self._opened_s = time.monotonic()
        self._directory.mkdir(parents=True, exist_ok=True)
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


def utc_text(time_ns: int) -> str:
    """Returns a time as people read it."""
    return time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(time_ns / 1e9))
