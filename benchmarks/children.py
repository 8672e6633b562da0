"""Processes of a measurement: started, controlled by lines of JSON, measured by the system's counters, and ended."""

from __future__ import annotations

import json
import os
import re
import resource
import select
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from typing_extensions import Self

REPOSITORY = Path(__file__).parents[1]
LIMIT_S = 60.0
"""Seconds that an answer may take, in addition to the task itself."""
UAL = str(Path(sys.executable).with_name("ual"))
"""The command `ual`."""
_END_S = 10.0
_REALTIME_PRIORITY = 20
_NICE = -15


class ChildError(Exception):
    """A process did not do what it should; the message says what happened."""


class Process:
    """One process, which ends with the block. Ends only processes that were started here."""

    def __init__(
        self,
        command: Sequence[str],
        *,
        environment: Mapping[str, str] | None = None,
        stdin: int = subprocess.DEVNULL,
        stdout: int = subprocess.DEVNULL,
        stderr: int | IO[bytes] | None = None,
    ) -> None:
        self.started_s = time.monotonic()
        self.popen = subprocess.Popen(
            command,
            env={**os.environ, **(environment or {})},
            cwd=REPOSITORY,
            stdin=stdin,
            stdout=stdout,
            stderr=stderr,
            text=True,
        )

    @property
    def pid(self) -> int:
        return self.popen.pid

    def processor_s(self) -> float:
        """Returns the processor time so far, of all its threads, including those that have ended."""
        return processor_s(self.pid)

    def resident_mib(self) -> float:
        """Returns the resident memory."""
        return resident_mib(self.pid)

    def anonymous_mib(self) -> float:
        """Returns the part of the resident memory that belongs to no file: what the process has allocated."""
        return _memory_mib(self.pid, "RssAnon")

    def prefer(self) -> None:
        """Gives it priority over other processes: real time if the system permits it, else a lower niceness."""
        for thread in self._threads():
            with suppress(ProcessLookupError, PermissionError):
                if _may_be_realtime():
                    os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(_REALTIME_PRIORITY))
                else:
                    os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0))
                    os.setpriority(os.PRIO_PROCESS, thread, _NICE)

    def close(self) -> None:
        """Terminates it, and kills it if it does not end in time."""
        for stream in (self.popen.stdin, self.popen.stdout):
            if stream is not None:
                with suppress(BrokenPipeError):
                    stream.close()
        if self.popen.poll() is None:
            self.popen.terminate()
        try:
            self.popen.wait(_END_S)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            self.popen.wait(_END_S)
        if self.popen.stderr is not None:
            self.popen.stderr.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _threads(self) -> Iterator[int]:
        with suppress(FileNotFoundError):
            yield from (int(thread.name) for thread in Path(f"/proc/{self.pid}/task").iterdir())


class Child(Process):
    """A module of this package as a process, which answers each line of JSON with a line of JSON."""

    def __init__(
        self,
        module: str,
        *arguments: str,
        prefix: Sequence[str] = (),
        python: str = sys.executable,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        command = [*prefix, python, "-m", module, *arguments]
        super().__init__(command, environment=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._name = " ".join((module, *arguments))

    def ask(self, do: str, *, limit_s: float = LIMIT_S, **values: object) -> dict[str, Any]:
        """Sends a task and waits for the answer."""
        self.send(do, **values)
        return self.answer(limit_s)

    def send(self, do: str, **values: object) -> None:
        """Sends a task; a call of `answer` must follow."""
        assert self.popen.stdin is not None
        self.popen.stdin.write(json.dumps({"do": do, **values}) + "\n")
        self.popen.stdin.flush()

    def answer(self, limit_s: float = LIMIT_S) -> dict[str, Any]:
        """Waits for the answer and returns it."""
        assert self.popen.stdout is not None
        if not select.select([self.popen.stdout], [], [], limit_s)[0]:
            raise ChildError(f"{self._name} did not answer within {limit_s:g} s")
        line = self.popen.stdout.readline()
        if not line:
            raise ChildError(f"{self._name} ended with status {self.popen.wait(_END_S)}")
        answer: dict[str, Any] = json.loads(line)
        return answer


def processor_s(pid: int) -> float:
    """Returns the processor time of a process so far, of all its threads, including those that have ended."""
    # The clock of another process. Python lacks clock_getcpuclockid(3), which computes the clock's id like this.
    return time.clock_gettime((~pid) << 3 | 2)


def resident_mib(pid: int) -> float:
    """Returns the resident memory of a process."""
    return _memory_mib(pid, "VmRSS")


def _memory_mib(pid: int, row: str) -> float:
    found = re.search(rf"{row}:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
    if found is None:
        raise ChildError(f"process {pid} has no resident memory: it has ended")
    return int(found[1]) / 1024.0


def serve(handle: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    """Runs in the child: answers each line from stdin until stdin ends."""
    for line in sys.stdin:
        print(json.dumps(handle(json.loads(line))), flush=True)


def prefer_this() -> None:
    """Gives this process, and those that it starts, priority over others by a lower niceness, if permitted."""
    with suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, _NICE)


def priority_text() -> str:
    """Returns the priority of the processes, for the report."""
    return (
        "real time (SCHED_FIFO), niceness -15 for starts"
        if _may_be_realtime()
        else "none: the system does not allow real time"
    )


def _may_be_realtime() -> bool:
    return os.geteuid() == 0 or resource.getrlimit(resource.RLIMIT_RTPRIO)[0] >= _REALTIME_PRIORITY


def free_port(kind: int) -> int:
    """Returns a port of this computer that is free now (`socket.SOCK_DGRAM` or `SOCK_STREAM`)."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
