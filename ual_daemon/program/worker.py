"""One of several processes that fly a fleet (``--workers``): what it tells its `supervisor`, and hears from it.

They speak over pipes, in lines. When the supervisor is gone, in any way, its pipe ends: the worker then ends as by a
signal, in a way that is safe for its UAVs.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

from typing_extensions import override

from ual.shared.guard import WorkGuard
from ual_daemon import logs
from ual_daemon.program import log_output, signals
from ual_daemon.program.fleet_time import MAKE, FleetTime
from ual_daemon.program.metrics.catalogue import MetricSample
from ual_daemon.program.metrics.workers import ASK as METRICS
from ual_daemon.program.metrics.workers import packed
from ual_daemon.program.pipes import PipeReader
from ual_daemon.program.supervision import Supervision

if TYPE_CHECKING:
    from ual.interface import Simulation
    from ual_daemon.program.recording.audit_writer import AuditReport
    from ual_daemon.server.simulation_service import SimulatedTime

_log = logging.getLogger(__name__)

BOUND, SERVING, FAILED = "bound", "serving", "failed"
"""The worker's words: all its addresses are open; all its UAVs are served; it cannot start, and why."""
GO, END, AUDIT = "go", "end", "audit"
"""The supervisor's: serve; end as by a signal; how the audit stands."""
END_OF_LINE = "\0"
"""Ends each line of a worker's log, which may have several lines of text."""


class Channels(NamedTuple):
    """The worker's ends of its pipes: its orders, its reports, the lines of its log and audit, its metrics."""

    orders: int
    words: int
    log: int
    audit: int
    metrics: int


class Worker(Supervision):
    """A worker, in its own process."""

    def __init__(self, part: range, channels: Channels) -> None:
        """`part` are its UAVs, counted from 0."""
        self.part = part
        self.channels = channels
        self._level = "info"
        self._format: log_output.Format = "text"
        self._stop: Callable[[], None] = _nothing
        self._has_closed: Callable[[], bool] = bool
        self._decided = asyncio.Event()
        self._may_serve = False
        self._is_alone = False
        self._orders = PipeReader(channels.orders, b"\n")
        self._time: FleetTime | None = None
        self.metrics: Callable[[], Sequence[MetricSample]] | None = None
        """Returns the metrics of its UAVs, if they are wanted."""
        self._is_answering = False
        self._guard = WorkGuard("metrics")
        self._on_audit: Callable[[AuditReport], object] = _ignoring
        self._audit: tuple[str, list[str]] = ("", [])
        # A terminal sends these to all processes of the command; the supervisor is reported, and tells its workers.
        for number in (signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)

    def set_up_logs(self, level: str, format: log_output.Format) -> None:  # noqa: A002  as in logging
        """Sends the log to the supervisor, which writes the lines of all workers; to stderr once that is gone."""
        self._level, self._format = level, format
        log_output.setup(level, format, os.fdopen(self.channels.log, "w", encoding="utf-8"), END_OF_LINE)

    def fail(self, message: str, status: int) -> NoReturn:
        """Tells why it cannot start, and ends."""
        self._tell(FAILED, message, status)
        sys.exit(status)

    @override
    def watch(self, stop: Callable[[], None]) -> None:
        self._stop = stop
        self._has_closed = asyncio.get_running_loop().is_closed
        signals.on_first(self._end, signals=(signal.SIGTERM,))
        asyncio.get_running_loop().add_reader(self.channels.orders, self._hear)

    @override
    async def may_serve(self) -> bool:
        self._tell(BOUND)
        await self._decided.wait()
        return self._may_serve

    @override
    def serves(self, names: Sequence[str]) -> None:
        self._tell(SERVING)

    @override
    def watch_audit(self, on_report: Callable[[AuditReport], object]) -> None:
        self._on_audit = on_report
        self._on_audit_report(*self._audit)

    def _on_audit_report(self, trouble: str, checks: list[str]) -> None:
        from ual_daemon.program.recording.audit_writer import AuditReport

        self._audit = trouble, checks
        self._on_audit(AuditReport(trouble, tuple(checks)))

    @override
    def ended(self) -> None:
        if self._is_alone:  # else the supervisor logs the end of all
            logs.event(_log, logging.INFO, "ended")

    @override
    def time_of(self, simulation: Simulation) -> SimulatedTime:
        if self._time is None:  # all UAVs of one process share their time
            self._time = FleetTime(simulation, self._tell, self._is_over)
        return self._time

    def _is_over(self) -> bool:
        return self._is_alone or self._has_closed()

    def _tell(self, *words: object) -> None:
        with suppress(BrokenPipeError):  # the supervisor is gone, which `_hear` finds out
            os.write(self.channels.words, json.dumps(words).encode() + b"\n")

    def _hear(self) -> None:
        orders, may_be_more = self._orders.pieces()
        for order in orders:
            self._on_order(*json.loads(order))
        if not may_be_more:
            self._on_alone()

    def _on_order(self, word: str, *rest: Any) -> None:  # noqa: ANN401 (as the supervisor sent them)
        if word == GO:
            self._may_serve = True
            self._decided.set()
        elif word == END:
            self._end()
        elif word == METRICS:
            self._on_metrics(*rest)
        elif word == AUDIT:
            self._on_audit_report(*rest)
        elif self._time is not None:
            answer: Callable[..., None] = self._time.on_make if word == MAKE else self._time.on_made
            answer(*rest)

    def _on_metrics(self, number: int) -> None:
        """Answers by a thread of its own, as gathering and writing take a while."""
        if self.metrics is not None and not self._is_answering:
            self._is_answering = True
            threading.Thread(target=self._answer, args=(number, self.metrics), name="metrics", daemon=True).start()

    def _answer(self, number: int, gather: Callable[[], Sequence[MetricSample]]) -> None:
        def answer() -> None:
            with suppress(BrokenPipeError), open(self.channels.metrics, "wb", closefd=False) as pipe:
                pipe.write(packed(number, gather()) + b"\n")

        self._guard.contain(answer)
        self._is_answering = False

    def _on_alone(self) -> None:
        asyncio.get_running_loop().remove_reader(self.channels.orders)
        self._is_alone = True
        log_output.setup(self._level, self._format)
        logs.event(_log, logging.ERROR, "supervisor_gone", why="the process that started this one was killed")
        self._end()

    def _end(self) -> None:
        self._may_serve = False
        self._decided.set()
        self._stop()


def _ignoring(_: object) -> None:
    pass


def _nothing() -> None:
    pass
