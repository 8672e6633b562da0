"""What was measured: for each measure and each way, the values of each round."""

from __future__ import annotations

import statistics
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass

Statistic = Callable[[Sequence[float]], float]


def p50(values: Sequence[float]) -> float:
    """The median."""
    return statistics.median(values)


def p99(values: Sequence[float]) -> float:
    """What 99 of 100 do not exceed."""
    return statistics.quantiles(values, n=100, method="inclusive")[98] if len(values) > 1 else values[0]


@dataclass(frozen=True)
class Spread:
    """The median of the rounds, with the least and the most."""

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
        """What could not be measured in some round, and why."""

    def add(self, measure: str, way: str, values: Sequence[float]) -> None:
        """The values of this round."""
        if values:
            self.values[measure][way][self.round] = list(values)

    def has(self, measure: str, *ways: str) -> bool:
        """Whether these ways were all measured in one round at least."""
        return bool(self._common(measure, *ways))

    def all(self, measure: str, way: str) -> list[float]:
        """All values, of all rounds."""
        return [value for values in self.values[measure][way].values() for value in values]

    def spread(self, measure: str, way: str, statistic: Statistic = p50) -> Spread:
        """A statistic of each round."""
        return Spread.of([statistic(values) for values in self.values[measure][way].values()])

    def ratio(self, measure: str, way: str, to: str, statistic: Statistic = p50) -> Spread:
        """A statistic of a way to that of another in the same round: what slows the machine slows both."""
        ours, theirs = self.values[measure][way], self.values[measure][to]
        return Spread.of(
            [statistic(ours[number]) / statistic(theirs[number]) for number in self._common(measure, way, to)]
        )

    def _common(self, measure: str, *ways: str) -> list[int]:
        """The rounds in which these ways were all measured."""
        measured = self.values.get(measure, {})
        return sorted(set.intersection(*(set(measured.get(way, {})) for way in ways)))
