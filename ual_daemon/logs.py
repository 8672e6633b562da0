"""Structured logs: events with fields, as text for people or as one JSON object a line.

Lines are written by a thread of their own, so that a log that nobody reads (a full pipe, a slow disk) never holds up
flying; lines that do not fit the queue, or cannot be written, are counted, and the loss is told.
"""

from __future__ import annotations

import atexit
import errno
import json
import logging
import math
import queue
import re
import sys
import threading
import time
from collections.abc import Callable
from contextvars import ContextVar
from typing import Literal, TextIO

Format = Literal["text", "json"]

caller: ContextVar[Callable[[], str] | None] = ContextVar("ual_caller", default=None)
"""Tells who gave the command that is being worked on, by the peer's address; None where it came from this process."""

uav: ContextVar[str] = ContextVar("ual_uav", default="")
"""Which UAV it is about, where a process flies several; else empty."""

_TALKATIVE = ("asyncio", "grpc")
"""Libraries whose debug messages would bury ours."""
_QUEUE_SIZE = 10_000
_FLUSH_LIMIT_S = 1.0
_RETRY_S = 0.1
"""Between a line that could not be written and the next one."""
_NOBODY_READS = (errno.EPIPE, errno.EBADF)
_PLAIN_VALUE = re.compile(r"[^\s\"\\=\x00-\x1f\x7f]+")


def event(logger: logging.Logger, level: int, event: str, /, **fields: object) -> None:
    """Logs that something happened: a name in snake_case, and what there is to say of it as fields.

    A caller from outside the process becomes the field ``caller``, one UAV of several the field ``ns``.
    """
    if not logger.isEnabledFor(level):
        return
    which = uav.get()
    if which:
        fields = {"ns": which, **fields}
    who = caller.get()
    if who is not None:
        fields.setdefault("caller", who())
    logger.log(level, "%s", event, extra={"ual_event": event, "ual_fields": fields}, stacklevel=2)


class TextFormatter(logging.Formatter):
    """``2026-11-21 09:15:02.123 INFO    vehicle: state_changed old=LANDED_ARMED new=TAKING_OFF``, in local time."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802  the base class's name
        fields: dict[str, object] = getattr(record, "ual_fields", {})
        when = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(record.created))
        head = f"{when}.{int(record.msecs):03d} {record.levelname:<7} {record.name.removeprefix('ual_daemon.')}: "
        return " ".join([head + record.message, *(f"{name}={_text(value)}" for name, value in fields.items())])


class JsonFormatter(logging.Formatter):
    """One JSON object a line: ``time`` (UTC), ``level``, ``logger``, ``event`` (or ``message``), then the fields."""

    def format(self, record: logging.LogRecord) -> str:
        when = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        name: str | None = getattr(record, "ual_event", None)
        fields: dict[str, object] = {
            "time": f"{when}.{int(record.msecs):03d}Z",
            "level": record.levelname.lower(),
            "logger": record.name,
            **({"message": record.getMessage()} if name is None else {"event": name}),
            **getattr(record, "ual_fields", {}),
        }
        if record.exc_info:
            fields["exception"] = self.formatException(record.exc_info)
        return json.dumps({name: _json(value) for name, value in fields.items()}, default=str, ensure_ascii=False)


def _json(value: object) -> object:
    """The value, or as text what JSON has no word for."""
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    text = str(value)
    # Quoted where it would not read as one word; so no value can forge a line either.
    return text if _PLAIN_VALUE.fullmatch(text) else json.dumps(text, ensure_ascii=False)


class BackgroundHandler(logging.Handler):
    """Writes lines to a stream from a thread of its own; a line that does not fit the queue is counted and dropped."""

    def __init__(self, stream: TextIO, queue_size: int = _QUEUE_SIZE) -> None:
        super().__init__()
        self._stream = stream
        self._lines: queue.Queue[str | None] = queue.Queue(queue_size)
        self._lost = 0
        self._thread = threading.Thread(target=self._write, name="logs", daemon=True)
        self._thread.start()

    def emit(self, record: logging.LogRecord) -> None:
        try:
            line = self.format(record)
        except Exception:  # noqa: BLE001  as every logging handler does: a bad message must not stop its caller
            self.handleError(record)
            return
        try:
            if self._lost:
                self._lines.put_nowait(self._loss())
                self._lost = 0
            self._lines.put_nowait(line)
        except queue.Full:
            self._lost += 1

    def _loss(self) -> str:
        return f"{self._lost} log lines lost: the log is not read fast enough"

    def close(self) -> None:
        """Writes what is left, but does not wait for a reader that is stuck."""
        if not self._thread.is_alive():
            return
        try:
            if self._lost:
                self._lines.put(self._loss(), timeout=_FLUSH_LIMIT_S)
            self._lines.put(None, timeout=_FLUSH_LIMIT_S)
        except queue.Full:
            pass
        else:
            self._thread.join(_FLUSH_LIMIT_S)
        super().close()

    def _write(self) -> None:
        failed, why = 0, ""  # since a line was written
        while True:
            line = self._lines.get()
            try:
                if failed:
                    self._stream.flush()  # what its buffer has kept; until that is out, nothing is added to it
                    self._stream.write(f"up to {failed} log lines lost: {why}\n")
                    failed = 0
                if line is None:
                    return
                self._stream.write(line + "\n")
                if self._lines.empty():
                    self._stream.flush()
            except ValueError:
                return  # the stream is closed: there is nobody to tell
            except OSError as error:
                if line is None or error.errno in _NOBODY_READS:
                    return
                # A disk that is full, a pipe that does not block: the log goes on when that is over.
                failed, why = failed + 1, error.strerror or str(error)
                time.sleep(_RETRY_S)


def setup(level: str, format: Format = "text", stream: TextIO | None = None) -> None:  # noqa: A002  as in logging
    """Sends all logs from `level` (``debug``, ``info``, ``warning``, ``error``) on to a stream, by default stderr."""
    handler = BackgroundHandler(stream or sys.stderr)
    handler.setFormatter(JsonFormatter() if format == "json" else TextFormatter())
    root = logging.getLogger()
    for old in root.handlers[:]:
        root.removeHandler(old)
        old.close()
    root.addHandler(handler)
    root.setLevel(level.upper())
    for talkative in _TALKATIVE:
        logging.getLogger(talkative).setLevel(logging.WARNING)
    atexit.register(handler.close)
