"""Makes the tables of the tracker's benchmark, as Markdown."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence

from benchmarks.tracker.flown import Flown
from benchmarks.tracker.targets import FIGURES


def flights_table(title: str, flights: Mapping[str, Sequence[Flown]]) -> str:
    """Returns the medians of all flights of each way; also the smallest and the largest value if there are several."""
    rows = [f"| {title} | {' | '.join(FIGURES)} |", "|---" * (len(FIGURES) + 1) + "|"]
    for way, flown in flights.items():
        cells = (_cell([figure(each) for each in flown]) for figure in FIGURES.values())
        rows.append(f"| {way} | {' | '.join(cells)} |")
    return "\n".join(rows)


def _cell(values: Sequence[float]) -> str:
    if len(values) == 1:
        return f"{values[0]:.3f}"
    return f"{statistics.median(values):.2f} ({min(values):.2f} to {max(values):.2f})"
