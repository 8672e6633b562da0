"""The table of a trace."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Mapping
from itertools import pairwise

from benchmarks.results import p99
from benchmarks.sample_trace.stamps import Stamp

_COMMON_SHARE = 0.5
"""A station that fewer samples pass is left out: a setpoint is not sent at each update."""
_US = 1e-3


def markdown(title: str, times: Mapping[int, Mapping[str, Stamp]], calls: Mapping[int, Mapping[str, Stamp]]) -> str:
    """Returns for each station how long a sample takes from the one before, and how many Python calls that are."""
    names = _stations(times)
    whole = [row for row in times.values() if names <= row.keys()]
    ordered = sorted(names, key=lambda name: statistics.median(row[name][0] - min(_at(row)) for row in whole))
    lines = [f"| {title}, {len(whole)} samples | µs, p50 | p99 | Python calls |", "|---|---|---|---|"]
    for before, name in pairwise(ordered):
        took = [(row[name][0] - row[before][0]) * _US for row in whole]
        lines.append(f"| {name} | {statistics.median(took):.0f} | {p99(took):.0f} | {_calls(calls, name)} |")
    all_us = [(max(_at(row)) - min(_at(row))) * _US for row in whole]
    total = sum(_calls(calls, name) for name in ordered)
    lines.append(f"| all (its own p50, p99) | {statistics.median(all_us):.0f} | {p99(all_us):.0f} | {total} |")
    return "\n".join(lines)


def _stations(rows: Mapping[int, Mapping[str, Stamp]]) -> set[str]:
    passed = Counter(name for row in rows.values() for name in row)
    return {name for name, count in passed.items() if count >= _COMMON_SHARE * len(rows)}


def _calls(rows: Mapping[int, Mapping[str, Stamp]], name: str) -> int:
    return round(statistics.median([row[name][1] for row in rows.values() if name in row] or [0]))


def _at(row: Mapping[str, Stamp]) -> list[int]:
    return [at_ns for at_ns, _ in row.values()]
