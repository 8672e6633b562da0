"""Measures the start of a server until its first answer, with and without a vehicle; imports and ``--help``."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from pathlib import Path

import grpc
from grpc_health.v1 import health_pb2, health_pb2_grpc

from benchmarks.children import REPOSITORY, Child, free_port
from benchmarks.results import Results
from benchmarks.servers import MavsdkServer, UalDaemon, wait_for_port
from benchmarks.setups import MAVSDK_GRPC

IMPORTS = {
    "python": ("-c", "pass"),
    "import ual": ("-c", "import ual"),
    "import ual._client": ("-c", "import ual._client"),
    "import ual_daemon.ual": ("-c", "import ual_daemon.ual"),
    "import mavsdk_grpc": ("-c", "import mavsdk_grpc"),
    "import mavsdk": ("-c", "import mavsdk"),
}


def measure_servers(vehicle: Child, results: Results) -> None:
    """Measures one round of starts, in seconds."""
    for is_there in (True, False):
        port = free_port(socket.SOCK_DGRAM)
        if is_there:
            vehicle.ask("fly", port=port)
        with UalDaemon(port) as daemon:
            wait_for_port(daemon.tcp_port, daemon)
            with grpc.insecure_channel(daemon.addresses["tcp"]) as channel:
                health_pb2_grpc.HealthStub(channel).Check(  # type: ignore[attr-defined]  # the stubs lack what is made when it is
                    health_pb2.HealthCheckRequest(), wait_for_ready=True
                )
            text = "with" if is_there else "without"
            results.add("start_s", f"UAL, {text} an autopilot", [time.monotonic() - daemon.started_s])
        vehicle.ask("rest")
    if not MAVSDK_GRPC.is_missing:
        port = free_port(socket.SOCK_DGRAM)
        vehicle.ask("fly", port=port)
        with MavsdkServer(port) as server:
            opened_s = wait_for_port(server.tcp_port, server)
            results.add("start_s", "mavsdk-grpc, with an autopilot (its port)", [opened_s - server.started_s])
        vehicle.ask("rest")


def measure_imports(results: Results) -> None:
    """Measures one round of imports and of ``--help``, in ms, each in a new process."""
    for name, arguments in IMPORTS.items():
        if (
            "mavsdk" in name
            and subprocess.run([sys.executable, *arguments], cwd="/", stderr=subprocess.DEVNULL, check=False).returncode
        ):
            continue
        results.add("import_ms", name, [_took_ms([sys.executable, *arguments])])
    for program in ("ual", "ual-daemon"):
        results.add(
            "import_ms", f"{program} --help", [_took_ms([str(Path(sys.executable).parent / program), "--help"])]
        )


def _took_ms(command: list[str]) -> float:
    began_s = time.monotonic()
    subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.DEVNULL, check=True)
    return (time.monotonic() - began_s) * 1000.0
