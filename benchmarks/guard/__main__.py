"""Counts instructions of the hot paths and measures resident memory, and compares both with what was recorded.

    python -m benchmarks.guard [--only PART]... [--keep] [--defect NAME]

Exit status 1 where a part executes over 2 % more instructions than recorded, or takes over 1 MiB more. A record that
rises needs a line in ``why.md`` with what it buys. Instructions depend on the version of Python: on another one than
that of the record nothing is compared.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import grpc

from benchmarks.children import free_port
from benchmarks.guard import defects
from benchmarks.guard.callgrind import MissingToolError, begun, counted
from benchmarks.measures.memory import flight_mib
from benchmarks.servers import UalDaemon
from benchmarks.setups import FENCE_FLAGS
from ual.v1 import ual_pb2, ual_pb2_grpc

_RECORD = Path(__file__).with_name("record.json")
_SHARE, _MIB = 0.02, 1.0
_LIMIT_S = 240.0
_PLAIN = "plain send"


class Figure(NamedTuple):
    """A measured figure and its unit: `instructions` or `MiB`."""

    value: float
    unit: str

    def is_over(self, recorded: float) -> bool:
        """Returns whether it is more than what was recorded, by more than the noise."""
        return self.value > recorded + (_MIB if self.unit == "MiB" else _SHARE * recorded)


def _loads(part: str) -> Iterator[tuple[str, Figure]]:
    for name, value in counted("benchmarks.guard.loads", part).items():
        yield name, Figure(value, "instructions")


def _start() -> Iterator[tuple[str, Figure]]:
    port, vehicle_port = free_port(socket.SOCK_STREAM), free_port(socket.SOCK_DGRAM)
    threading.Thread(target=_ask, args=(port,), daemon=True).start()
    with begun("benchmarks.guard.start", str(port), str(vehicle_port), from_start=True) as process:
        for name, value in process.ended().items():
            yield name, Figure(value, "instructions")


def _ask(port: int) -> None:
    """Asks each of the two daemons once it listens; they end before their answers leave."""
    often = [("grpc.use_local_subchannel_pool", 1), ("grpc.max_reconnect_backoff_ms", 200)]
    for _ in range(2):
        with grpc.insecure_channel(f"127.0.0.1:{port}", often) as channel, suppress(grpc.RpcError):
            stub = ual_pb2_grpc.UalServiceStub(channel)
            stub.GetInfo(ual_pb2.GetInfoRequest(), wait_for_ready=True, timeout=_LIMIT_S)


def _memory() -> Iterator[tuple[str, Figure]]:
    """Measures what the daemon has allocated. How many pages of files are resident depends on the computer, too: one
    commit had 3 MiB more on another one.
    """
    run = ("benchmarks.guard.with_defect",)
    for text, flags in (("", ()), (", in a fence", FENCE_FLAGS)):
        yield f"memory after a flight{text}", Figure(flight_mib(UalDaemon.anonymous_mib, *flags, run=run), "MiB")


_PARTS: dict[str, Callable[[], Iterator[tuple[str, Figure]]]] = {
    "class": lambda: _loads("class"),
    "server": lambda: _loads("server"),
    "fleet": lambda: _loads("fleet"),
    "start": _start,
    "memory": _memory,
}


def main() -> int:
    """Measures, compares or records, and returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.guard", description=__doc__)
    parser.add_argument("--only", action="append", choices=_PARTS, help="these parts only; may be given again")
    parser.add_argument("--keep", action="store_true", help="record what is found")
    parser.add_argument("--defect", choices=defects.DEFECTS, help="install a defect that must be found")
    arguments = parser.parse_args()
    os.environ[defects.VARIABLE] = arguments.defect or ""
    version = platform.python_version()
    known: dict[str, Any] = json.loads(_RECORD.read_text()) if _RECORD.exists() else {"python": version}
    is_comparable = known["python"] == version
    recorded: Mapping[str, float] = known.get("figures", {}) if is_comparable else {}
    found: dict[str, Figure] = {}
    try:
        for part in arguments.only or _PARTS:
            began_s = time.monotonic()
            found |= dict(_PARTS[part]())
            print(f"{part}: {time.monotonic() - began_s:.0f} s", file=sys.stderr, flush=True)
    except MissingToolError as error:
        print(error, file=sys.stderr)
        return 2
    print(_table(found, recorded))
    if arguments.keep:
        figures = {**recorded, **{name: round(figure.value, 1) for name, figure in found.items()}}
        record = {"python": version, "figures": dict(sorted(figures.items()))}
        _RECORD.write_text(json.dumps(record, indent=2) + "\n")
        return 0
    if not is_comparable:
        print(f"Recorded on Python {known['python']}, this is {version}: nothing is compared.")
        return 0
    return _verdict(found, recorded)


def _verdict(found: Mapping[str, Figure], recorded: Mapping[str, float]) -> int:
    over = [name for name, figure in found.items() if name in recorded and figure.is_over(recorded[name])]
    new = [name for name in found if name not in recorded]
    for text, names in (("over the record (benchmarks/guard/why.md)", over), ("not recorded yet: --keep", new)):
        if names:
            print(f"{text}: {'; '.join(names)}")
    return int(bool(over or new))


def _table(found: Mapping[str, Figure], recorded: Mapping[str, float]) -> str:
    rows = ["| figure | recorded | now | change | times a plain send |", "|---|---|---|---|---|"]
    plain = found.get(_PLAIN, Figure(recorded.get(_PLAIN, 0.0), "instructions")).value
    for name, figure in found.items():
        last = recorded.get(name)
        is_memory = figure.unit == "MiB"
        was = "–" if last is None else f"{last:,.1f}" if is_memory else f"{last:,.0f}"
        change = "new"
        if last:
            change = f"{figure.value - last:+.2f} MiB" if is_memory else f"{figure.value / last - 1:+.2%}"
        now = f"{figure.value:,.1f} MiB" if is_memory else f"{figure.value:,.0f}"
        times = "" if is_memory or not plain else f"{figure.value / plain:.2f}"
        verdict = " FAIL" if last and figure.is_over(last) else ""
        rows.append(f"| {name} | {was} | {now} | {change}{verdict} | {times} |")
    return "\n".join(rows)


if __name__ == "__main__":
    sys.exit(main())
