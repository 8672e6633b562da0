"""The audit (``--audit``): a line for each call that changes something. Who, from where, what, and what came of it.

Lines are only appended, by a thread of their own: a slow or full disk delays no call. `ual._access.audit` says how they
are chained.
"""

from __future__ import annotations

import fcntl
import hashlib
import logging
import os
import threading
from collections import deque
from collections.abc import Callable
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, NamedTuple

from typing_extensions import override

from ual import __version__
from ual._access import audit
from ual._access.roles import Role
from ual_daemon import logs
from ual_daemon.program.recording.call_json import to_json
from ual_daemon.server.access.needed import needed_role
from ual_daemon.server.call_log import CallRecord, Observer
from ual_daemon.vehicle.vehicle import Vehicle

_log = logging.getLogger(__name__)

_MODE = 0o600
_MOST_WAITING = 10_000
"""So many lines wait at most for a disk that takes none."""
_RETRY_S = 1.0
_CLOSE_LIMIT_S = 5.0
_LONGEST_LINE = 8 << 20
_NOT_CHANGING = frozenset({"/ual.v1.UalService/KeepLease"})


class AuditError(Exception):
    """The audit cannot be written; the message says why."""


class _Waiting(NamedTuple):
    vehicle: Vehicle
    record: CallRecord
    before: object
    after: str
    utc: datetime


def changes(method: str) -> bool:
    """Whether a method changes something: whatever needs more than an observer, but keeping a lease."""
    return needed_role(method) > Role.OBSERVER and method not in _NOT_CHANGING


class Audit:
    """The audit of all UAVs of this process, until `close`.

    Raises:
        AuditError: The file cannot be written, or another daemon writes it.

    """

    def __init__(self, path: Path, now: Callable[[], datetime] = lambda: datetime.now(timezone.utc)) -> None:
        self._path = path
        self._now = now
        self._file = _opened(path)
        self._waiting: deque[_Waiting] = deque()
        self._lost_count = 0
        self._is_failing = False
        self._has_more = threading.Condition()
        self._is_closing = False
        self._head, torn = _head(self._file, path)
        self._unwritten = b"" if torn is None else b"\n"
        self._begin(torn)
        self._thread = threading.Thread(target=self._run, name="audit", daemon=True)
        self._thread.start()

    def observer(self, vehicle: Vehicle) -> Observer:
        """Returns what observes the calls for a UAV."""
        return _UavAudit(vehicle, self)

    def put(self, vehicle: Vehicle, record: CallRecord, before: object) -> None:
        """Writes a line, soon. From any thread."""
        entry = _Waiting(vehicle, record, before, vehicle.state().name, self._now())
        with self._has_more:
            if len(self._waiting) < _MOST_WAITING:
                self._waiting.append(entry)
            else:
                self._lost_count += 1
            self._has_more.notify()

    def close(self) -> None:
        """Writes what waits, and ends. The log has the last hash, by which `ual audit verify --head` finds a cut."""
        with self._has_more:
            self._is_closing = True
            self._has_more.notify()
        self._thread.join(_CLOSE_LIMIT_S)
        if self._waiting or self._unwritten or self._thread.is_alive():
            logs.event(_log, logging.ERROR, "audit_incomplete", file=self._path, lines=len(self._waiting))
            return
        os.close(self._file)
        logs.event(_log, logging.INFO, "audit_ends", file=self._path, head=self._head)

    def _begin(self, torn: bytes | None) -> None:
        entry: dict[str, Any] = {"event": audit.OPENED, "time": _text(self._now()), "version": __version__}
        if torn is not None:
            entry[audit.TORN] = hashlib.sha256(torn).hexdigest()
        self._add(entry)
        try:
            self._write()
        except OSError as error:
            raise AuditError(f"cannot write the audit {self._path}: {error.strerror}") from None

    def _run(self) -> None:
        while self._take():
            try:
                self._write()
            except OSError as error:
                self._fail(error)
            else:
                self._recover()

    def _take(self) -> bool:
        """Waits for lines, and makes them ready to be written. Returns False at the end."""
        with self._has_more:
            if not (self._waiting or self._is_closing):
                self._has_more.wait()
            if self._is_failing and not self._is_closing:
                self._has_more.wait(_RETRY_S)
            taken = [] if self._is_failing else list(self._waiting)
            if not self._is_failing:
                self._waiting.clear()
            is_end = self._is_closing and not taken and (self._is_failing or not self._unwritten)
        for each in taken:
            self._add(_entry(each))
        return not is_end

    def _add(self, entry: dict[str, Any]) -> None:
        text, self._head = audit.line(entry, self._head)
        self._unwritten += text + b"\n"

    def _write(self) -> None:
        if not self._unwritten:
            return
        while self._unwritten:
            self._unwritten = self._unwritten[os.write(self._file, self._unwritten) :]
        os.fdatasync(self._file)

    def _fail(self, error: OSError) -> None:
        if not self._is_failing:
            self._is_failing = True
            logs.event(_log, logging.ERROR, "audit_fails", file=self._path, why=error.strerror, retry_s=_RETRY_S)

    def _recover(self) -> None:
        self._is_failing = False
        if self._lost_count:
            count, self._lost_count = self._lost_count, 0
            logs.event(_log, logging.ERROR, "audit_lost", file=self._path, lines=count)
            self._add({"event": "lost", "time": _text(self._now()), "lines": count})


class _UavAudit(Observer):
    def __init__(self, vehicle: Vehicle, to: Audit) -> None:
        self._vehicle = vehicle
        self._audit = to

    @override
    def on_request(self, method: str) -> object:
        return self._vehicle.state().name if changes(method) else None

    @override
    def on_call(self, record: CallRecord, before: object) -> None:
        if changes(record.method):
            self._audit.put(self._vehicle, record, before)


def _entry(waiting: _Waiting) -> dict[str, Any]:
    values = to_json(waiting.record)
    call = {name: values.pop(name) for name in ("event", "id", "identity", "caller", "agent", "method")}
    states = {"state_before": waiting.before, "state_after": waiting.after}
    return {"time": _text(waiting.utc), "ns": waiting.vehicle.ns, **call, **values, **states}


def _text(time: datetime) -> str:
    return time.isoformat(timespec="microseconds")


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
