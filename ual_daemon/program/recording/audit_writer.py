"""Writes the lines of an audit by a thread of its own. Imports no gRPC, as `audit_file`."""

from __future__ import annotations

import errno
import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from datetime import datetime
from functools import partial
from typing import Any, NamedTuple

from ual.access import audit
from ual.shared.guard import WorkGuard
from ual_daemon import logs
from ual_daemon.program.recording.audit_file import AuditError, AuditOutput, time_text, utc_now

_log = logging.getLogger(__name__)

_MOST_WAITING_LINES = 10_000
"""Most lines that wait for a disk that takes none."""
_MOST_WAITING_BYTES = 64 << 20
"""Most bytes of requests and answers that wait."""
_PIECE_BYTES = 1 << 20
"""Bytes that are encoded at once: a line takes many times the memory of its request."""
_FILE_CHECK_S = 0.5
"""Longest time in s between two checks that the file exists and its disk has space."""
_RETRY_S = 1.0
_HUNG_S = 5.0
"""Seconds after which a disk that has not answered counts as one that takes no line; a worn card may take two."""
_CLOSE_TIMEOUT_S = 5.0


class AuditReport(NamedTuple):
    """State of an audit: why it cannot be written now (empty: it can), and its failing checks."""

    trouble: str = ""
    checks: tuple[str, ...] = ()


class AuditFigures(NamedTuple):
    """Whether lines can be written, what waits for that, how many lines were lost, and how often the file was."""

    is_writable: bool
    entries_count: int
    size_bytes: int
    lost_count: int
    file_losses_count: int


class AuditWriter:
    """Writes lines by a thread of its own, until `close`. A disk that takes none for a while delays nobody."""

    def __init__(
        self,
        lines: AuditOutput,
        now: Callable[[], datetime] = utc_now,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._lines = lines
        self._now = now
        self._clock = clock
        self._turn_began_s: float | None = None
        self.guard = WorkGuard("audit")
        self.on_change: Callable[[], object] = bool
        """Called when `report` returns something else, on the thread that writes."""
        self._above = AuditReport()
        self._waiting: deque[tuple[Callable[[], dict[str, Any]], int]] = deque()
        self._waiting_bytes = 0
        self._untold_loss_count = self._lost_count = 0
        self._file_losses_count, self._last_loss = 0, ""
        self._failure = ""
        self._failing_since = ""
        self._has_space = True
        self._reported: AuditReport | None = AuditReport()
        self._has_more = threading.Condition()
        self._is_closing = False
        self._thread = threading.Thread(target=self._run, name="audit", daemon=True)
        self._thread.start()

    @property
    def trouble(self) -> str:
        """Why lines cannot be written now, human-readable; empty if they can."""
        if self._failure or self._above.trouble:
            return self._failure or self._above.trouble
        if not self._has_space:
            return os.strerror(errno.ENOSPC)
        if self._is_hung:
            return "the disk does not answer"
        return "" if self._thread.is_alive() else "its thread has ended"

    @property
    def _is_hung(self) -> bool:
        began_s = self._turn_began_s
        return began_s is not None and self._clock() - began_s > _HUNG_S

    @property
    def report(self) -> AuditReport:
        """State of the audit now. From any thread."""
        trouble, found = self.trouble, []
        if trouble:
            found.append(f"the audit {self._lines.name} cannot be written: {trouble}")
        if self._file_losses_count:
            found.append(f"the file of the audit {self._last_loss} (losses since the start: {self._file_losses_count})")
        if self._lost_count:
            found.append(f"lines of the audit were lost since the start: {self._lost_count}")
        return AuditReport(trouble, tuple(dict.fromkeys((*self._above.checks, *found))))

    @property
    def figures(self) -> AuditFigures:
        """Measurements of the audit. From any thread."""
        counts = len(self._waiting), self._waiting_bytes, self._lost_count, self._file_losses_count
        return AuditFigures(not self.trouble, *counts)

    def on_report_above(self, report: AuditReport) -> None:
        """Takes note of how the audit of the supervisor stands, to which these lines go."""
        self._above = report
        self._tell()

    def put(self, entry: Callable[[], dict[str, Any]], size_bytes: int = 0) -> None:
        """Writes the line that `entry` makes of so many bytes, soon. From any thread."""
        with self._has_more:
            if len(self._waiting) < _MOST_WAITING_LINES and self._waiting_bytes + size_bytes <= _MOST_WAITING_BYTES:
                self._waiting.append((entry, size_bytes))
                self._waiting_bytes += size_bytes
            else:
                self._untold_loss_count += 1
                self._lost_count += 1
            if not self._failure:
                self._has_more.notify()

    def close(self) -> None:
        """Writes what waits, and ends. The log has the last hash, by which `ual audit verify --head` finds a cut."""
        with self._has_more:
            self._is_closing = True
            self._has_more.notify()
        self._thread.join(_CLOSE_TIMEOUT_S)
        lines_count = len(self._waiting) + self._untold_loss_count
        if lines_count or self._lines.has_unwritten or self._thread.is_alive():
            why = self._failure or "the disk is too slow"
            logs.event(_log, logging.ERROR, "audit_incomplete", file=self._lines.name, lines=lines_count, why=why)
            return
        self._lines.close()

    def _run(self) -> None:
        has_ended = False
        while not has_ended:
            with self._has_more:
                if not self._is_closing and (self._failure or not self._waiting):
                    self._has_more.wait(_RETRY_S if self._failure else _FILE_CHECK_S)
                is_closing = self._is_closing
            self._turn()
            has_ended = is_closing and (bool(self._failure) or not self._waiting)

    def _turn(self) -> None:
        """Writes a piece of what waits, and finds out what cannot be done now."""
        self._turn_began_s = self._clock()
        try:
            self._check_file()
            if not self._failure:
                self._take_piece()
            self._lines.write()
            self._resume()
            self._has_space = self._lines.has_space()
        except OSError as error:
            self._fail(error.strerror or str(error))
        except AuditError as error:
            self._fail(str(error))
        except Exception as error:  # noqa: BLE001  whatever it is, the thread goes on and tries again
            self.guard.note(error)
            self._fail(f"{type(error).__name__}: {error}")
        if self._is_hung:  # others may have been told meanwhile
            self._reported = None
        self._turn_began_s = None
        self._tell()

    def _check_file(self) -> None:
        loss = self._lines.file_loss(self._now())
        if loss:
            self._file_losses_count, self._last_loss = self._file_losses_count + 1, loss
            logs.event(_log, logging.ERROR, "audit_file_lost", file=self._lines.name, why=loss, remedy="begun anew")

    def _take_piece(self) -> None:
        """Makes ready to be written what waits: some of it, if that is much."""
        while self._waiting and self._lines.unwritten_bytes < _PIECE_BYTES:
            make, size_bytes = self._waiting[0]
            if not self.guard.contain(partial(self._add, make)):
                self._lines.add({"event": audit.UNTOLD, "time": time_text(self._now()), "why": self.guard.last_cause})
            with self._has_more:
                self._waiting.popleft()
                self._waiting_bytes -= size_bytes

    def _add(self, make: Callable[[], dict[str, Any]]) -> None:
        self._lines.add(make())

    def _resume(self) -> None:
        """Tells in the file and in the log that lines are written again, and how many were lost."""
        with self._has_more:
            count, self._untold_loss_count = self._untold_loss_count, 0
            why, self._failure = self._failure, ""
        if why:
            since = self._failing_since
            logs.event(_log, logging.INFO, "audit_resumes", file=self._lines.name, since=since, why=why, lost=count)
            self._lines.add({"event": audit.RESUMED, "time": time_text(self._now()), "since": since, "why": why})
        if count:
            logs.event(_log, logging.ERROR, "audit_lost", file=self._lines.name, lines=count)
            self._lines.add({"event": audit.LOST, "time": time_text(self._now()), "lines": count})
        self._lines.write()

    def _fail(self, why: str) -> None:
        if not self._failure:
            self._failing_since = time_text(self._now())
            logs.event(_log, logging.ERROR, "audit_fails", file=self._lines.name, why=why, retry_s=_RETRY_S)
        self._failure = why

    def _tell(self) -> None:
        report = self.report
        if report != self._reported:
            self._reported = report
            self.guard.contain(self.on_change)
