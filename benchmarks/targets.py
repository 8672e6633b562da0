"""The targets, and whether they are met: the tables of issues 5 and 32."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from benchmarks.effort import SUBSCRIBERS
from benchmarks.results import Results, Spread, Statistic, p50, p99
from benchmarks.setups import (
    CLASS,
    CLASS_FENCE,
    FLOORS,
    MAVSDK_GRPC,
    NATIVE,
    STREAM,
    STREAM_FENCE,
    UNARY,
    UNARY_FENCE,
    ClientSetup,
)

_MANY = 100


@dataclass(frozen=True)
class TargetRow:
    """One target. `found` is None if it was not measured; `why` then says what was missing."""

    what: str
    limit: float
    found: Spread | None
    unit: str = ""
    is_least: bool = False
    """Whether the limit is a lower limit instead of an upper one."""
    why: str = ""
    floor: Spread | None = None
    """The same figure of Python or gRPC alone (`benchmarks.setups.FLOORS`), if there is one."""

    @property
    def verdict(self) -> str:
        if self.found is None:
            return f"not measured: {self.why}"
        is_met = self.found.median >= self.limit if self.is_least else self.found.median <= self.limit
        return "PASS" if is_met else "FAIL"


def rows(results: Results) -> Iterator[TargetRow]:
    """Yields all lines of the table."""
    yield from _of_setpoints(results, "", CLASS, STREAM, UNARY)
    yield from _of_setpoints(results, ", in a fence", CLASS_FENCE, STREAM_FENCE, UNARY_FENCE)
    for count in SUBSCRIBERS:
        for name, statistic in (("p50", p50), ("p99", p99)):
            what = f"telemetry, {count} subscriber{'s' if count > 1 else ''}, {name}"
            limit = 1.5 if count < _MANY else 1.0
            yield _ratio(results, f"telemetry_ms_{count}", STREAM, MAVSDK_GRPC, statistic, what, limit)
    yield _ratio(results, "telemetry_ms_1", CLASS, NATIVE, p50, "telemetry in the process, 1 subscriber, p50", 2.0)
    memory = "resident memory after a flight"
    yield _most(results, "memory_mib", memory, 60.0, "MiB", lambda way: way.startswith("UAL") and "fence" not in way)
    yield _most(results, "memory_mib", f"{memory}, in a fence", 80.0, "MiB", lambda way: STREAM_FENCE.name in way)
    for text in ("with", "without"):
        way = f"UAL, {text} an autopilot"
        yield _most(results, "start_s", f"start to health answering, {text} autopilot", 0.4, "s", way.__eq__)
    yield _most(results, "import_ms", "import ual", 150.0, "ms", "import ual".__eq__)
    yield _most(results, "import_ms", "ual --help", 250.0, "ms", "ual --help".__eq__)


def _of_setpoints(
    results: Results, where: str, in_process: ClientSetup, stream: ClientSetup, unary: ClientSetup
) -> Iterator[TargetRow]:
    """Yields the lines of setpoints, and of the processor at 50 Hz, for the ways without a fence or with one."""
    for name, statistic in (("p50", p50), ("p99", p99)):
        yield _ratio(results, "setpoint_ms", in_process, NATIVE, statistic, f"class interface{where}, {name}", 1.2)
    for name, statistic, limit in (("p50", p50, 0.85), ("p99", p99, 0.9)):
        yield _ratio(results, "setpoint_ms", stream, MAVSDK_GRPC, statistic, f"server, streamed{where}, {name}", limit)
    what = f"server, streamed{where}, setpoints/s"
    yield _ratio(results, "setpoints_per_s", stream, MAVSDK_GRPC, p50, what, 8.0, is_least=True)
    for name, statistic in (("p50", p50), ("p99", p99)):
        yield _ratio(results, "setpoint_ms", unary, MAVSDK_GRPC, statistic, f"server, unary{where}, {name}", 1.2)
    yield _ratio(results, "server_percent", stream, MAVSDK_GRPC, p50, f"processor share of the server{where}", 1.0)


def _ratio(
    results: Results,
    measure: str,
    way: ClientSetup,
    to: ClientSetup,
    statistic: Statistic,
    what: str,
    limit: float,
    *,
    is_least: bool = False,
) -> TargetRow:
    unit = f"of {to.name}"
    for each in (way, to):
        if not results.has(measure, each.name):
            why = f"{each.name} is not installed" if each.is_missing else f"{each.name} gave no values"
            return TargetRow(what, limit, None, unit, is_least, why)
    floor = FLOORS.get(way)
    floor_ratio = (
        results.ratio(measure, floor.name, to.name, statistic)
        if floor is not None and results.has(measure, floor.name, to.name)
        else None
    )
    return TargetRow(
        what, limit, results.ratio(measure, way.name, to.name, statistic), unit, is_least, floor=floor_ratio
    )


def _most(
    results: Results, measure: str, what: str, limit: float, unit: str, is_meant: Callable[[str], bool]
) -> TargetRow:
    """Returns the line for the worst of the chosen ways."""
    spreads = [results.spread(measure, way) for way in results.values.get(measure, {}) if is_meant(way)]
    if not spreads:
        return TargetRow(what, limit, None, unit, why="it was left out")
    return TargetRow(what, limit, max(spreads, key=lambda spread: spread.median), unit)
