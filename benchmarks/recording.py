"""What a recording costs a flight: ``python -m benchmarks.recording``.

A daemon flies the minimal vehicle with setpoints at 50 Hz, without a recording and with ``--record --record-raw``, in
turns. What the daemon's processor does more, and how late setpoints come, is printed with PASS or FAIL (exit status 1
where one is missed).
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from benchmarks.children import Child, priority_text
from benchmarks.effort import QUICK
from benchmarks.measures import processor, setpoints
from benchmarks.results import Results, p50, p99
from benchmarks.ways import STREAM, Way

_MOST_PERCENT = 5.0
"""Of one core."""
_LATE_MS = 20.0
"""A setpoint that comes later than the next one is sent is late."""
_EFFORT = replace(QUICK, paced_count=500, flood_s=0.1)


def measure(vehicle: Child, results: Results, directory: Path, rounds: int) -> Way:
    """Measures both ways, in turns. Returns the one that records."""
    recorded = Way("UAL stream, recorded", STREAM.peer, STREAM.address, ("--record", str(directory), "--record-raw"))
    for results.round in range(rounds):
        for way in (STREAM, recorded) if results.round % 2 else (recorded, STREAM):
            setpoints.measure(vehicle, _EFFORT, results, way)
            processor.measure(vehicle, results, way)
    return recorded


def verdicts(results: Results, recorded: Way) -> Iterator[tuple[str, float, str, bool]]:
    """Returns the targets: name, figure, limit as text, and whether it is met."""
    plain, with_it = (results.all("server_percent", way.name) for way in (STREAM, recorded))
    more = statistics.median(with_it) - statistics.median(plain)
    yield "more of a core, %", more, f"< {_MOST_PERCENT}", more < _MOST_PERCENT
    late = {way: sum(ms > _LATE_MS for ms in results.all("setpoint_ms", way.name)) for way in (STREAM, recorded)}
    yield "late setpoints, more than without", late[recorded] - late[STREAM], "<= 0", late[recorded] <= late[STREAM]
    lost = sum(results.all("setpoints_lost", recorded.name))
    yield "lost setpoints", lost, "<= 0", lost <= 0


def main() -> None:
    """Measures, prints, and ends with 1 where a target is missed."""
    parser = argparse.ArgumentParser(description="What a recording costs a flight.")
    parser.add_argument("--rounds", type=int, default=7, help="[7]")
    rounds = parser.parse_args().rounds
    print(f"Priority: {priority_text()}\n")
    results = Results()
    with tempfile.TemporaryDirectory(prefix="ual-bench-") as directory, Child("benchmarks.vehicle") as vehicle:
        vehicle.prefer()
        recorded = measure(vehicle, results, Path(directory), rounds)
    for way in (STREAM, recorded):
        latencies = results.all("setpoint_ms", way.name)
        share = statistics.median(results.all("server_percent", way.name))
        print(
            f"{way.name:24}{len(latencies):6d} setpoints: {p50(latencies):.2f} ms p50, {p99(latencies):.2f} p99, "
            f"{max(latencies):.2f} at most; daemon {share:.1f} % of a core"
        )
    print()
    is_met = True
    for name, figure, limit, passes in verdicts(results, recorded):
        is_met &= passes
        print(f"{name:40}{figure:8.2f}  {limit:8}  {'PASS' if passes else 'FAIL'}")
    sys.exit(not is_met)


if __name__ == "__main__":
    main()
