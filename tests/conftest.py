"""A daemon as a real process, and a network, for any test: the fixtures `start_daemon`, `daemon` and `net`."""

from __future__ import annotations

import gc
import itertools
import json
import os
import pty
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import grpc
import hypothesis
import pytest
from hypothesis.internal.conjecture import providers

from tests import forkserver, waiting, workers
from tests.repetition import repeats
from ual import discovery

if TYPE_CHECKING:
    from tests.ual.network.zenoh_net import ZenohNet

LIMIT_S = waiting.LIMIT_S
TIMES_TO_BEGIN_S = (0.3, 3.0, 30.0)
"""A caller's time limits that are to pass once the command has begun; a busy machine needs the longer ones."""

# The tests start some hundred processes. Where Python may not keep what it has compiled, each would compile UAL anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# The same examples each time, however busy the machine; `make test-thorough` looks for others, and for longer.
_SLOW = [hypothesis.HealthCheck.too_slow]  # that measures the computer
hypothesis.settings.register_profile(
    "deterministic", derandomize=True, deadline=None, max_examples=40, suppress_health_check=_SLOW
)
hypothesis.settings.register_profile("thorough", deadline=None, max_examples=1000, suppress_health_check=_SLOW)
hypothesis.settings.load_profile(os.environ.get("UAL_TEST_HYPOTHESIS", "deterministic"))
# It would also try the numbers that stand in the modules which are loaded: which those are depends on the tests before.
pytest.MonkeyPatch().setattr(providers, "is_local_module_file", lambda _: False)


_GARBAGE_COUNT = 50_000
"""Objects made between two looks for garbage; Python looks after 700."""


def pytest_collection() -> None:
    """Collects no garbage while tests are collected: to look for it was a third of the time that this takes."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Collects garbage from now on, but not among what lives until the end, and seldom: a tenth of a flight's time."""
    gc.freeze()
    gc.set_threshold(_GARBAGE_COUNT)
    gc.enable()


@pytest.hookimpl(tryfirst=True)  # before what is deselected by its marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks what repeats another test, and runs the slow tests first: at the end, one of them would be waited for while
    other workers have nothing to do.
    """
    for item in items:
        if repeats(item):
            item.add_marker("repetition")
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


def pytest_xdist_setupnodes(config: pytest.Config, specs: list[Any]) -> None:
    """Lets all workers share one collection."""
    workers.fork_workers(config, specs)


def pytest_sessionstart() -> None:
    """Lets a test fail as soon as one of its threads has died, and not when it has waited in vain."""
    waiting.fail_waits_of_the_dead()


def pytest_sessionfinish() -> None:
    """Ends the process off which daemons were forked."""
    forkserver.close()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    """Forgets the threads of the test before."""
    waiting.forget_the_dead()


_DESCRIPTORS = "/proc/self/fd/"


def _open_files() -> set[str]:
    """The files and sockets of this process, each as what it is."""
    found = set()
    for name in os.listdir(_DESCRIPTORS):  # noqa: PTH208  paths take twice as long, four times a test
        with suppress(OSError):  # that of the list itself
            found.add(f"{name} {os.readlink(_DESCRIPTORS + name)}")  # noqa: PTH115  as above
    return found


def _closing(before_it: Callable[[], None] = lambda: None) -> Iterator[None]:
    before = _open_files()
    yield
    if _open_files() - before:
        before_it()
        gc.collect()
        gc.freeze()  # the next look is for what is new: among all that lives it took up to 0.3 s


@pytest.fixture(autouse=True)
def closed_at_the_end() -> Iterator[None]:
    """Finds what a test leaves open, at its end. Python tells of it when it is collected: else during another test.

    Ends after all other fixtures of the test. What fixtures of a wider scope hold open is not garbage.
    """
    yield from _closing()


@pytest.fixture(scope="module", autouse=True)
def closed_with_the_module() -> Iterator[None]:
    """Finds what the fixtures of a module leave open, too, at the end of its last test."""
    yield from _closing(gc.unfreeze)


@pytest.fixture(scope="session", autouse=True)
def no_standstill_of_these_processes() -> Iterator[None]:
    """Takes no standstill of a test's own process for one of a daemon: on a busy machine its threads wait for seconds.

    What a daemon does after one is tested by clocks that tests set (tests/ual_daemon/server/test_standstill.py).
    """
    served = sys.modules.get("ual_daemon.server.calls")
    with pytest.MonkeyPatch.context() as patch:
        if served is not None:  # its clock stands, and costs no call of Python: calls are counted in tests/work
            patch.setattr(served, "Standstill", partial(served.Standstill, itertools.repeat(0.0).__next__))
        yield


@pytest.fixture(scope="session", autouse=True)
def painters_take_their_turn() -> Iterator[None]:
    """Lets painters of a test's own process compete with other tests. They yield to all that flies otherwise: at a load
    of 12 one had not begun after 15 s, when it is killed as stuck.
    """
    painter = sys.modules.get("ual_daemon.backends.light.painter")
    with pytest.MonkeyPatch.context() as patch:
        if painter is not None:
            patch.setattr(painter, "PICTURE_TIMEOUT_S", LIMIT_S)
            patch.setattr(painter, "_PAINTER_NICENESS", 0)
        yield


_STAYS = ("listening", "metrics")
"""Lines that a daemon logs once and that stay valid: to wait for one again is no mistake."""


class DaemonProcess:
    """One ``ual-daemon`` process; its log, one JSON object a line, tells tests what it does."""

    may_be_forked = True
    """Whether it may be forked off a process that has imported UAL, which is quicker: see `started_daemons`."""

    def __init__(
        self, flags: tuple[str, ...], ns: str, environment: dict[str, str], module: str = "ual_daemon"
    ) -> None:
        self.ns = ns
        self.events: list[dict[str, Any]] = []
        self.stderr = ""
        self._changed = threading.Condition()
        self._has_ended = False
        self._told: list[dict[str, Any]] = []
        self._resources = ExitStack()
        self.process = self._start((*("--ns", ns, "--log-format", "json"), *flags), environment, module)
        self._reader = threading.Thread(target=self._read, name=f"log of {ns}", daemon=True)
        self._reader.start()

    def _start(
        self, flags: tuple[str, ...], environment: dict[str, str], module: str
    ) -> subprocess.Popen[str] | forkserver.ForkedDaemon:
        if self.may_be_forked and module == "ual_daemon" and forkserver.can_fork(environment):
            return forkserver.start(flags, environment)
        return subprocess.Popen(
            [sys.executable, "-m", module, *flags],
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )

    @property
    def pid(self) -> int:
        return self.process.pid

    @property
    def address(self) -> str:
        """First address of the daemon, once it listens."""
        return str(self.wait_for("listening")["addresses"]).split()[0]

    def wait_for(self, event: str, after: dict[str, Any] | None = None, **fields: object) -> dict[str, Any]:
        """The first such event in its log; the first since the event `after`.

        Fails where it has told of this event before: it would wait for nothing.
        """
        found = self._find(event, after, fields)
        if after is None and event not in _STAYS:
            assert not any(each is found for each in self._told), (
                f"{event} {fields} was there already: after which event?"
            )
            self._told.append(found)
        return found

    def _find(self, event: str, after: dict[str, Any] | None, fields: dict[str, object]) -> dict[str, Any]:
        deadline_s = time.monotonic() + LIMIT_S
        with self._changed:
            while True:
                since = 0 if after is None else self.events.index(after) + 1
                for found in self.events[since:]:
                    if found.get("event") == event and fields.items() <= found.items():
                        return found
                left_s = deadline_s - time.monotonic()
                if left_s <= 0.0 or self._has_ended:
                    raise AssertionError(f"no {event} {fields} in the log:\n{self.stderr}")
                self._changed.wait(left_s)

    def give_up_begun(self, command: str, call: Callable[[float], object]) -> None:
        """Calls with a time limit that passes, with longer ones until the command had begun by then."""
        for limit_s in TIMES_TO_BEGIN_S:
            call(limit_s)
            if any(event.get("command") == command for event in self.events):
                return
        raise AssertionError(f"{command} never began in time:\n{self.stderr}")

    def channel(self) -> grpc.Channel:
        """A channel of its own, closed with the daemon."""
        return self._resources.enter_context(grpc.insecure_channel(self.address))

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    @contextmanager
    def frozen(self) -> Iterator[None]:
        """It does nothing until the end of the block."""
        self.signal(signal.SIGSTOP)
        # A signal is sent at once, but on a busy machine the daemon could still answer a call before it stops.
        change = os.waitid(os.P_PID, self.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)
        assert change is not None
        assert change.si_code == os.CLD_STOPPED
        try:
            yield
        finally:
            self.signal(signal.SIGCONT)

    def wait(self) -> int:
        """Its exit status, once it has ended."""
        status = self.process.wait(LIMIT_S)
        self._reader.join(LIMIT_S)
        return status

    def close(self) -> None:
        self._resources.close()
        self.process.kill()
        self.wait()
        assert self.process.stderr is not None
        self.process.stderr.close()

    def _read(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            with self._changed:
                self.stderr += line
                if line.startswith("{"):
                    self.events.append(json.loads(line))
                self._changed.notify_all()
        with self._changed:
            self._has_ended = True
            self._changed.notify_all()


def daemon_environment(runtime_dir: Path) -> dict[str, str]:
    """Returns the environment of this process without its settings of UAL, for daemons that register in the
    directory.
    """
    environment = {name: value for name, value in os.environ.items() if not name.startswith("UAL_")}
    return {**environment, discovery.RUNTIME_DIR_VARIABLE: str(runtime_dir)}


def open_terminal() -> tuple[int, int]:
    """Both ends of a pseudo-terminal. Skips the test where there are none: a chroot or container without /dev/pts."""
    try:
        return pty.openpty()
    except OSError:
        pytest.skip("NO PSEUDO-TERMINALS, what needs one is NOT TESTED: mount -t devpts devpts /dev/pts")


StartDaemon = Callable[..., DaemonProcess]


@pytest.fixture
def runtime_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The directory in which this test's daemons, and nobody else's, register."""
    path = tmp_path / "ual"
    monkeypatch.setenv(discovery.RUNTIME_DIR_VARIABLE, str(path))
    return path


@pytest.fixture
def started_daemons(monkeypatch: pytest.MonkeyPatch) -> None:
    """Starts daemons as users do: for tests of how they start, and with which signals, modules and memory."""
    monkeypatch.setattr(DaemonProcess, "may_be_forked", False)


@pytest.fixture
def start_daemon(runtime_dir: Path) -> Iterator[StartDaemon]:
    """Starts daemons: ``start_daemon("--auto-arm", ns="uav_2", backend="light", listen="127.0.0.1:0")``."""
    environment = daemon_environment(runtime_dir)
    started: list[DaemonProcess] = []

    def start(
        *flags: str,
        ns: str = "uav_1",
        backend: str = "light",
        listen: str | None = "127.0.0.1:0",
        module: str = "ual_daemon",
    ) -> DaemonProcess:
        where = () if listen is None else ("--listen", listen)
        started.append(DaemonProcess(("--backend", backend, *where, *flags), ns, environment, module))
        return started[-1]

    yield start
    for each in started:
        each.close()


@pytest.fixture
def daemon(start_daemon: StartDaemon) -> DaemonProcess:
    """A light UAV, uav_1, ten times as fast as real, armed by its simulated safety pilot; it listens already."""
    started = start_daemon("--auto-arm", "--set", "light.speed_factor=10")
    started.wait_for("listening")
    return started


@pytest.fixture
def net(tmp_path: Path) -> Iterator[ZenohNet]:
    """A network of this test's own, without a router yet; for modules that are skipped where Zenoh is missing."""
    from tests.ual.network.zenoh_net import ZenohNet

    with ExitStack() as stack:
        yield ZenohNet(tmp_path, stack)
