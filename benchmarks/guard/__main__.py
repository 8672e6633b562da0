"""Prints the targets with what was recorded last, and what setpoints and samples cost now beside what was recorded.

Exit status 1 where something costs more than twice of what was recorded: that is no noise of the computer. It is
measured again before, up to twice.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Callable, Iterator

from benchmarks import recorded, targets
from benchmarks.guard import in_process, served
from benchmarks.results import Results

_TIMES = 2.0
"""So many times the recorded ratio fails."""
_AGAIN = 2
_PYMAVLINK, _BARE = "pymavlink", "gRPC alone"
_PARTS: dict[str, tuple[str, Callable[[], Iterator[tuple[str, float]]]]] = {
    "class": (_PYMAVLINK, in_process.setpoint_ratios),
    "server": (_PYMAVLINK, in_process.served_ratios),
    "daemon": (_BARE, served.ratios),
}


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.guard", description=__doc__)
    parser.add_argument("--only", action="append", choices=_PARTS, help="these parts only; may be given again")
    parser.add_argument("--keep", action="store_true", help="record what is found")
    arguments = parser.parse_args()
    logging.disable(logging.CRITICAL)
    print(_target_table())
    parts = arguments.only or list(_PARTS)
    known = recorded.recorded("guard")
    found: dict[str, float] = {}
    for part in parts:
        found |= _measured(part, known)
    print(_table(found, known))
    if arguments.keep:
        recorded.record("guard", {**known, **{name: round(ratio, 3) for name, ratio in found.items()}})
        return 0
    slow = [name for name, ratio in found.items() if _is_slow(name, ratio, known)]
    new = [name for name in found if name not in known]
    for text, names in (("more than twice of what was recorded", slow), ("not recorded yet: --keep", new)):
        if names:
            print(f"{text}: {', '.join(names)}")
    return int(bool(slow or new))


def _measured(part: str, known: dict[str, float]) -> dict[str, float]:
    """Returns the ratios of a part: the least of up to three runs where one of them is too large."""
    found = _once(part)
    for _ in range(_AGAIN):
        if not any(_is_slow(name, ratio, known) for name, ratio in found.items()):
            break
        found = {name: min(ratio, found[name]) for name, ratio in _once(part).items()}
    return found


def _once(part: str) -> dict[str, float]:
    to, measure = _PARTS[part]
    print(f"measuring: {part}", file=sys.stderr, flush=True)
    return {f"{name} / {to}": ratio for name, ratio in measure()}


def _is_slow(name: str, ratio: float, known: dict[str, float]) -> bool:
    return name in known and ratio > _TIMES * known[name]


def _target_table() -> str:
    """Returns the targets of `make bench`, with the ratios that it has recorded."""
    known = recorded.recorded("bench")
    rows = ["| target of `make bench` | limit | recorded last |", "|---|---|---|"]
    for line in targets.lines(Results()):
        last = known.get(line.what)
        limit = f"{'≥' if line.is_least else '≤'} {line.limit:g} {line.unit}"
        rows.append(f"| {line.what} | {limit} | {'–' if last is None else f'{last:.3g}'} |")
    return "\n".join([*rows, ""])


def _table(found: dict[str, float], known: dict[str, float]) -> str:
    rows = ["| processor time, ratio | recorded | now | |", "|---|---|---|---|"]
    for name, ratio in found.items():
        verdict = "new" if name not in known else "FAIL" if _is_slow(name, ratio, known) else "ok"
        last = f"{known[name]:.3g}" if name in known else "–"
        rows.append(f"| {name} | {last} | {ratio:.3g} | {verdict} |")
    return "\n".join([*rows, ""])


if __name__ == "__main__":
    sys.exit(main())
