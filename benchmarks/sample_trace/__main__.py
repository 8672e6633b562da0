"""Traces samples in a process and through the server, and prints a table for each.

    python -m benchmarks.sample_trace [--seconds 10]

The Python calls are counted in a second run, because counting makes all slow.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import socket
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.children import LIMIT_S, Child, ChildError, Process, free_port, prefer_this, priority_text
from benchmarks.sample_trace.stamps import Stamp
from benchmarks.sample_trace.stations import SENT
from benchmarks.sample_trace.table import markdown
from benchmarks.servers import UalDaemon
from benchmarks.setups import CLASS, STREAM, ClientSetup

Trace = dict[int, dict[str, Stamp]]
_TRACED = "benchmarks.sample_trace.traced"
_SETTLE_S = 1.0
_NS = 1e9


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sample_trace", description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="how long each way is traced [10]")
    seconds: float = parser.parse_args().seconds
    prefer_this()
    print(f"Priority: {priority_text()}.\n")
    with tempfile.TemporaryDirectory(prefix="ual-trace-") as directory, Child("benchmarks.vehicle") as vehicle:
        vehicle.prefer()
        for way in (CLASS, STREAM):
            times, calls = (trace(vehicle, way, Path(directory), what, seconds) for what in ("times", "calls"))
            print(markdown(way.name, times, calls), "\n")


def trace(vehicle: Child, way: ClientSetup, directory: Path, what: str, seconds: float) -> Trace:
    """Returns the stamps of the samples of some seconds: the times, or the calls between them."""
    with _traced(vehicle, way, directory, what) as processes:
        for process in processes.values():
            process.prefer()
        vehicle.ask("positions")
        _client(processes).ask("listen", subscribers_count=1, duration_s=_SETTLE_S + seconds)
        gone: dict[int, int] = dict(vehicle.ask("positions")["gone"])
        stamps = [_taken(file, process) for file, process in processes.items()]
    begin_ns = min(gone.values()) + round(_SETTLE_S * _NS)
    return {
        number: {SENT: (at_ns, 0)} | {name: stamp for each in stamps for name, stamp in each.get(number, {}).items()}
        for number, at_ns in gone.items()
        if at_ns > begin_ns
    }


@contextmanager
def _traced(vehicle: Child, way: ClientSetup, directory: Path, what: str) -> Iterator[dict[Path, Process]]:
    """Provides the processes of a way that flies the vehicle, by the files for their stamps; the program is last."""
    port = free_port(socket.SOCK_DGRAM)
    vehicle.ask("fly", port=port)
    try:
        if way.address:
            file = directory / "daemon.json"
            with UalDaemon(port, run=(_TRACED, str(file), what, "daemon", "ual_daemon")) as server:
                server.wait()
                with _program(way, port, server.addresses[way.address], directory, what) as program:
                    yield {file: server, **program}
        else:
            with _program(way, port, "", directory, what) as program:
                yield program
    finally:
        vehicle.ask("rest")


@contextmanager
def _program(way: ClientSetup, port: int, address: str, directory: Path, what: str) -> Iterator[dict[Path, Process]]:
    file = directory / "program.json"
    kind = "client" if way.address else "class"
    arguments = (way.peer, "--port", str(port), "--address", address)
    with Child(_TRACED, str(file), what, kind, "benchmarks.peers", *arguments) as client:
        client.ask("connect")
        yield {file: client}


def _client(processes: dict[Path, Process]) -> Child:
    client = list(processes.values())[-1]
    assert isinstance(client, Child)
    return client


def _taken(file: Path, process: Process) -> Trace:
    """Returns what a process has stamped."""
    os.kill(process.pid, signal.SIGUSR1)
    deadline_s = time.monotonic() + LIMIT_S
    while not file.exists():
        if time.monotonic() > deadline_s:
            raise ChildError(f"process {process.pid} has written no stamps within {LIMIT_S:g} s")
        time.sleep(0.01)
    stamps = {int(number): row for number, row in json.loads(file.read_text()).items()}
    file.unlink()
    return stamps


if __name__ == "__main__":
    main()
