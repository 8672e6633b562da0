"""Makes the tables of the tracker's benchmark, as Markdown."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence

from benchmarks.tracker.targets import FIGURES, TRUE_FIGURES, Figure
from benchmarks.tracker.tracked import TrackedFlight


def flights_table(title: str, flights: Mapping[str, Sequence[TrackedFlight]]) -> str:
    """Returns the medians of all flights of each way; also the smallest and the largest value if there are several.

    A second row has those by the simulator's truth, where it says it.
    """
    rows = [f"| {title} | {' | '.join(FIGURES)} |", "|---" * (len(FIGURES) + 1) + "|"]
    for way, flown in flights.items():
        rows.append(_row(way, flown, FIGURES))
        by_truth = [true for each in flown if (true := each.true()) is not None]
        if by_truth:
            rows.append(_row(f"{way}, by the truth", by_truth, TRUE_FIGURES))
    return "\n".join(rows)


def _row(way: str, flown: Sequence[TrackedFlight], figures: Mapping[str, Figure]) -> str:
    cells = (_cell([figures[name](each) for each in flown]) if name in figures else "" for name in FIGURES)
    return f"| {way} | {' | '.join(cells)} |"


def _cell(values: Sequence[float]) -> str:
    if len(values) == 1:
        return f"{values[0]:.3f}"
    return f"{statistics.median(values):.2f} ({min(values):.2f} to {max(values):.2f})"
