"""Spreads a fleet over several processes (``--workers``), which the user sees as one daemon.

Each worker flies a part of the fleet as a daemon of its own would. The supervisor flies nothing. It starts the workers,
lets none serve before all have opened their addresses, passes on signals, writes their logs and their audit, and ends
with one status.
"""

from __future__ import annotations

import asyncio
import gc
import json
import logging
import os
import signal
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from typing import TYPE_CHECKING, Any

from ual.shared import guard
from ual_daemon import logs
from ual_daemon.program import fleet_time, log_output, signals
from ual_daemon.program.metrics.catalogue import MetricSample
from ual_daemon.program.metrics.threads import audit_samples, guard_samples
from ual_daemon.program.metrics.workers import WorkersMetrics
from ual_daemon.program.pipes import Pipe
from ual_daemon.program.supervision import log_serving, span
from ual_daemon.program.worker import AUDIT, BOUND, END, END_OF_LINE, FAILED, GO, SERVING, Channels, Worker

if TYPE_CHECKING:
    from ual_daemon.program.metrics.exporter import Exporter
    from ual_daemon.program.recording.audit_file import AuditFile
    from ual_daemon.program.recording.audit_writer import AuditWriter

_log = logging.getLogger(__name__)

_WORKER_END_S = 75.0
"""Longer than the workers need, which end within 70 s."""
_LABELS = {"process": "supervisor"}
_CANNOT_START_STATUS = 1
_LEFT_IN_MOTION_STATUS = 3


class CannotStartError(Exception):
    """A worker cannot start: the message says why, and `status` is its exit status."""

    def __init__(self, message: str, status: int) -> None:
        super().__init__(message)
        self.status = status


class _WorkerProcess:
    """One worker as the supervisor sees it."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = names
        self.pid = 0
        self.phase = ""
        self.failure: CannotStartError | None = None
        self.status: int | None = None
        """Its exit status once it has ended; the negative number of the signal that killed it."""
        self._orders, self._order = os.pipe()
        self.words, self.log, self.audit = Pipe(b"\n"), Pipe(END_OF_LINE.encode()), Pipe(b"\n")
        self.metrics = Pipe(b"\n")

    def channels(self) -> Channels:
        """Returns the worker's ends of the pipes."""
        return Channels(self._orders, self.words.writes, self.log.writes, self.audit.writes, self.metrics.writes)

    def keep(self) -> None:
        """Leaves the worker's ends to the worker, so that they end with it."""
        for each in self.channels():
            os.close(each)

    def leave(self) -> None:
        """Closes the supervisor's ends. A worker does, too: it must notice when the supervisor is gone."""
        for each in (self._order, self.words.reads, self.log.reads, self.audit.reads, self.metrics.reads):
            os.close(each)

    @property
    def is_running(self) -> bool:
        """Whether it has not ended."""
        return self.status is None

    def tell(self, *words: object) -> None:
        """Sends words to the worker, unless it is gone."""
        if self.is_running:
            with suppress(BrokenPipeError):
                os.write(self._order, json.dumps(words).encode() + b"\n")

    def on_phase(self, phase: str, *rest: Any) -> None:  # noqa: ANN401 (as its worker sent them)
        """Takes note of how far the worker is."""
        self.phase = phase
        if phase == FAILED:
            self.failure = CannotStartError(*rest)

    def kill(self) -> None:
        """Ends it at once."""
        if self.status is None:
            os.kill(self.pid, signal.SIGKILL)

    def has_ended(self) -> bool:
        """Returns whether it has ended since the last call; `status` is then set."""
        if self.status is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self.status = os.waitstatus_to_exitcode(status) if pid else None
            return self.status is not None
        return False

    def end_text(self) -> str:
        """Returns how it ended."""
        assert self.status is not None
        return f"exit status {self.status}" if self.status >= 0 else f"killed by {signal.Signals(-self.status).name}"


class FleetSupervisor:
    """The workers of a fleet, from `start` to the end of `run`."""

    def __init__(
        self,
        names: Sequence[str],
        parts: Sequence[range],
        audit: AuditFile | None = None,
        exporter: Exporter | None = None,
    ) -> None:
        """`names` are the UAVs, `parts` which of them each worker flies. `audit` is written for all of them, and
        `exporter` serves the metrics of all.
        """
        self._names = names
        self._parts = parts
        self._audit_file = audit
        self._exporter = exporter
        self._metrics: WorkersMetrics
        self._processes: list[_WorkerProcess] = []
        self._time = fleet_time.Relay(self._processes)
        self._is_serving = self._is_ending = False
        self._audit: AuditWriter | None = None
        self._handler: log_output.BackgroundHandler
        self._all_ended: asyncio.Event

    def start(self) -> Worker | None:
        """Forks the workers. Returns the worker in each of them, and None in the supervisor.

        To be called while the process has one thread, and before gRPC is imported, which does not survive a fork.
        """
        for part in self._parts:
            process = _WorkerProcess(self._names[part.start : part.stop])
            process.pid = os.fork()
            self._processes.append(process)
            if not process.pid:
                self._leave_to_workers()
                return Worker(part, process.channels())
            process.keep()
        return None

    def _leave_to_workers(self) -> None:
        for each in self._processes:
            each.leave()
        if self._audit_file is not None:
            self._audit_file.leave()
        if self._exporter is not None:
            self._exporter.leave()

    def run(self, level: str, format: log_output.Format) -> int:  # noqa: A002  as in logging
        """Waits for the end of all workers. Returns the exit status.

        Raises:
            CannotStartError: One of them cannot start; all have ended.

        """
        gc.enable()
        self._handler = log_output.setup(level, format)
        threading.excepthook = guard.on_ended_thread
        with ExitStack() as held:
            if self._audit_file is not None:
                from ual_daemon.program.recording.audit_writer import AuditWriter

                self._audit = AuditWriter(self._audit_file)
                held.callback(self._audit.close)
            if self._exporter is not None:
                held.callback(self._exporter.close)
            asyncio.run(self._watch())
        return self._status()

    def _status(self) -> int:
        for each in self._processes:
            if each.failure is not None and not self._is_serving:
                raise each.failure
        if any(each.status for each in self._processes):
            return _LEFT_IN_MOTION_STATUS if self._is_serving else _CANNOT_START_STATUS
        logs.event(_log, logging.INFO, "ended")
        return 0

    async def _watch(self) -> None:
        self._all_ended = asyncio.Event()
        signals.on_first(self._end, self._kill)
        loop = asyncio.get_running_loop()
        loop.add_signal_handler(signal.SIGCHLD, self._reap)
        for process in self._processes:
            for pipe, _ in self._taking(process):
                loop.add_reader(pipe.reads, self._read, process)
        self._metrics = WorkersMetrics(self._processes, self._own_samples)
        if self._audit is not None:
            self._audit.on_change = partial(_soon, loop, self._tell_of_audit)
            self._tell_of_audit()
        if self._exporter is not None:
            self._exporter.start(self._metrics.samples)
        self._reap()  # a worker that has ended before this
        await self._all_ended.wait()

    def _taking(self, process: _WorkerProcess) -> list[tuple[Pipe, Callable[[Sequence[bytes]], None]]]:
        """Returns the pipes of a worker, each with the handler of its data."""
        return [
            (process.log, self._pass_on),
            (process.audit, self._add_to_audit),
            (process.words, partial(self._on_words, process)),
            (process.metrics, partial(self._on_metrics, process)),
        ]

    def _read(self, process: _WorkerProcess) -> None:
        """Takes what a worker has written."""
        for pipe, take in self._taking(process):
            pieces, may_be_more = pipe.pieces()
            take(pieces)
            if not may_be_more:
                asyncio.get_running_loop().remove_reader(pipe.reads)
        self._decide(process)

    def _pass_on(self, lines: Sequence[bytes]) -> None:
        for line in lines:
            self._handler.pass_on(line.decode(errors="replace"))

    def _on_words(self, process: _WorkerProcess, lines: Sequence[bytes]) -> None:
        for line in lines:
            word, *rest = json.loads(line)
            if word == fleet_time.ASK:
                self._time.on_ask(process, *rest)
            elif word == fleet_time.MADE:
                self._time.on_made(process, *rest)
            else:
                process.on_phase(word, *rest)

    def _on_metrics(self, process: _WorkerProcess, answers: Sequence[bytes]) -> None:
        for answer in answers:
            self._metrics.on_answer(process, answer)

    def _add_to_audit(self, lines: Sequence[bytes]) -> None:
        for line in lines:
            assert self._audit is not None
            self._audit.put(partial(json.loads, line), len(line))

    def _tell_of_audit(self) -> None:
        if self._audit is not None:
            for process in self._processes:
                process.tell(AUDIT, *self._audit.report)

    def _own_samples(self) -> list[MetricSample]:
        audit = [] if self._audit is None else audit_samples(_LABELS, self._audit.figures)
        return [*guard_samples(_LABELS), *audit]

    def _reap(self) -> None:
        for process in self._processes:
            if process.has_ended():
                self._read(process)
                for pipe, _ in self._taking(process):
                    asyncio.get_running_loop().remove_reader(pipe.reads)
                process.leave()
                self._lose(process)
        if all(process.status is not None for process in self._processes):
            self._all_ended.set()

    def _decide(self, process: _WorkerProcess) -> None:
        """Decides by what a worker has reported."""
        if process.failure is not None:
            self._end()
        if self._is_ending:
            return
        if all(each.phase == BOUND for each in self._processes):
            for each in self._processes:
                each.tell(GO)
        if not self._is_serving and all(each.phase == SERVING for each in self._processes):
            self._is_serving = True
            log_serving(self._names, len(self._processes))

    def _lose(self, process: _WorkerProcess) -> None:
        """Says what is not served any more. Before all were served, the others end, too."""
        self._time.on_end(process)
        if not self._is_ending:
            logs.event(
                _log,
                logging.ERROR,
                "worker_ended",
                how=process.end_text(),
                pid=process.pid,
                uavs=span(process.names),
                count=len(process.names),
                remedy="these UAVs are not served any more, the others are: end this daemon and start it again",
            )
        if not self._is_serving:
            self._end()

    def _end(self) -> None:
        """Lets all workers end as by a signal, and kills those that do not."""
        if not self._is_ending:
            self._is_ending = True
            for each in self._processes:
                each.tell(END)
            asyncio.get_running_loop().call_later(_WORKER_END_S, self._kill)

    def _kill(self) -> None:
        for each in self._processes:
            each.kill()


def _soon(loop: asyncio.AbstractEventLoop, call: Callable[[], object]) -> None:
    """Has the loop call it, unless it is closed: the fleet has ended."""
    with suppress(RuntimeError):
        loop.call_soon_threadsafe(call)
