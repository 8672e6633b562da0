"""Has pictures painted by another process, so that no flight waits for them: painting keeps Python's lock."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ual.errors import UalError
from ual_daemon.backends.light.scene import PaintOrder

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

_MODULE = "ual_daemon.backends.light.painting_process"
_PACKAGES = Path(__file__).parents[3]
"""Folder that contains `ual_daemon`. The process starts there, so that no file of the user's directory is taken for a
module.
"""
_PROCESS_END_S = 5.0
PICTURE_TIMEOUT_S = 15.0
"""A process that has not painted a picture by then is killed."""
_PAINTER_NICENESS = 10


class Painter:
    """Paints one picture after the other. Its process starts with the first one. From any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._easel: _Easel | None = None

    def paint(self, order: PaintOrder) -> Future[bytes]:
        """Returns the future of a picture as PNG."""
        with self._lock:
            if self._easel is None:
                self._easel = _Easel()
            return self._easel.paint(order)

    def close(self) -> None:
        """Ends its process. Pictures that wait are cancelled. A later one starts another process."""
        with self._lock:
            easel, self._easel = self._easel, None
        if easel is not None:
            easel.close()


class _Easel:
    """One thread that waits for one process. All but `paint` and `close` is called on that thread."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, "light-painter")
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None

    def paint(self, order: PaintOrder) -> Future[bytes]:
        """See `Painter`."""
        return self._thread.submit(self._painted, order)

    def close(self) -> None:
        """See `Painter`."""
        self._thread.shutdown(wait=False, cancel_futures=True)
        with self._killing_after(_PROCESS_END_S):
            self._thread.shutdown()
        self._end()

    def _painted(self, order: PaintOrder) -> bytes:
        connection = self._connection or self._start()
        try:
            with self._killing_after(PICTURE_TIMEOUT_S):
                connection.send(order)
                return connection.recv_bytes()
        except (EOFError, OSError):
            raise UalError(f"the process that paints pictures has ended: {self._end()}") from None

    @contextmanager
    def _killing_after(self, limit_s: float) -> Iterator[None]:
        """Kills the process if what is waited for takes longer: it may have been stopped."""
        timer = threading.Timer(limit_s, self._kill)
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()

    def _kill(self) -> None:
        process = self._process
        if process is not None:
            process.kill()

    def _start(self) -> Connection:
        from multiprocessing import Pipe  # 20 ms, for which only callers that want pictures wait

        ours, its = Pipe()
        with its:
            command = [sys.executable, "-m", _MODULE, str(its.fileno())]
            self._process = subprocess.Popen(  # noqa: S603 (our own command)
                command, stdin=subprocess.DEVNULL, cwd=_PACKAGES, env=_environment(), pass_fds=(its.fileno(),)
            )
        _lower_priority(self._process.pid)
        self._connection = ours
        return ours

    def _end(self) -> str:
        """Ends the process, if there is one. Returns with which status it ended."""
        process, connection = self._process, self._connection
        self._process = self._connection = None
        if process is None or connection is None:
            return "it was not started"
        connection.close()
        try:
            return f"status {process.wait(_PROCESS_END_S)}"
        except subprocess.TimeoutExpired:
            process.kill()
            return f"status {process.wait(_PROCESS_END_S)}"


def _lower_priority(pid: int) -> None:
    """Has a process that has just begun take the processor only where no flight needs it: the daemon may run in real
    time, and its imports alone take 0.2 s.
    """
    with suppress(ProcessLookupError):  # it has ended already, which the next picture says
        if hasattr(os, "sched_setscheduler") and os.sched_getscheduler(pid) in (os.SCHED_FIFO, os.SCHED_RR):
            os.sched_setscheduler(pid, os.SCHED_OTHER, os.sched_param(0))
        os.setpriority(os.PRIO_PROCESS, pid, os.getpriority(os.PRIO_PROCESS, pid) + _PAINTER_NICENESS)


def _environment() -> dict[str, str]:
    """Returns that of this process, with the places where this one finds its packages."""
    folders = [str(Path(each).absolute()) for each in sys.path if each]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(folders)}
