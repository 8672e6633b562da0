"""Findings, and their targets."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NetworkFigure:
    """One figure; `most` is the largest that is good, None where it is only reported."""

    what: str
    value: float
    unit: str
    most: float | None = None

    @property
    def is_reached(self) -> bool:
        return self.most is None or self.value <= self.most

    def row(self) -> str:
        wanted = "" if self.most is None else f"  <= {self.most:g}  {'PASS' if self.is_reached else 'FAIL'}"
        return f"{self.what:75} {self.value:9.3f} {self.unit:5}{wanted}"
