"""Cost of a recording for a flight: ``python -m benchmarks.recording``.

A daemon flies the minimal vehicle with setpoints at 50 Hz, without a recording and with ``--record --record-raw``, in
turns. What the daemon's processor does more, and how late setpoints come, is printed with PASS or FAIL (exit status 1
where one is missed).
"""

from __future__ import annotations

import sys
import tempfile

from benchmarks import with_and_without
from benchmarks.children import Child, priority_text
from benchmarks.results import Results

_MOST_PERCENT = 5.0
"""Of one core."""


def main() -> None:
    """Measures, prints, and ends with 1 where a target is missed."""
    rounds = with_and_without.rounds("a recording costs")
    print(f"Priority: {priority_text()}\n")
    results = Results()
    with tempfile.TemporaryDirectory(prefix="ual-bench-") as directory, Child("benchmarks.vehicle") as vehicle:
        vehicle.prefer()
        recorded = with_and_without.setup("recorded", "--record", directory, "--record-raw")
        with_and_without.measure(vehicle, results, recorded, rounds)
    sys.exit(not with_and_without.report(results, recorded, _MOST_PERCENT))


if __name__ == "__main__":
    main()
