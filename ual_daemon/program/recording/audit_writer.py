"""Writes the lines of an audit by a thread of its own. Imports no gRPC, as `audit_file`."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable
from datetime import datetime
from typing import Any

from ual_daemon import logs
from ual_daemon.program.recording.audit_file import Lines, time_text, utc_now

_log = logging.getLogger(__name__)

_MOST_WAITING = 10_000
"""So many lines wait at most for a disk that takes none."""
_RETRY_S = 1.0
_CLOSE_LIMIT_S = 5.0


class AuditWriter:
    """Writes lines by a thread of its own, until `close`. A disk that takes none for a while delays nobody."""

    def __init__(self, lines: Lines, now: Callable[[], datetime] = utc_now) -> None:
        self._lines = lines
        self._now = now
        self._waiting: deque[Callable[[], dict[str, Any]]] = deque()
        self._lost_count = 0
        self._is_failing = False
        self._has_more = threading.Condition()
        self._is_closing = False
        self._thread = threading.Thread(target=self._run, name="audit", daemon=True)
        self._thread.start()

    def put(self, entry: Callable[[], dict[str, Any]]) -> None:
        """Writes the line that `entry` makes, soon. From any thread."""
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
        if self._waiting or self._lines.has_unwritten or self._thread.is_alive():
            logs.event(_log, logging.ERROR, "audit_incomplete", file=self._lines.name, lines=len(self._waiting))
            return
        self._lines.close()

    def _run(self) -> None:
        while self._take():
            try:
                self._lines.write()
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
            is_end = self._is_closing and not taken and (self._is_failing or not self._lines.has_unwritten)
        for each in taken:
            self._lines.add(each())
        return not is_end

    def _fail(self, error: OSError) -> None:
        if not self._is_failing:
            self._is_failing = True
            logs.event(_log, logging.ERROR, "audit_fails", file=self._lines.name, why=error.strerror, retry_s=_RETRY_S)

    def _recover(self) -> None:
        self._is_failing = False
        if self._lost_count:
            count, self._lost_count = self._lost_count, 0
            logs.event(_log, logging.ERROR, "audit_lost", file=self._lines.name, lines=count)
            self._lines.add({"event": "lost", "time": time_text(self._now()), "lines": count})
