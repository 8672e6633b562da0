"""The figures as a table."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from benchmarks.attacks.figures import AttackFigures

_HEADINGS = (
    "attack",
    "rate",
    "setpoints late, ms: p50",
    "p99",
    "most",
    "caller's setpoints late, p99",
    "telemetry gap, ms",
    "SIGTERM to exit, s",
    "plain grpcio: p99 / gap, ms",
    "",
)


@dataclass(frozen=True)
class Row:
    """One attack on one backend, and the same on plain grpcio where that was measured."""

    attack: str
    rate: str
    figures: AttackFigures
    plain: AttackFigures | None
    is_good: bool

    def cells(self) -> tuple[str, ...]:
        found, plain = self.figures, self.plain
        return (
            self.attack,
            self.rate,
            f"{found.setpoints.p50:.1f}",
            f"{found.setpoints.p99:.1f}",
            f"{found.setpoints.most:.1f}",
            f"{found.calls.p99:.1f}",
            f"{found.gap_ms:.0f}",
            "" if found.end_s is None else f"{found.end_s:.2f}",
            "" if plain is None else f"{plain.calls.p99:.1f} / {plain.gap_ms:.0f}",
            "PASS" if self.is_good else "FAIL",
        )


def markdown(rows: Iterable[Row]) -> str:
    """Returns a table of markdown."""
    lines = ["| " + " | ".join(_HEADINGS) + " |", "|" + "---|" * len(_HEADINGS)]
    lines += ["| " + " | ".join(row.cells()) + " |" for row in rows]
    return "\n".join(lines)


def text(rows: Sequence[Row]) -> str:
    """Returns a table for a terminal."""
    cells = [_HEADINGS, *(row.cells() for row in rows)]
    widths = [min(28, max(len(row[column]) for row in cells)) for column in range(len(_HEADINGS))]
    return "\n".join(
        "  ".join(cell[:width].ljust(width) for cell, width in zip(row, widths, strict=True)) for row in cells
    )
