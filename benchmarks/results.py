"""The measured values, by measure, way and round."""

from __future__ import annotations

import statistics
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass

Statistic = Callable[[Sequence[float]], float]


def p50(values: Sequence[float]) -> float:
    """Returns the median."""
    return statistics.median(values)


def p99(values: Sequence[float]) -> float:
    """Returns the 99th percentile."""
    return statistics.quantiles(values, n=100, method="inclusive")[98] if len(values) > 1 else values[0]


@dataclass(frozen=True)
class Spread:
    """The median, the smallest and the largest value of all rounds."""

    median: float
    least: float
    most: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        return cls(statistics.median(values), min(values), max(values))


class Results:
    """Values by measure, way and round. `round` is the number of the round that is being measured."""

    def __init__(self) -> None:
        self.round = 0
        self.values: dict[str, dict[str, dict[int, list[float]]]] = defaultdict(lambda: defaultdict(dict))
        self.failures: list[str] = []
        """Failed measurements, and the reasons."""

    def add(self, measure: str, way: str, values: Sequence[float]) -> None:
        """Adds the values of this round."""
        if values:
            self.values[measure][way][self.round] = list(values)

    def has(self, measure: str, *ways: str) -> bool:
        """Returns whether all these ways were measured in at least one round."""
        return bool(self._common(measure, *ways))

    def all(self, measure: str, way: str) -> list[float]:
        """Returns all values of all rounds."""
        return [value for values in self.values[measure][way].values() for value in values]

    def spread(self, measure: str, way: str, statistic: Statistic = p50) -> Spread:
        """Returns a statistic over the rounds."""
        return Spread.of([statistic(values) for values in self.values[measure][way].values()])

    def ratio(self, measure: str, way: str, to: str, statistic: Statistic = p50) -> Spread:
        """Returns the ratio of a statistic of two ways in the same rounds. A slow machine slows both."""
        ours, theirs = self.values[measure][way], self.values[measure][to]
        return Spread.of(
            [statistic(ours[number]) / statistic(theirs[number]) for number in self._common(measure, way, to)]
        )

    def _common(self, measure: str, *ways: str) -> list[int]:
        """Returns the rounds in which all these ways were measured."""
        measured = self.values.get(measure, {})
        return sorted(set.intersection(*(set(measured.get(way, {})) for way in ways)))
