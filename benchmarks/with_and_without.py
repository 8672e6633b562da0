"""Cost of a daemon's flag for a flight: setpoints at 50 Hz with it and without it, in turns."""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Iterator
from dataclasses import replace

from benchmarks.children import Child
from benchmarks.effort import QUICK
from benchmarks.measures import processor, setpoints
from benchmarks.results import Results, p50, p99
from benchmarks.setups import STREAM, ClientSetup

_LATE_MS = 20.0
"""A setpoint that comes later than the next one is sent is late."""
_EFFORT = replace(QUICK, paced_count=500, flood_s=0.1)


def rounds(what: str) -> int:
    """Returns how many rounds the command line asks for."""
    parser = argparse.ArgumentParser(description=f"What {what} a flight.")
    parser.add_argument("--rounds", type=int, default=7, help="[7]")
    return int(parser.parse_args().rounds)


def setup(name: str, *flags: str) -> ClientSetup:
    """Returns the way with these flags."""
    return ClientSetup(f"{STREAM.name}, {name}", STREAM.peer, STREAM.address, flags)


def measure(vehicle: Child, results: Results, with_it: ClientSetup, count: int) -> None:
    """Measures both ways, in turns."""
    for results.round in range(count):
        for each in (STREAM, with_it) if results.round % 2 else (with_it, STREAM):
            setpoints.measure(vehicle, _EFFORT, results, each)
            processor.measure(vehicle, results, each)


def report(results: Results, with_it: ClientSetup, most_percent: float) -> bool:
    """Prints the figures, and the targets with PASS or FAIL. Returns whether all are met."""
    for each in (STREAM, with_it):
        latencies = results.all("setpoint_ms", each.name)
        share = statistics.median(results.all("server_percent", each.name))
        print(
            f"{each.name:24}{len(latencies):6d} setpoints: {p50(latencies):.2f} ms p50, {p99(latencies):.2f} p99, "
            f"{max(latencies):.2f} at most; daemon {share:.1f} % of a core"
        )
    print()
    is_met = True
    for name, figure, limit, passes in _verdicts(results, with_it, most_percent):
        is_met &= passes
        print(f"{name:40}{figure:8.2f}  {limit:8}  {'PASS' if passes else 'FAIL'}")
    return is_met


def _verdicts(results: Results, with_it: ClientSetup, most_percent: float) -> Iterator[tuple[str, float, str, bool]]:
    """Returns the targets: name, figure, limit as text, and whether it is met."""
    without_percent, with_percent = (results.all("server_percent", each.name) for each in (STREAM, with_it))
    more = statistics.median(with_percent) - statistics.median(without_percent)
    yield "more of a core, %", more, f"< {most_percent}", more < most_percent
    late = {each: sum(ms > _LATE_MS for ms in results.all("setpoint_ms", each.name)) for each in (STREAM, with_it)}
    yield "late setpoints, more than without", late[with_it] - late[STREAM], "<= 0", late[with_it] <= late[STREAM]
    lost = sum(results.all("setpoints_lost", with_it.name))
    yield "lost setpoints", lost, "<= 0", lost <= 0
