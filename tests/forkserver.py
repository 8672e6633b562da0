"""Starts daemons, and the command `ual`, for an eighth of the processor time: forks them off a process that has
imported UAL.

Each is a process of its own as one that was started: with its words, environment, inputs and outputs, and a child of
the test's process. `python -m tests.forkserver` is the process that is forked. How a daemon starts is tested with those
that are.
"""

from __future__ import annotations

import ctypes
import gc
import importlib.util
import json
import os
import runpy
import select
import signal
import socket
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TextIO

from tests import waiting

_ROOT = Path(__file__).parents[1]
_SET_CHILD_SUBREAPER = 36
_AT_START = ("PYTHON", "GRPC_", "COVERAGE_", "LD_", "LANG", "LC_")
"""Variables with these beginnings count when a process begins: one that has others cannot be forked."""
_SET_BY_PROGRAMS = {"GRPC_VERBOSITY": "NONE", "GRPC_EXPERIMENTS": "-event_engine_listener"}
"""Variables that the programs set where they are missing: one that a test runs in its own process leaves them there."""
_REMOVED = ("PYTHONDONTWRITEBYTECODE",)
"""Variables that tests/conftest.py removes."""
_IMPORTED = (
    "ual._client",
    "ual_daemon.backends.light.backend",
    "ual_daemon.backends.mavlink.backend",
    "ual_daemon.program.configuration_yaml",
    "ual_daemon.program.daemon",
    "ual_daemon.program.entry",
    "ual_daemon.program.fleet",
    "ual_daemon.program.main",
    "ual_daemon.program.recording.audit",
    "ual_daemon.program.recording.recording",
    "ual_daemon.server.transport.aio",
    "ual_daemon.server.transport.core",
    "ual_daemon.server.transport.self_test",
    "ual_daemon.ual",
    "ual_daemon.vehicle.vehicle",
)
"""Modules that import the rest. A daemon and `ual` import them as late as they can: 0.1 s of each fork."""
_MOST_BYTES = 1 << 17
_STDERR = 2


class ForkedProcess:
    """A process that was forked off; used as `subprocess.Popen`."""

    def __init__(self, pid: int, stdout: TextIO | None = None, stderr: TextIO | None = None) -> None:
        self.pid = pid
        self.stdout = stdout
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


class ForkedDaemon(ForkedProcess):
    """A daemon, with its log."""

    stderr: TextIO


def start(flags: Sequence[str], environment: Mapping[str, str]) -> ForkedDaemon:
    """Starts ``python -m ual_daemon`` with these flags."""
    reads, writes = os.pipe()
    with _nothing() as nothing:
        pid = fork_off(
            _server().connection, Request("ual_daemon", list(flags), dict(environment)), nothing, nothing, writes
        )
    os.close(writes)
    return ForkedDaemon(pid, None, os.fdopen(reads))


def start_ual(
    words: Sequence[str],
    environment: Mapping[str, str],
    *,
    stdin: int | None = None,
    stdout: int | None = None,
    stderr: int | None = None,
    before: str = "",
) -> ForkedProcess:
    """Starts ``ual`` with these words; what is left out of the descriptors is the null device.

    `before` is run as Python before the program. A descriptor that is -1 is closed.
    """
    assert can_fork(environment), "this environment counts when Python starts"
    with _nothing() as nothing:
        given = [nothing if each is None or each < 0 else each for each in (stdin, stdout, stderr)]
        closed = [number for number, each in enumerate((stdin, stdout, stderr)) if each is not None and each < 0]
        request = Request("ual", list(words), dict(environment), before, closed)
        return ForkedProcess(fork_off(_server().connection, request, *given))


def run_ual(
    words: Sequence[str], environment: Mapping[str, str], *, stdout: int | None = None
) -> subprocess.CompletedProcess[str]:
    """Runs ``ual`` with these words to its end; `stdout` is a descriptor instead of what is returned, -1: closed."""
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        into = output.fileno() if stdout is None else stdout
        process = start_ual(words, environment, stdout=into, stderr=errors.fileno())
        try:
            status = process.wait(waiting.LIMIT_S)
        finally:
            process.kill()
        output.seek(0)
        errors.seek(0)
        return subprocess.CompletedProcess(words, status, output.read(), errors.read())


@contextmanager
def _nothing() -> Iterator[int]:
    nothing = os.open(os.devnull, os.O_RDWR)
    try:
        yield nothing
    finally:
        os.close(nothing)


class Request(NamedTuple):
    """A process to fork off."""

    program: str
    words: list[str]
    environment: dict[str, str]
    before: str = ""
    closed: Sequence[int] = ()
    directory: str = ""


def fork_off(server: socket.socket, request: Request, *descriptors: int) -> int:
    """Lets the server fork a process with these standard streams; returns its number. It is a child of this one."""
    message = json.dumps(request._replace(directory=str(Path.cwd()))).encode()
    # The one between the two ends at once. The new one is then the child of the next process above that takes orphans.
    _take_orphans(does=True)
    try:
        socket.send_fds(server, [message], descriptors)
        return int(server.recv(_MOST_BYTES))
    finally:
        _take_orphans(does=False)


def can_fork(environment: Mapping[str, str]) -> bool:
    """Returns whether a process with this environment is as one that is forked off this process' server."""
    return sys.platform == "linux" and _of_start(environment) == _of_start(os.environ) == _FIRST_ENVIRONMENT


def _of_start(environment: Mapping[str, str]) -> dict[str, str]:
    return {
        name: value
        for name, value in environment.items()
        if name.startswith(_AT_START) and name not in _REMOVED and _SET_BY_PROGRAMS.get(name) != value
    }


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
        # The first as the daemon sets it before it imports gRPC. numpy would start threads, which a fork does not have.
        env=os.environ | {"GRPC_VERBOSITY": "NONE", "OPENBLAS_NUM_THREADS": "1"},
        pass_fds=[its.fileno()],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )
    its.close()
    return _Server(ours, process)


def close() -> None:
    """Ends this process' server, if it has one."""
    if _server.cache_info().currsize:
        _server().connection.close()
        _server().process.wait()
        _server.cache_clear()


def _take_orphans(*, does: bool) -> None:
    if ctypes.CDLL(None, use_errno=True).prctl(_SET_CHILD_SUBREAPER, int(does), 0, 0, 0):
        raise OSError(ctypes.get_errno(), "prctl")


# --- The server -------------------------------------------------------------------------------------------------------


def serve(connection: socket.socket) -> str:
    """Forks a process for each request; returns its program in each of them, and "" once the other end has closed."""
    while True:
        message, descriptors, _, _ = socket.recv_fds(connection, _MOST_BYTES, 3)
        if not message:
            return ""
        request = Request(*json.loads(message))
        if "view" in request.words and importlib.util.find_spec("viser"):
            importlib.import_module("ual_tools.view.show")  # a third of a second; few processes need it
        pid = _fork()
        if not pid:
            connection.close()
            _become(request, descriptors)
            return request.program
        for each in descriptors:
            os.close(each)
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


def _become(request: Request, descriptors: Sequence[int]) -> None:
    for number, descriptor in enumerate(descriptors):
        os.dup2(descriptor, number)
        os.close(descriptor)
    for number in request.closed:
        os.close(number)
    os.environ.clear()
    os.environ.update(request.environment)
    os.chdir(request.directory)
    sys.argv = ["ual-daemon" if request.program == "ual_daemon" else "-c", *request.words]
    sys.stdin, sys.stdout, sys.stderr = (_stream(number) for number in range(3))
    exec(request.before)


def _stream(number: int) -> Any:
    """Opens a standard stream as Python does when it starts; None where its descriptor is closed."""
    try:
        kind = os.fstat(number).st_mode
    except OSError:
        return None
    is_direct = number == _STDERR or (stat.S_ISCHR(kind) and os.isatty(number))
    errors = "backslashreplace" if number == _STDERR else "strict"
    return open(number, "w" if number else "r", errors=errors, buffering=1 if is_direct else -1, closefd=False)


def _import_all() -> None:
    """Imports what a daemon and `ual` import; none of it starts a thread, which a fork would not have."""
    from ual_daemon.backends.light import painter
    from ual_tools.main import MODULES

    for each in (*_IMPORTED, *(f"ual_tools.{name}" for name in MODULES)):
        importlib.import_module(each)

    painter.PICTURE_TIMEOUT_S, painter._PAINTER_NICENESS = waiting.LIMIT_S, 0  # as `painters_take_their_turn` has it
    # A daemon that looks at all of this for garbage copies it: at its end, that took 0.15 s of the processor.
    gc.collect()
    gc.freeze()
    assert len(list(Path("/proc/self/task").iterdir())) == 1


if __name__ == "__main__":
    _import_all()
    program = serve(socket.socket(fileno=int(sys.argv[1])))
    if program == "ual":
        from ual_tools.main import main

        main()
    elif program:
        runpy.run_module("ual_daemon", run_name="__main__", alter_sys=True)
