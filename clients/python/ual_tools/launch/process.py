"""One running program of a team: in a session of its own, with its output in the team's log."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
from functools import partial

from ual_tools.launch.log import TeamLog
from ual_tools.launch.log_file import LogFile
from ual_tools.launch.ready import LogWatch
from ual_tools.launch.team import Program

_CHUNK_BYTES = 1 << 16
_LONGEST_ROW_BYTES = 8192
_OUTPUT_REST_S = 1.0
"""Seconds for which the last lines of a program that has ended are awaited."""


class TeamProcess:
    """A program that has been started. `pid` is also that of its session and of its process group."""

    def __init__(self, program: Program, process: asyncio.subprocess.Process, log: TeamLog) -> None:
        self.program = program
        self.watch = LogWatch(program)
        self._process = process
        self._log = log
        self._reading: asyncio.Task[None] | None = None

    @classmethod
    async def start(cls, program: Program, log: TeamLog) -> TeamProcess:
        """Starts a program.

        Raises:
            OSError: It cannot be started.
        """
        with contextlib.ExitStack() as opened:
            file = None
            if program.log_file is not None:
                file = LogFile(program.log_file, partial(log.note, is_bad=True))
                opened.callback(file.close)
            read, write = os.pipe()
            opened.callback(os.close, read)
            try:
                process = await asyncio.create_subprocess_exec(
                    *program.argv,
                    cwd=program.cwd,
                    env={"PYTHONUNBUFFERED": "1", **os.environ, **program.env},
                    stdin=asyncio.subprocess.DEVNULL,
                    stdout=write,
                    stderr=write,
                    start_new_session=True,
                )
            finally:
                os.close(write)
            opened.pop_all()  # now they are the reader's
        started = cls(program, process, log)
        started._reading = asyncio.create_task(started._read(read, file))
        return started

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    @property
    def status(self) -> int | None:
        """Its exit status; negative: the signal that ended it; None: it runs."""
        return self._process.returncode

    async def wait(self) -> int:
        """Returns its exit status once it has ended, and what it has written is in the log."""
        status = await self._process.wait()
        assert self._reading is not None
        # What it has left behind may keep the pipe open: so not without a limit.
        await asyncio.wait((self._reading,), timeout=_OUTPUT_REST_S)
        return status

    def signal(self, number: signal.Signals) -> None:
        """Sends a signal to all of its process group."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, number)

    async def stop(self) -> None:
        """Ends it by its signal, or kills it after its limit; and kills what is left of its process group."""
        self.signal(self.program.stop_signal)
        waiting = asyncio.ensure_future(self._process.wait())
        done, _ = await asyncio.wait((waiting,), timeout=self.program.stop_limit_s)
        if not done:
            self._log.note(
                f"{self.program.name}: killed, because it did not end in {self.program.stop_limit_s:g} s", is_bad=True
            )
        self.signal(signal.SIGKILL)
        await self.wait()

    async def _read(self, pipe: int, file: LogFile | None) -> None:
        """Passes its lines on. A line that is too long comes in parts."""
        reader = asyncio.StreamReader()
        loop = asyncio.get_running_loop()
        output = os.fdopen(pipe, "rb", buffering=0)
        with output, contextlib.closing(file) if file else contextlib.nullcontext():
            transport, _ = await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), output)
            rest = b""
            try:
                while chunk := await reader.read(_CHUNK_BYTES):
                    *lines, rest = (rest + chunk).split(b"\n")
                    while len(rest) > _LONGEST_ROW_BYTES:
                        lines, rest = [*lines, rest[:_LONGEST_ROW_BYTES]], rest[_LONGEST_ROW_BYTES:]
                    for line in lines:
                        self._write_output(line, file)
                if rest:
                    self._write_output(rest, file)
            finally:
                transport.close()

    def _write_output(self, line: bytes, file: LogFile | None) -> None:
        text = line.decode(errors="replace").rstrip("\r")
        self.watch.see(text)
        if file is None or not file.write(text):
            self._log.write(self.program.name, text)
