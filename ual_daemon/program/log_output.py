"""Writes the daemon's logs to a stream, as human-readable text or as one JSON object a line.

A thread of its own writes the lines, so that a blocked stream (a full pipe, a slow disk) never delays flying. Lines
that do not fit into the queue, or that cannot be written, are counted, and their number is logged.
"""

from __future__ import annotations

import atexit
import errno
import json
import logging
import math
import queue
import sys
import threading
import time
from collections.abc import Callable
from typing import Literal, TextIO

from typing_extensions import override

from ual_daemon import logs
from ual_daemon.program.log_repeats import REPEAT_PERIOD_S, Repeats

Format = Literal["text", "json"]

_VERBOSE_LIBRARIES = ("asyncio", "grpc")
"""Their debug and info messages are left out, because they would hide the daemon's."""
_MOST_QUEUED_MESSAGES = 10_000
_FLUSH_LIMIT_S = 1.0
_RETRY_S = 0.1
"""The pause after a line that could not be written."""
_CLOSED_ERRORS = (errno.EPIPE, errno.EBADF)
"""Errors after which nobody can read the stream any more."""
_LONGEST_MESSAGE_CHARACTERS = 2000
"""In characters, of what is no event."""


class TextFormatter(logging.Formatter):
    """``2026-11-21 09:15:02.123 INFO    vehicle: state_changed old=LANDED_ARMED new=TAKING_OFF``, in local time."""

    @override
    def formatMessage(self, record: logging.LogRecord) -> str:
        when = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(record.created))
        head = f"{when}.{int(record.msecs):03d} {record.levelname:<7} {record.name.removeprefix('ual_daemon.')}: "
        return head + text_of(record)


class JsonFormatter(logging.Formatter):
    """One JSON object a line: ``time`` (UTC), ``level``, ``logger``, ``event`` (or ``message``), then the fields."""

    @override
    def format(self, record: logging.LogRecord) -> str:
        when = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        name: str | None = getattr(record, "ual_event", None)
        fields: dict[str, object] = {
            "time": f"{when}.{int(record.msecs):03d}Z",
            "level": record.levelname.lower(),
            "logger": record.name,
            **(
                {"message": logs.clipped(record.getMessage(), _LONGEST_MESSAGE_CHARACTERS)}
                if name is None
                else {"event": name}
            ),
            **{key: _json(value) for key, value in getattr(record, "ual_fields", {}).items()},
        }
        if record.exc_info:
            fields["exception"] = self.formatException(record.exc_info)
        return json.dumps(fields, default=str, ensure_ascii=False)


def text_of(record: logging.LogRecord) -> str:
    """Returns a record as text without time, level and logger, for a recording, which has these by themselves."""
    name: str | None = getattr(record, "ual_event", None)
    if name is None:
        return logs.clipped(record.getMessage(), _LONGEST_MESSAGE_CHARACTERS)
    return logs.event_text(name, getattr(record, "ual_fields", {}))


def _json(value: object) -> object:
    """Returns the value, or its text if JSON cannot express it."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if isinstance(value, (bool, int, float, list, tuple, dict, type(None))) else logs.clipped(str(value))


class BackgroundHandler(logging.Handler):
    """Writes lines to a stream from a thread of its own. Drops and counts lines that do not fit into the queue."""

    def __init__(
        self,
        stream: TextIO,
        queue_size: int = _MOST_QUEUED_MESSAGES,
        clock: Callable[[], float] = time.monotonic,
        end: str = "\n",
    ) -> None:
        """`end` is written after each line."""
        super().__init__()
        self._end = end
        self._repeats = Repeats(clock)
        self._stream = stream
        self._lines: queue.Queue[str | None] = queue.Queue(queue_size)
        self._lost_count = 0
        self._thread = threading.Thread(target=self._write, name="logs", daemon=True)
        self._thread.start()

    @override
    def emit(self, record: logging.LogRecord) -> None:
        self._put_repeats()
        if not self._repeats.is_repeated(record):
            self._put(record)

    def _put_repeats(self, *, is_end: bool = False) -> None:
        for summary in self._repeats.due(is_end=is_end):
            self._put(summary)

    def _put(self, record: logging.LogRecord) -> None:
        try:
            line = self.format(record)
        except Exception:  # noqa: BLE001  as all logging handlers do: a bad message must not raise in its caller
            self.handleError(record)
            return
        self._put_text(line)

    def pass_on(self, line: str) -> None:
        """Writes a line that another process has made."""
        self.acquire()
        try:
            self._put_text(line)
        finally:
            self.release()

    def _put_text(self, line: str) -> None:
        try:
            if self._lost_count:
                self._lines.put_nowait(self._loss())
                self._lost_count = 0
            self._lines.put_nowait(line)
        except queue.Full:
            self._lost_count += 1

    def _loss(self) -> str:
        return f"{self._lost_count} log lines lost: the log is not read fast enough"

    @override
    def close(self) -> None:
        """Writes the lines that are left, but does not wait for a stream that is blocked."""
        if not self._thread.is_alive():
            return
        self.acquire()
        try:
            self._put_repeats(is_end=True)
        finally:
            self.release()
        try:
            if self._lost_count:
                self._lines.put(self._loss(), timeout=_FLUSH_LIMIT_S)
            self._lines.put(None, timeout=_FLUSH_LIMIT_S)
        except queue.Full:
            pass
        else:
            self._thread.join(_FLUSH_LIMIT_S)
        super().close()

    def _next(self) -> str | None:
        """Returns the next line; None at the end. Meanwhile puts the numbers of repeated lines when they are due."""
        while True:
            try:
                return self._lines.get(timeout=REPEAT_PERIOD_S)
            except queue.Empty:
                self.acquire()
                try:
                    self._put_repeats()
                finally:
                    self.release()

    def _write_text(self, line: str) -> None:
        """Writes a line; with escapes where the stream's encoding does not have a character, such as a file name's."""
        try:
            self._stream.write(line + self._end)
        except UnicodeError:
            self._stream.write(line.encode("ascii", "backslashreplace").decode() + self._end)

    def _write(self) -> None:
        failed_count, why = 0, ""  # since the last line that was written
        while True:
            line = self._next()
            try:
                if failed_count:
                    self._stream.flush()  # empties the stream's own buffer first; raises as long as that fails
                    self._stream.write(f"up to {failed_count} log lines lost: {why}{self._end}")
                    failed_count = 0
                if line is None:
                    self._stream.flush()
                    return
                self._write_text(line)
                if self._lines.empty():
                    self._stream.flush()
            except ValueError:
                return  # the stream is closed
            except OSError as error:
                if line is None or error.errno in _CLOSED_ERRORS:
                    return
                # The disk is full, or a pipe that does not block is full: logging goes on once there is space.
                failed_count, why = failed_count + 1, error.strerror or str(error)
                time.sleep(_RETRY_S)


def setup(
    level: str,
    format: Format = "text",  # noqa: A002  as in logging
    stream: TextIO | None = None,
    end: str = "\n",
) -> BackgroundHandler:
    """Sends all logs from `level` up (``debug``, ``info``, ``warning``, ``error``) to a stream, by default stderr."""
    handler = BackgroundHandler(stream or sys.stderr, end=end)
    handler.setFormatter(JsonFormatter() if format == "json" else TextFormatter())
    root = logging.getLogger()
    for old in root.handlers[:]:
        root.removeHandler(old)
        old.close()
    root.addHandler(handler)
    root.setLevel(level.upper())
    for library in _VERBOSE_LIBRARIES:
        logging.getLogger(library).setLevel(logging.WARNING)
    atexit.register(handler.close)
    return handler
