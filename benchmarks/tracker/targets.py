"""The targets of the tracker, and whether they are met (issues 4 and 14)."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence

from benchmarks.results import Spread
from benchmarks.targets import TargetRow
from benchmarks.tracker import autopilots, light
from benchmarks.tracker.methods import FAR, OURS
from benchmarks.tracker.tracked import TrackedFlight

Figure = Callable[[TrackedFlight], float]
SETTLED_M = 0.02
"""A flight of the light simulation ends when it stays this near to its goal."""
_ROUNDING = 1.01
"""The limit for differences between setpoints, 20 ms apart, as shares of the UAV's limits: 1, and 1 % for rounding."""

FIGURES: Mapping[str, Figure] = {
    "widest from the line, m": lambda flown: flown.widest_m,
    "rms, m": lambda flown: flown.rms_m,
    "overshoot, m": lambda flown: flown.overshoot_m,
    "first within 0.5 m, s": lambda flown: flown.within_s(),
    "peak speed, m/s": lambda flown: flown.peak_m_s,
    "waited, s": lambda flown: flown.waited_s,
}
TRUE_FIGURES: Mapping[str, Figure] = {
    name: FIGURES[name] for name in ("widest from the line, m", "rms, m", "overshoot, m")
}
"""Figures that make sense by the simulator's truth."""


def of_light(
    calm: Mapping[str, Mapping[str, light.DiagonalFlight]],
    windy: Mapping[str, light.DiagonalFlight],
    velocities: Mapping[str, light.DiagonalFlight],
    zigzag: light.Zigzag,
    goals: light.ChangingGoals,
) -> Iterator[TargetRow]:
    """Returns the lines of the light backend. `calm` has the flights of each set of limits, `windy` those in wind, and
    `velocities` those of an autopilot that takes velocities only.
    """
    for name, lines in calm.items():
        ours = lines[OURS]
        yield _one(f"{name}: widest from the line", 0.02, ours.flown.widest_ever_m, "m")
        yield _one(f"{name}: overshoot", 0.01, ours.flown.overshoot_m, "m")
        duration = ours.flown.settled_s(SETTLED_M) / ours.optimal_s
        yield _one(f"{name}: duration, until within 2 cm", 1.05, duration, "of the time-optimal")
        yield _one(f"{name}: duration, as planned", 1.05, ours.planned_s / ours.optimal_s, "of the time-optimal")
    for name, line in windy.items():
        wind = f"{name}, wind of {light.WIND_M_S:g} m/s: widest from the line"
        yield _one(wind, 0.10, line.flown.widest_ever_m, "m")
    for name, line in velocities.items():
        only, full = f"{name}, velocities only", calm[name][OURS].flown
        yield _one(f"{only}: overshoot", 0.02, line.flown.overshoot_m, "m")
        longer = line.flown.settled_s(SETTLED_M) / full.settled_s(SETTLED_M)
        yield _one(f"{only}: duration, until within 2 cm", 1.05, longer, "of that with positions")
    yield _one(f"zigzag of {light.CORNERS} corners: widest from the rounded path", 0.2, max(zigzag.off_m), "m")
    for name, shares in goals.shares.items():
        what = f"goal changed each {light.GOAL_PERIOD_S:g} s: largest {name}"
        yield _one(what, _ROUNDING, max(shares), "of its limit")


def of_autopilot(found: autopilots.AutopilotFlights) -> Iterator[TargetRow]:
    """Returns the lines of a real autopilot: medians, ratios of medians, and the worst of all flights."""
    ours, far = found.flights[OURS], found.flights[FAR]

    def absolute(what: str, limit: float) -> TargetRow:
        return TargetRow(f"{found.version}: {what}", limit, Spread.of([FIGURES[what](flown) for flown in ours]))

    def worst(what: str, limit: float) -> TargetRow:
        return _one(
            f"{found.version}: {what}, the worst flight", limit, max(FIGURES[what](flown) for flown in ours), ""
        )

    def ratio(what: str, limit: float, name: str, every: slice = slice(None)) -> TargetRow:
        spread = _ratio(FIGURES[what], ours[every], far[every])
        return TargetRow(f"{found.version}: {what}{name}", limit, spread, f"of {FAR}")

    yield ratio("widest from the line, m", 0.5, "")
    yield absolute("widest from the line, m", 0.3)
    yield worst("widest from the line, m", 0.45)
    yield absolute("rms, m", 0.2)
    yield absolute("overshoot, m", 0.2)
    yield worst("overshoot, m", 0.4)
    yield ratio("first within 0.5 m, s", 1.2, ", up", slice(0, None, 2))
    yield ratio("first within 0.5 m, s", 1.2, ", down", slice(1, None, 2))
    yield worst("waited, s", 2.0)


def _one(what: str, limit: float, figure: float, unit: str) -> TargetRow:
    return TargetRow(what, limit, Spread.of([figure]), unit)


def _ratio(figure: Figure, ours: Sequence[TrackedFlight], far: Sequence[TrackedFlight]) -> Spread:
    """Returns the ratio of the medians, and the smallest and largest ratio of flights with the same number."""
    of_ours, of_far = [figure(flown) for flown in ours], [figure(flown) for flown in far]
    pairs = [our / their for our, their in zip(of_ours, of_far, strict=True)]
    return Spread(statistics.median(of_ours) / statistics.median(of_far), min(pairs), max(pairs))
