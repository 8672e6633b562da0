"""Flies, and prints the targets and whether they are met; exit status 1 if a target is missed.

python -m benchmarks.tracker [--flights N] [--only light|px4|ardupilot] [--output DIRECTORY]
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Iterator
from pathlib import Path

from benchmarks.children import REPOSITORY
from benchmarks.report import target_table
from benchmarks.targets import TargetRow
from benchmarks.tracker import autopilots, light, plots, report, targets
from benchmarks.tracker.methods import OURS, PURSUIT
from ual_daemon.settings import Tracker

_AUTOPILOTS = {"px4": autopilots.PX4, "ardupilot": autopilots.ARDUPILOT}
_LIGHT = "light"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tracker", description=__doc__)
    parser.add_argument("--flights", type=int, default=10, help="of each way, with a real autopilot  [10]")
    parser.add_argument(
        "--only", action="append", choices=(_LIGHT, *_AUTOPILOTS), help="these only; may be given again"
    )
    parser.add_argument("--output", type=Path, default=REPOSITORY / "build" / "bench", help="where plots are written")
    arguments = parser.parse_args()
    logging.getLogger("ual_daemon").setLevel(logging.ERROR)  # hides warnings about replaced tasks
    parts = arguments.only or (_LIGHT, *_AUTOPILOTS)
    lines: list[TargetRow] = []
    if _LIGHT in parts:
        lines += fly_light(arguments.output)
    for name, autopilot in _AUTOPILOTS.items():
        if name not in parts:
            continue
        if autopilot.missing:
            print(
                f"*** {autopilot.name} IS NOT FLOWN: set {autopilot.missing} (docs/reference/backends/mavlink.md) ***\n"
            )
            continue
        lines += fly_autopilot(autopilot, name, arguments.flights, arguments.output)
    print(target_table(lines))
    return int(any(line.verdict == "FAIL" for line in lines))


def fly_light(output: Path) -> Iterator[TargetRow]:
    """Flies the light simulation."""
    calm, windy, velocities = {}, {}, {}
    for name, limits in light.VEHICLES.items():
        calm[name] = light.diagonal_flights(limits)
        flights = {way: [line.flown] for way, line in calm[name].items()}
        print(report.flights_table(name, flights), end="\n\n")
        plots.flights(output / f"tracker-{name.replace(' ', '-')}.svg", name, flights)
        windy[name] = light.diagonal_flight(OURS, limits, wind_m_s=light.WIND_M_S)
        velocities[name] = light.diagonal_flight(OURS, {**limits, **light.VELOCITIES_ONLY})
    zigzags = {OURS: light.zigzag(Tracker.REFERENCE), PURSUIT: light.zigzag(Tracker.PURSUIT)}
    for way, each in zigzags.items():
        print(
            f"zigzag, {way}: off the rounded path by {max(each.off_m):.3f} m at most, {each.peak_m_s:.2f} m/s at most"
        )
    plots.zigzags(output / "tracker-zigzag.svg", zigzags)
    goals = light.changing_goals()
    plots.goals(output / "tracker-goals.svg", goals)
    print()
    return targets.of_light(calm, windy, velocities, zigzags[OURS], goals)


def fly_autopilot(autopilot: autopilots.TrackedAutopilot, name: str, flights: int, output: Path) -> Iterator[TargetRow]:
    """Flies a real autopilot."""
    found = autopilots.fly(autopilot, flights)
    print(f"{found.version}, {flights} flights of each way, within {found.limits}\n")
    print(report.flights_table(found.version, found.flights), end="\n\n")
    plots.flights(output / f"tracker-{name}.svg", found.version, found.flights)
    return targets.of_autopilot(found)


if __name__ == "__main__":
    sys.exit(main())
