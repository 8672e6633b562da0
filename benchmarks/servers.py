"""The servers that are compared. Each is started for one vehicle's UDP port."""

from __future__ import annotations

import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from benchmarks.children import LIMIT_S, ChildError, Process, free_port


class UalDaemon(Process):
    """``ual-daemon`` over MAVLink, on a TCP port and a unix socket. `run` is the module, and its first arguments."""

    def __init__(self, port: int | None, *arguments: str, run: Sequence[str] = ("ual_daemon",)) -> None:
        self._directory = tempfile.TemporaryDirectory(prefix="ual-bench-")
        self._log = tempfile.TemporaryFile(dir=self._directory.name)  # noqa: SIM115  closed in close
        unix = f"unix:{self._directory.name}/uav_1.sock"
        self.tcp_port = free_port(socket.SOCK_STREAM)
        backend = ["--backend", "light"] if port is None else ["--backend", "mavlink", "--url", udp_url(port)]
        super().__init__(
            [
                *(sys.executable, "-m", *run, "--ns", "uav_1", *backend),
                *("--listen", f"127.0.0.1:{self.tcp_port}", "--listen", unix, *arguments),
            ],
            environment={"UAL_RUNTIME_DIR": self._directory.name},
            stderr=self._log,
        )
        self.addresses = {"tcp": f"127.0.0.1:{self.tcp_port}", "unix": unix}

    def wait(self) -> None:
        """Returns once it listens."""
        wait_for_port(self.tcp_port, self)

    def log_text(self) -> str:
        """Returns its log."""
        self._log.seek(0)
        return self._log.read().decode()

    def close(self) -> None:
        # A terminated daemon would wait until the UAV is safe, but the vehicle of a benchmark never stops flying.
        self.popen.kill()
        super().close()
        self._log.close()
        self._directory.cleanup()


class MavsdkServer(Process):
    """MAVSDK's server, from the package `mavsdk-grpc`. It has no option to listen on loopback only."""

    def __init__(self, port: int) -> None:
        self.tcp_port = free_port(socket.SOCK_STREAM)
        super().__init__([str(_mavsdk_server()), "-p", str(self.tcp_port), udp_url(port)], stderr=subprocess.DEVNULL)
        self.addresses = {"tcp": f"127.0.0.1:{self.tcp_port}"}

    def wait(self) -> None:
        """Returns once its port is open. It opens the port when it has found the vehicle."""
        wait_for_port(self.tcp_port, self)


class BareServer(Process):
    """gRPC alone: `benchmarks.bare`."""

    def __init__(self, port: int) -> None:
        self.tcp_port = free_port(socket.SOCK_STREAM)
        self.addresses = {"tcp": f"127.0.0.1:{self.tcp_port}"}
        super().__init__([sys.executable, "-m", "benchmarks.bare", str(port), self.addresses["tcp"]])

    def wait(self) -> None:
        """Returns once its port is open. It opens the port at the vehicle's first message."""
        wait_for_port(self.tcp_port, self)

    def close(self) -> None:
        self.popen.kill()
        super().close()


def udp_url(port: int) -> str:
    """Returns the URL for listening to the vehicle, which is the same for both servers."""
    return f"udpin://127.0.0.1:{port}"


def wait_for_port(port: int, process: Process) -> float:
    """Blocks until a TCP port of this computer is open. Returns when that was (monotonic clock)."""
    deadline_s = time.monotonic() + LIMIT_S
    while time.monotonic() < deadline_s:
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return time.monotonic()
        if process.popen.poll() is not None:
            raise ChildError(f"the server ended with status {process.popen.poll()} before its port {port} was open")
        time.sleep(0.001)
    raise ChildError(f"port {port} is not open after {LIMIT_S:g} s")


def _mavsdk_server() -> Path:
    spec = find_spec("mavsdk_grpc")
    if spec is None or spec.origin is None:
        raise ChildError("mavsdk-grpc is not installed")
    return Path(spec.origin).parent / "bin" / "mavsdk_server"
