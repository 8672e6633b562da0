"""The journal of uploads: a list that may be on the autopilot in part is remembered, also by the next daemon.

An entry is kept before the first item leaves, and removed once the autopilot's list was read back whole. One that is
left says that an upload was cut off, by whatever: the caller, the link, the autopilot or the daemon.
"""

from __future__ import annotations

import json
import logging
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

from ual.errors import RejectedByAutopilotError, UalError, WrongStateError
from ual_daemon import logs
from ual_daemon.backends.offers.missions import UNCHANGED
from ual_daemon.backends.offers.parameters import Refusal
from ual_daemon.frames.kept_file import UNUSABLE, KeptFile

T = TypeVar("T")

MISSION, FENCE, RALLY = "mission", "fence", "rally points"
_MOST_ENTRIES = 12
"""Entries that are kept: a few lists of each of a few vehicles."""
_TIME = "%Y-%m-%d %H:%M:%S UTC"

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class UploadEntry:
    """An upload that was begun: of which list, to which vehicle, of how many items, and when (Unix time).

    Without items it is a removal of all. `vehicle` is empty where it was not known.
    """

    list: str
    vehicle: str
    items_count: int
    began_s: float

    def is_of(self, name: str, vehicle: str) -> bool:
        """Returns whether it concerns a list of a vehicle."""
        return self.list == name and (not self.vehicle or not vehicle or self.vehicle == vehicle)

    @property
    def text(self) -> str:
        """Human-readable."""
        what = f"an upload of {self.items_count} items" if self.items_count else "a removal"
        return f"{self.list}: {what}, begun at {time.strftime(_TIME, time.gmtime(self.began_s))}, was not finished"


class JournalFile:
    """A small file of JSON. What cannot be read is logged, and ignored. Any thread may call."""

    def __init__(self, path: Path) -> None:
        self.kept = KeptFile(path, "which uploads were begun")
        self._lock = threading.Lock()
        self._written: Sequence[UploadEntry] = ()

    @classmethod
    def next_to(cls, home_file: Path) -> JournalFile:
        """Returns the one that belongs to a file of home."""
        return cls(home_file.with_suffix(".uploads"))

    def read(self) -> list[UploadEntry]:
        """Returns the entries; none if there is nothing, or nothing that can be used."""
        try:
            self._written = [_entry(each) for each in json.loads(self.kept.read())]
        except FileNotFoundError:
            self._written = ()
        except UNUSABLE as error:
            logs.event(_log, logging.WARNING, "uploads_file_ignored", file=str(self.kept.path), why=repr(error))
        return list(self._written)

    def write(self, entries: Callable[[], list[UploadEntry]], *, is_durable: bool) -> None:
        """Keeps the entries of this moment. `is_durable`: they also outlive a loss of power that follows."""
        with self._lock:
            kept = entries()
            if kept == self._written and not self.kept.checks:
                return
            self._written = kept
            self.kept.write(json.dumps([asdict(each) for each in kept]) + "\n", is_durable=is_durable)


class UploadJournal:
    """The uploads to the autopilot of one UAV. Any thread may call any member.

    `identity` says which vehicle it is; empty while that is not known.
    """

    def __init__(self, file: JournalFile | None, identity: Callable[[], str]) -> None:
        self._file = file
        self._identity = identity
        self._lock = threading.Lock()
        self._unfinished = [] if file is None else file.read()
        self._running: list[UploadEntry] = []
        for entry in self._unfinished:
            logs.event(_log, logging.WARNING, "upload_unfinished", why=f"{entry.text} by the daemon before")

    def begin(self, name: str, items_count: int) -> Upload:
        """Remembers an upload that is to begin. Call it before the first item can leave; it writes a file."""
        entry = UploadEntry(name, self._identity(), items_count, time.time())
        with self._lock:
            self._running.append(entry)
        self._save(is_durable=True)
        return Upload(self, entry)

    def refusal(self, command: str, *names: str) -> WrongStateError | None:
        """Returns why a command that relies on some lists may not begin; None if none of them may be there in part."""
        vehicle = self._identity()
        with self._lock:
            found = next((each for each in self._unfinished for name in names if each.is_of(name, vehicle)), None)
        if found is None:
            return None
        return WrongStateError(
            f"{command}: {found.text}, so the autopilot may have a part of it, or what it had before: upload the "
            f"{found.list} again, or clear",
            {"needed": "upload", "list": found.list},
        )

    def require_whole(self, command: str, *names: str) -> None:
        """Checks that no upload of these lists was cut off.

        Raises:
            WrongStateError: One was, and neither uploaded again nor cleared since.

        """
        refusal = self.refusal(command, *names)
        if refusal is not None:
            raise refusal

    def end(self, entry: UploadEntry, *, is_whole: bool, is_begun: bool) -> None:
        """Takes how an upload has ended. One that is whole replaces all that were cut off before."""
        with self._lock:
            self._running = [each for each in self._running if each is not entry]
            before = [each for each in self._unfinished if each.is_of(entry.list, entry.vehicle)]
            if is_whole:
                self._unfinished = [each for each in self._unfinished if each not in before]
            elif is_begun and (entry.items_count or not before):
                self._unfinished = [each for each in self._unfinished if each not in before] + [entry]
        self._save(is_durable=False)

    def _save(self, *, is_durable: bool) -> None:
        if self._file is not None:
            self._file.write(self._entries, is_durable=is_durable)

    def _entries(self) -> list[UploadEntry]:
        """Returns what the next daemon has to know: one entry for each list of each vehicle."""
        with self._lock:
            found = {(each.list, each.vehicle): each for each in reversed((*self._unfinished, *self._running))}
        return list(found.values())[:_MOST_ENTRIES]


class Upload:
    """One upload in the journal: `run` or `drop` ends it."""

    def __init__(self, journal: UploadJournal, entry: UploadEntry) -> None:
        self._journal = journal
        self._entry = entry
        self._is_sent = False
        self._is_open = True

    @property
    def list(self) -> str:
        """The name of the list."""
        return self._entry.list

    def run(
        self,
        transfer: Callable[[Refusal], Future[T]],
        refusal: Refusal,
        undo: Callable[[], Future[Any]] | None = None,
    ) -> Future[T]:
        """Begins the transfer. `undo` removes what an upload that was cut off has left; None: nothing is left."""

        def refusal_or_none() -> UalError | None:
            error = refusal()
            self._is_sent = self._is_sent or error is None
            return error

        try:
            transferring = transfer(refusal_or_none)
        except BaseException:
            self.drop()
            raise
        self._is_open = False
        transferring.add_done_callback(lambda ended: self._on_end(ended, undo))
        return transferring

    def drop(self) -> None:
        """Forgets it where it was not run: nothing was sent."""
        if self._is_open:
            self._is_open = False
            self._journal.end(self._entry, is_whole=False, is_begun=False)

    def _on_end(self, ended: Future[T], undo: Callable[[], Future[Any]] | None) -> None:
        error = UalError("its caller has gone, or has cancelled it") if ended.cancelled() else ended.exception()
        is_unchanged = isinstance(error, RejectedByAutopilotError) and UNCHANGED in error.metadata
        is_begun = self._is_sent and not is_unchanged
        self._journal.end(self._entry, is_whole=error is None, is_begun=is_begun)
        if error is None or not is_begun:
            return
        why = f"{self._entry.text}: {error}"
        logs.event(_log, logging.WARNING, "upload_unfinished", why=why, undoing=undo is not None)
        if undo is not None:
            _begin_undo(undo, self._entry)


def _begin_undo(undo: Callable[[], Future[Any]], entry: UploadEntry) -> None:
    def on_end(ended: Future[Any]) -> None:
        error = UalError("it was withdrawn") if ended.cancelled() else ended.exception()
        _tell_undone(entry, error)

    try:
        undo().add_done_callback(on_end)
    except UalError as error:
        _tell_undone(entry, error)


def _tell_undone(entry: UploadEntry, error: BaseException | None) -> None:
    if error is None:
        logs.event(_log, logging.INFO, "upload_undone", list=entry.list)
    else:
        logs.event(_log, logging.WARNING, "upload_not_undone", list=entry.list, why=str(error))


def _entry(values: dict[str, object]) -> UploadEntry:
    name, vehicle = str(values["list"]), str(values["vehicle"])
    began_s = float(str(values["began_s"]))
    time.gmtime(began_s)  # what cannot be reported is none
    return UploadEntry(name, vehicle, int(str(values["items_count"])), began_s)
