"""Starts daemons for an eighth of the processor time: forks them off a process that has imported UAL.

Each is a process of its own as one that was started: with its flags, environment and log, and a child of the test's
process. `python -m tests.forkserver` is the process that is forked. How a daemon starts is tested with those that are.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple, TextIO

from tests import waiting

_ROOT = Path(__file__).parents[1]
_SET_CHILD_SUBREAPER = 36
_AT_START = ("PYTHON", "GRPC_", "COVERAGE_", "LD_")
"""Variables with these beginnings count when a process begins: one that has others cannot be forked."""
_MOST_BYTES = 1 << 17


class ForkedProcess:
    """A daemon that was forked off; used as `subprocess.Popen`."""

    def __init__(self, pid: int, stderr: TextIO) -> None:
        self.pid = pid
        self.stderr = stderr
        self.returncode: int | None = None
        self._ends = os.pidfd_open(pid)

    def send_signal(self, number: int) -> None:
        """Sends a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Ends it at once."""
        self.send_signal(signal.SIGKILL)

    def poll(self) -> int | None:
        """Returns its exit status, if it has ended."""
        try:
            return self.wait(0.0)
        except subprocess.TimeoutExpired:
            return None

    def wait(self, timeout: float | None = None) -> int:
        """Returns its exit status, once it has ended."""
        if self.returncode is None:
            if not select.select([self._ends], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired("ual-daemon", timeout or 0.0)
            self.returncode = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
            os.close(self._ends)
        return self.returncode


def start(flags: Sequence[str], environment: Mapping[str, str]) -> ForkedProcess:
    """Starts ``python -m ual_daemon`` with these flags."""
    reads, writes = os.pipe()
    request = json.dumps([list(flags), dict(environment), str(Path.cwd())]).encode()
    server = _server().connection
    # The one between the two ends at once. The daemon is then the child of the next process above that takes orphans.
    _take_orphans(does=True)
    try:
        socket.send_fds(server, [request], [writes])
        pid = int(server.recv(_MOST_BYTES))
    finally:
        _take_orphans(does=False)
        os.close(writes)
    return ForkedProcess(pid, os.fdopen(reads))


def can_fork(environment: Mapping[str, str]) -> bool:
    """Returns whether a daemon with this environment is as one that is forked off this process' server."""
    return sys.platform == "linux" and _of_start(environment) == _of_start(os.environ) == _FIRST_ENVIRONMENT


def _of_start(environment: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in environment.items() if name.startswith(_AT_START)}


_FIRST_ENVIRONMENT = _of_start(os.environ)
"""Environment of this process, before any test has changed it."""


class _Server(NamedTuple):
    """This process' server, which ends when the connection does."""

    connection: socket.socket
    process: subprocess.Popen[bytes]


@cache
def _server() -> _Server:
    ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    command = [sys.executable, "-m", "tests.forkserver", str(its.fileno())]
    process = subprocess.Popen(
        command,
        cwd=_ROOT,
        env=os.environ | {"GRPC_VERBOSITY": "NONE"},  # as the daemon sets it before it imports gRPC
        pass_fds=[its.fileno()],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )
    its.close()
    return _Server(ours, process)


def _take_orphans(*, does: bool) -> None:
    if ctypes.CDLL(None, use_errno=True).prctl(_SET_CHILD_SUBREAPER, int(does), 0, 0, 0):
        raise OSError(ctypes.get_errno(), "prctl")


# --- The server -------------------------------------------------------------------------------------------------------


def serve(connection: socket.socket) -> None:
    """Forks a daemon for each request, until the test's process ends. Returns in each daemon."""
    while True:
        request, descriptors, _, _ = socket.recv_fds(connection, _MOST_BYTES, 1)
        if not request:
            sys.exit()
        pid = _fork()
        if not pid:
            connection.close()
            return _become(*json.loads(request), *descriptors)
        os.close(*descriptors)
        connection.send(str(pid).encode())


def _fork() -> int:
    """Forks a process that is nobody's child; returns its number, and 0 in it."""
    reads, writes = os.pipe()
    between = os.fork()
    if not between:
        if pid := os.fork():
            os.write(writes, str(pid).encode())
            os._exit(0)
        os.close(reads)
        os.close(writes)
        return 0
    os.waitpid(between, 0)
    with os.fdopen(reads) as told:
        os.close(writes)
        return int(told.read())


def _become(flags: list[str], environment: dict[str, str], directory: str, stderr: int) -> None:
    os.dup2(stderr, 2)
    os.close(stderr)
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(directory)
    sys.argv = ["ual-daemon", *flags]


def _import_all() -> None:
    """Imports what a daemon imports; none of it starts a thread, which a fork would not have."""
    import ual_daemon.backends.light
    import ual_daemon.backends.mavlink
    import ual_daemon.program.daemon
    import ual_daemon.program.main  # noqa: F401 - imported for those that are forked off
    from ual_daemon.backends.light import painter

    painter.PATIENCE_S, painter._NICENESS = waiting.LIMIT_S, 0  # as `painters_take_their_turn` has it
    # A daemon that looks at all of this for garbage copies it: at its end, that took 0.15 s of the processor.
    gc.collect()
    gc.freeze()
    assert len(list(Path("/proc/self/task").iterdir())) == 1


if __name__ == "__main__":
    _import_all()
    serve(socket.socket(fileno=int(sys.argv[1])))
    runpy.run_module("ual_daemon", run_name="__main__", alter_sys=True)
