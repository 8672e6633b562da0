"""Soaks two daemons: ``python -m benchmarks.soak --minutes 120``. Exit status 1 where memory grew or a daemon failed.

Writes each reading to ``soak.csv`` and the verdicts and counts to ``soak.json`` (see ``--out``).
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import socket
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path

from benchmarks.children import REPOSITORY, Child, Process, free_port
from benchmarks.servers import UalDaemon
from benchmarks.soak.readings import ProcessReading, judge, read
from tests.simulators.process import autopilot_process

_PERIOD_S = 5.0
_LINE_S = 60.0
_CALLERS_COUNT = 2
_ENDURANCE_S = 10_000_000
_DEFECT = re.compile(r"Traceback|\bdefect\b|failed unexpectedly|\bERROR\b")

Readings = dict[str, list[ProcessReading]]


def main() -> int:
    """Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=120.0)
    parser.add_argument("--out", type=Path, default=REPOSITORY / "build" / "bench", metavar="FOLDER")
    parser.add_argument("--transport", default="auto", choices=("auto", "core", "aio"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    with ExitStack() as resources:
        daemons = _start(resources, "--allow-arming", "--transport", arguments.transport)
        addresses = {daemon.addresses["tcp"]: name for name, daemon in daemons.items()}
        callers = resources.enter_context(Child("benchmarks.soak.callers", *addresses))
        readings: Readings = {name: [] for name in (*daemons, "callers")}
        with (arguments.out / "soak.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(("process", *ProcessReading._fields))
            for name, reading in _soak({**daemons, "callers": callers}, arguments.minutes * 60.0):
                readings[name].append(reading)
                writer.writerow((name, *reading))
                file.flush()
        answer = callers.ask("counts")
        counts = {addresses[address]: found for address, found in answer["counts"].items()}
        is_good = answer["alive"] == len(daemons) * _CALLERS_COUNT
        verdicts = {name: judge(readings[name]) for name in daemons}
        defects = {name: _defects(daemon) for name, daemon in daemons.items()}
    for name, verdict in verdicts.items():
        print(f"{name}: {verdict.text}")
        print(f"{name}: {json.dumps(counts[name])}")
        print(f"{name}: {len(defects[name])} lines of its log tell of a defect", *defects[name][:20], sep="\n  ")
        is_good = is_good and verdict.is_flat and not defects[name]
    result = {"verdicts": {name: verdict.text for name, verdict in verdicts.items()}, "counts": counts}
    (arguments.out / "soak.json").write_text(json.dumps({"pass": is_good, **result, "defects": defects}, indent=1))
    print("PASS" if is_good else "FAIL")
    return int(not is_good)


def _start(resources: ExitStack, *flags: str) -> dict[str, UalDaemon]:
    port = free_port(socket.SOCK_DGRAM)
    resources.enter_context(autopilot_process("px4", "--udp", str(port)))
    endless = ("--set", f"light.battery_endurance_s={_ENDURANCE_S}")  # an empty battery would end the flights
    daemons = {
        "light": resources.enter_context(UalDaemon(None, *flags, *endless)),
        "mavlink": resources.enter_context(UalDaemon(port, *flags)),
    }
    for daemon in daemons.values():
        daemon.wait()
    return daemons


def _soak(processes: Mapping[str, Process], duration_s: float) -> Iterator[tuple[str, ProcessReading]]:
    """Yields a reading of each process again and again, and prints a line each minute."""
    began_s = time.monotonic()
    next_line_s = _LINE_S
    while (at_s := time.monotonic() - began_s) < duration_s:
        newest = {name: read(process, at_s) for name, process in processes.items()}
        yield from newest.items()
        if at_s >= next_line_s:
            next_line_s += _LINE_S
            print(f"{at_s / 60.0:6.1f} min", *(_row(name, newest[name]) for name in newest), sep="   ", flush=True)
        time.sleep(_PERIOD_S)


def _row(name: str, reading: ProcessReading) -> str:
    return (
        f"{name} {reading.resident_mib:.2f} MiB ({reading.anonymous_mib:.2f}) {reading.threads_count} threads "
        f"{reading.descriptors_count} files {reading.processor_s / max(1.0, reading.at_s):.1%}"
    )


def _defects(daemon: UalDaemon) -> list[str]:
    return [line for line in daemon.log_text().splitlines() if _DEFECT.search(line)]


if __name__ == "__main__":
    sys.exit(main())
