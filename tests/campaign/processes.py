"""The processes of a campaign: the simulator, the daemon, the client. Each ends with the campaign."""

from __future__ import annotations

import json
import os
import shlex
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

from tests.campaign.mutants import VARIABLE
from ual import discovery

ROOT = Path(__file__).parents[2]
_LIMIT_S = 60.0


class FlightFailedError(Exception):
    """Something other than UAL failed: the flight says nothing."""


class SimulatorProcess:
    """The simulator, where the campaign itself starts it by `command`."""

    def __init__(self, command: str) -> None:
        self._command = shlex.split(command)
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        self._process = subprocess.Popen(
            self._command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )

    def end(self) -> None:
        if self._process is not None:
            self._process.terminate()  # a shell in the background, and what it starts, ignore SIGINT
            try:
                self._process.wait(10.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process = None


class DaemonProcess:
    """``ual-daemon`` at an address that stays, however often it is killed and started."""

    def __init__(self, mutant: str, flags: tuple[str, ...], folder: Path) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = int(probe.getsockname()[1])
        self.address = f"127.0.0.1:{self.port}"
        module = "tests.campaign.mutants" if mutant else "ual_daemon"
        self._command = [sys.executable, "-m", module, "--ns", "uav_1", "--backend", "mavlink", "--log-format", "json"]
        self._command += ["--listen", self.address, *flags]
        environment = {name: value for name, value in os.environ.items() if not name.startswith("UAL_")}
        self._environment = {**environment, discovery.RUNTIME_DIR_VARIABLE: str(folder / "run")}
        self._environment[VARIABLE] = mutant
        self._log = (folder / "daemon.log").open("ab")
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int:
        """Its process, that has been started."""
        assert self._process is not None
        return self._process.pid

    @property
    def is_running(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def processor_s(self) -> float:
        """Returns the processor time of all its threads so far."""
        return time.clock_gettime((~self.pid) << 3 | 2)  # clock_getcpuclockid(3), which Python lacks

    def start(self) -> None:
        """Returns when it listens."""
        self._process = subprocess.Popen(self._command, cwd=ROOT, env=self._environment, stderr=self._log)
        until_s = time.monotonic() + _LIMIT_S
        while time.monotonic() < until_s and self.is_running:
            try:
                socket.create_connection(("127.0.0.1", self.port), timeout=1.0).close()
            except OSError:
                time.sleep(0.02)
            else:
                return
        raise AssertionError("the daemon does not listen")

    def signal(self, number: signal.Signals) -> None:
        if self.is_running:
            assert self._process is not None
            self._process.send_signal(number)

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def close(self) -> None:
        self.kill()
        self._log.close()


class ClientProcess:
    """One client, which does a step at a time and may be killed in the middle."""

    def __init__(self, address: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.campaign.client", address],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._lock = threading.Lock()
        self.is_busy = False
        self._read()

    def run(self, name: str, values: tuple[float, ...]) -> dict[str, Any]:
        """Does a step; without ``ended_s`` where the client was killed meanwhile."""
        assert self._process.stdin is not None
        sent_s = time.monotonic()
        try:
            self._process.stdin.write(json.dumps({"name": name, "values": values}) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            return {"began_s": sent_s}
        begun = self._read() or {"began_s": sent_s}
        return {**begun, **self._read()}

    def kill(self) -> None:
        self._process.kill()

    def close(self) -> None:
        self._process.kill()
        self._process.communicate()

    def _read(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        found: dict[str, Any] = json.loads(line) if line.endswith("\n") else {}
        return found
