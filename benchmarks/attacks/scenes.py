"""Attacked scene: a server with a flying UAV, a program that flies it, and one that reads its telemetry."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from abc import ABC, abstractmethod
from contextlib import ExitStack
from dataclasses import dataclass, field
from types import TracebackType

from typing_extensions import Self, override

from benchmarks.attacks import figures
from benchmarks.attacks.figures import AttackFigures
from benchmarks.children import Child, Process, free_port
from benchmarks.servers import udp_url, wait_for_port

_SETTLE_S = 1.5
_END_LIMIT_S = 40.0
_DEFECT = re.compile(r"Traceback|\bdefect\b|failed unexpectedly")


class AttackScene(ABC):
    """One server with its UAV, for the time of the block. The processes around it are preferred by the system.

    In reality they run on other computers: their lateness would be none of the server's.
    """

    name: str
    is_plain = False

    def __init__(self) -> None:
        self._resources = ExitStack()
        self._directory = self._resources.enter_context(tempfile.TemporaryDirectory(prefix="ual-attacks-"))
        self._log = self._resources.enter_context(tempfile.TemporaryFile(dir=self._directory))  # noqa: SIM115
        self.port = free_port(socket.SOCK_STREAM)
        self.autopilot = self._resources.enter_context(Child("benchmarks.attacks.autopilot"))
        self._begin_autopilot()
        environment = {"UAL_RUNTIME_DIR": self._directory, **self._environment()}
        self.server = self._resources.enter_context(
            Process([sys.executable, "-m", *self._command()], environment=environment, stderr=self._log)
        )
        wait_for_port(self.port, self.server)
        flags = (self.address, *(["--plain"] if self.is_plain else []))
        self._pilot = self._resources.enter_context(Child("benchmarks.attacks.clients", *flags))
        self._reader = self._resources.enter_context(Child("benchmarks.attacks.clients", *flags))
        for process in (self.autopilot, self._pilot, self._reader):
            process.prefer()
        self._pilot.ask("fly", limit_s=120.0)
        self._reader.ask("listen")
        time.sleep(_SETTLE_S)

    @property
    def address(self) -> str:
        """Address of the server."""
        return f"127.0.0.1:{self.port}"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self.server.popen.poll() is None:
            self.server.popen.kill()
        self._resources.close()

    def begin(self) -> None:
        """Begins to measure."""
        for child, task in ((self.autopilot, "setpoints"), (self._pilot, "take"), (self._reader, "take")):
            child.ask(task)
        self._began_ns = time.monotonic_ns()

    def measure(self, count: float = 0.0) -> AttackMeasurement:
        """Returns what was measured since `begin`."""
        ended_ns = time.monotonic_ns()
        came = [(number, came_ns) for number, came_ns in self.autopilot.ask("setpoints")["came"]]
        flown, read = self._pilot.ask("take"), self._reader.ask("take")
        return AttackMeasurement(
            figures.of_stream([came_ns for _, came_ns in came], self._began_ns, ended_ns),
            figures.of_calls([(number, due_ns) for number, due_ns in flown["due"]], came),
            figures.gap_ms(read["samples"], self._began_ns, ended_ns),
            (ended_ns - self._began_ns) / 1e9,
            flown["errors"],
        )

    def end(self) -> float | None:
        """Sends SIGTERM. Returns how long the server took to end; `_END_LIMIT_S` where it did not."""
        began_s = time.monotonic()
        self.server.popen.send_signal(signal.SIGTERM)
        try:
            self.server.popen.wait(_END_LIMIT_S)
        except subprocess.TimeoutExpired:
            return _END_LIMIT_S
        return time.monotonic() - began_s

    def defects(self) -> tuple[str, ...]:
        """Returns the lines of the server's log that tell of a defect."""
        self._log.seek(0)
        return tuple(line for line in self._log.read().decode(errors="replace").splitlines() if _DEFECT.search(line))

    def _environment(self) -> dict[str, str]:
        return {}

    @abstractmethod
    def _begin_autopilot(self) -> None: ...

    @abstractmethod
    def _command(self) -> list[str]: ...


@dataclass(frozen=True)
class AttackMeasurement:
    """See `AttackFigures`; and what the flying program was answered."""

    setpoints: figures.Lateness
    calls: figures.Lateness
    gap_ms: float
    duration_s: float
    errors: dict[str, int] = field(default_factory=dict)

    def figures(self, end_s: float | None, acts_count: float, defects: tuple[str, ...]) -> AttackFigures:
        return AttackFigures(self.setpoints, self.calls, self.gap_ms, end_s, acts_count, defects)


class LightScene(AttackScene):
    """The light backend; setpoints are noted where it gets them (`noted`)."""

    name = "light"
    flags: tuple[str, ...] = ()

    @override
    def _begin_autopilot(self) -> None:
        self._sink: int = self.autopilot.ask("sink")["port"]

    @override
    def _environment(self) -> dict[str, str]:
        return {"UAL_TEST_NOTED_PORT": str(self._sink)}

    @override
    def _command(self) -> list[str]:
        listen = ("--ns", "uav_1", "--allow-arming", "--listen", self.address)
        return ["benchmarks.attacks.noted", "--backend", "noted", *listen, *_flags()]


class MavlinkScene(AttackScene):
    """The mavlink backend and the PX4-like test autopilot; setpoints are noted at the autopilot's socket."""

    name = "mavlink"

    @override
    def _begin_autopilot(self) -> None:
        self.link_port = free_port(socket.SOCK_DGRAM)
        self.autopilot.ask("px4", port=self.link_port)

    @override
    def _command(self) -> list[str]:
        listen = ("--ns", "uav_1", "--allow-arming", "--listen", self.address)
        return ["ual_daemon", "--backend", "mavlink", "--url", udp_url(self.link_port), *listen, *_flags()]


class PlainScene(AttackScene):
    """A plain grpcio server (`plain`)."""

    name = "plain grpcio"
    is_plain = True

    @override
    def _begin_autopilot(self) -> None:
        self._sink: int = self.autopilot.ask("sink")["port"]

    @override
    def _command(self) -> list[str]:
        return ["benchmarks.attacks.plain", str(self.port), str(self._sink)]

    @override
    def end(self) -> float | None:
        return None


def _flags() -> list[str]:
    return os.environ.get("UAL_TEST_ATTACKS_FLAGS", "").split()


SCENES: dict[str, type[AttackScene]] = {
    scene.name.split(maxsplit=1)[0]: scene for scene in (LightScene, MavlinkScene, PlainScene)
}
