"""Measurements during an attack, as figures, and their targets."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

PERIOD_MS = 20.0
"""At 50 Hz a setpoint is due this long after the one before."""
MOST_P99_MS, MOST_LATE_MS = 20.0, 100.0
MOST_GAP_MS = 200.0
MOST_END_S = 2.0


@dataclass(frozen=True)
class Lateness:
    """Lateness in ms."""

    p50: float = math.nan
    p99: float = math.nan
    most: float = math.nan
    count: int = 0


@dataclass(frozen=True)
class AttackFigures:
    """Of one attack on one server. `end_s` is the time from SIGTERM until the exit; None where nothing was signalled.

    `setpoints` is how late each setpoint reached the autopilot, after the one before. `calls` is how late each setpoint
    of the flying program reached it, after the program had to send it. `gap_ms` is the longest time without telemetry.
    """

    setpoints: Lateness
    calls: Lateness
    gap_ms: float
    end_s: float | None
    acts_per_s: float
    defects: tuple[str, ...] = ()

    def is_good(self, hold_s: float) -> bool:
        """Returns whether this is what is wanted; `hold_s` is what the end takes without an attack."""
        is_flown = self.setpoints.p99 < MOST_P99_MS and self.setpoints.most <= MOST_LATE_MS
        has_ended = self.end_s is None or self.end_s - hold_s <= MOST_END_S
        return is_flown and self.gap_ms < MOST_GAP_MS and has_ended and not self.defects


def of_stream(came_ns: Sequence[int], from_ns: int, to_ns: int) -> Lateness:
    """Returns how late setpoints came, of which one is due `PERIOD_MS` after the one before.

    The ends of the time count as setpoints: if none came, the stream was late for all of it.
    """
    inside = [from_ns, *sorted(each for each in came_ns if from_ns < each < to_ns), to_ns]
    return _lateness([max(0.0, (b - a) / 1e6 - PERIOD_MS) for a, b in itertools.pairwise(inside)])


def of_calls(due: Sequence[tuple[int, int]], came: Sequence[tuple[int, int]]) -> Lateness:
    """Returns how late numbered setpoints came. One that another one overtook counts with the time of that."""
    first: dict[int, int] = {}
    for number, came_ns in came:
        first.setdefault(number, came_ns)
    late: list[float] = []
    next_ns = math.inf
    for number, due_ns in reversed(sorted(due)):  # noqa: C413
        next_ns = min(next_ns, first.get(number, math.inf))
        if next_ns < math.inf:
            late.append(max(0.0, (next_ns - due_ns) / 1e6))
    return _lateness(late)


def gap_ms(samples_ns: Sequence[int], from_ns: int, to_ns: int) -> float:
    """Returns the longest time without a sample."""
    inside = [from_ns, *(each for each in samples_ns if from_ns < each < to_ns), to_ns]
    return max((b - a) / 1e6 for a, b in itertools.pairwise(inside))


def _lateness(late_ms: Sequence[float]) -> Lateness:
    if not late_ms:
        return Lateness()
    ordered = sorted(late_ms)
    return Lateness(_at(ordered, 0.5), _at(ordered, 0.99), ordered[-1], len(ordered))


def _at(ordered: Sequence[float], share: float) -> float:
    return ordered[min(len(ordered) - 1, int(len(ordered) * share))]
