"""Attacks a daemon with a flying UAV, and measures what the flight notices: ``python -m benchmarks.attacks``.

Exit status 1 where it notices more than is wanted. ``--quick`` is a short look.
"""

from __future__ import annotations

import argparse
import sys
import time

from benchmarks.attacks.assaults import Assault, assaults
from benchmarks.attacks.figures import AttackFigures
from benchmarks.attacks.scenes import SCENES, AttackScene
from benchmarks.attacks.table import Row, markdown, text
from benchmarks.children import prefer_this

_DURATION_S, _QUICK_S = 10.0, 4.0
_BEGIN_S = 1.0
"""Seconds until an attack begins: the start of its program is none of the attack."""


def main() -> int:
    """Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.attacks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="shorter attacks")
    parser.add_argument("--markdown", action="store_true", help="the table as markdown")
    parser.add_argument("--only", default="", metavar="TEXT", help="attacks whose name contains this")
    parser.add_argument("--backend", action="append", choices=tuple(SCENES), help="default: all")
    arguments = parser.parse_args()
    prefer_this()
    duration_s = _QUICK_S if arguments.quick else _DURATION_S
    kinds = [SCENES[name] for name in arguments.backend or SCENES]
    chosen = [each for each in assaults() if each.name == "none" or arguments.only in each.name]
    found = {
        (scene.name, assault.name): _attack(scene, assault, duration_s)
        for assault in chosen
        for scene in kinds
        if assault.suits(scene)
    }
    rows = {kind.name: _rows(kind, chosen, found) for kind in kinds if not kind.is_plain}
    for name, its in rows.items():
        print(f"\n{name}\n\n{markdown(its) if arguments.markdown else text(its)}")
    return int(not all(row.is_good for its in rows.values() for row in its))


def _attack(kind: type[AttackScene], assault: Assault, duration_s: float) -> AttackFigures:
    with kind() as scene:
        assault.begin(scene)
        try:
            time.sleep(_BEGIN_S)
            scene.begin()
            time.sleep(duration_s)
            measured = scene.measure()
            end_s = scene.end()
        finally:
            count = assault.end(scene)
        found = measured.figures(end_s, count / (measured.duration_s + _BEGIN_S + (end_s or 0.0)), scene.defects())
    late = found.setpoints
    print(
        f"{kind.name:13} {assault.name:30} {found.acts_per_s:9.1f} {assault.unit}/s  "
        f"p50 {late.p50:.1f} p99 {late.p99:.1f} most {late.most:.1f} ms  "
        f"calls {found.calls.p50:.1f} {found.calls.p99:.1f} ms  gap {found.gap_ms:.0f} ms  "
        f"end {found.end_s or 0.0:.2f} s  {dict(measured.errors) or ''} {found.defects[:3] or ''}",
        file=sys.stderr,
        flush=True,
    )
    return found


def _rows(kind: type[AttackScene], chosen: list[Assault], found: dict[tuple[str, str], AttackFigures]) -> list[Row]:
    hold_s = found[kind.name, "none"].end_s or 0.0
    rows = []
    for assault in chosen:
        figures = found.get((kind.name, assault.name))
        if figures is not None:
            rate = f"{figures.acts_per_s:,.3g} {assault.unit}/s" if figures.acts_per_s else ""
            plain = found.get(("plain grpcio", assault.name))
            rows.append(Row(assault.name, rate, figures, plain, figures.is_good(hold_s)))
    return rows


if __name__ == "__main__":
    sys.exit(main())
