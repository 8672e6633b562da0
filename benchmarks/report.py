"""Makes the tables as Markdown, for the terminal and for README.md."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.results import Results, Spread, p50, p99
from benchmarks.targets import TargetRow

_UNITS = {
    "setpoint_ms": "From the call to the vehicle, ms",
    "setpoints_per_s": "Setpoints a second that arrive",
    "telemetry_ms_1": "From the vehicle to the callback, 1 subscriber, ms",
    "telemetry_ms_10": "The same, 10 subscribers, ms",
    "telemetry_ms_100": "The same, 100 subscribers, ms",
    "telemetry_share_100": "Share of the positions that reached 100 subscribers",
    "server_percent": "Server at 50 Hz with the PX4 stream, % of a core",
    "client_percent": "The program beside it, % of a core",
    "memory_mib": "Resident memory of the server, MiB",
    "start_s": "Start to the first answer, s",
    "import_ms": "Imports and --help, ms",
    "noise_ms": "The machine's noise, ms",
}
_WITH_TAIL = ("_ms", "_ms_1", "_ms_10", "_ms_100")


def target_table(lines: list[TargetRow]) -> str:
    """Returns each target, the figure, whether it is met, and for some targets the figure of Python or gRPC alone."""
    has_floors = any(line.floor is not None for line in lines)
    head = ["", "target", "found (median of rounds)", "least to most", "", *(["Python or gRPC alone"] * has_floors)]
    rows = [_row(head), "|---" * len(head) + "|"]
    for line in lines:
        sign = "≥" if line.is_least else "≤"
        found, spread = ("–", "–") if line.found is None else _texts(line.found)
        floor = "" if line.floor is None else _number(line.floor.median)
        cells = [line.what, f"{sign} {line.limit:g} {line.unit}", found, spread, line.verdict, *([floor] * has_floors)]
        rows.append(_row(cells))
    return "\n".join(rows)


def _row(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def figures(results: Results) -> str:
    """Returns all measured figures, in their own units."""
    return "\n\n".join(
        "\n".join(_table(results, measure, title)) for measure, title in _UNITS.items() if measure in results.values
    )


def failures(results: Results) -> str:
    """Returns the measurements that failed; such a round does not count for that way."""
    return "".join(f"Not measured: {failure}\n\n" for failure in results.failures)


def _table(results: Results, measure: str, title: str) -> Iterator[str]:
    has_tail = measure.endswith(_WITH_TAIL) and measure != "import_ms"
    yield f"| {title} | {'p50 | p99' if has_tail else 'median | least to most'} |"
    yield "|---|---|---|"
    for way in results.values[measure]:
        if not results.has(measure, way):
            continue
        median = results.spread(measure, way, p50)
        if has_tail:
            yield f"| {way} | {_number(median.median)} | {_number(results.spread(measure, way, p99).median)} |"
        else:
            yield "| {} | {} | {} |".format(way, *_texts(median))


def _texts(spread: Spread) -> tuple[str, str]:
    return _number(spread.median), f"{_number(spread.least)} to {_number(spread.most)}"


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"
