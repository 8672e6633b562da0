"""How well a real autopilot keeps its place while velocities are commanded, in its simulator, which already runs.

python -m benchmarks.tracker.velocities [--only px4|ardupilot] [--minutes N]
"""

from __future__ import annotations

import argparse
import logging
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from benchmarks.tracker.autopilots import ARDUPILOT, PX4, Autopilot, RealUav
from benchmarks.tracker.truth import Truth
from ual.errors import UalError
from ual.geometry import Pose, Twist, Vector3
from ual_daemon.settings import Tracker

_AUTOPILOTS = {"px4": PX4, "ardupilot": ARDUPILOT}
_DURATION_S = 60.0
_PERIOD_S = 0.05
_REACHED_S = 4.0
"""After this the velocity is flown; from then on its width counts."""
_HEIGHT_M = 8.0
VELOCITIES: Mapping[str, Vector3 | None] = {
    "a held position (`set_pose`)": None,
    "velocity 0": Vector3(),
    "1 m/s east": Vector3(1.0, 0.0, 0.0),
    "1 m/s west": Vector3(-1.0, 0.0, 0.0),
}


@dataclass(frozen=True)
class Kept:
    """Where the UAV was in one minute: `along` (0 if it was to stay) is the direction of the velocity."""

    along: Vector3
    places: Sequence[Vector3]

    @property
    def width_m(self) -> float:
        """Returns how far apart its places are, sideways; along the wider axis where it was to stay."""
        return max(_spread([place.y for place in self.places]), 0.0 if self.along.x else self._spread_x_m)

    @property
    def height_m(self) -> float:
        return _spread([place.z for place in self.places])

    @property
    def drift_m(self) -> float:
        """Returns how far the end lies from the begin, not counting the direction of flight."""
        way = self.places[-1] - self.places[0]
        return Vector3(0.0 if self.along.x else way.x, way.y, way.z).norm()

    @property
    def _spread_x_m(self) -> float:
        return _spread([place.x for place in self.places])


def _spread(values: Sequence[float]) -> float:
    return max(values) - min(values)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tracker.velocities", description=__doc__)
    parser.add_argument("--only", action="append", choices=tuple(_AUTOPILOTS))
    parser.add_argument("--minutes", type=int, default=2, help="of each velocity  [2]")
    arguments = parser.parse_args()
    logging.getLogger("ual_daemon").setLevel(logging.ERROR)
    for name in arguments.only or _AUTOPILOTS:
        autopilot = _AUTOPILOTS[name]
        if autopilot.missing:
            print(f"*** {autopilot.name} IS NOT FLOWN: set {autopilot.missing} (docs/backends/mavlink.md) ***\n")
            continue
        print(_table(autopilot.name, _fly(autopilot, arguments.minutes)), flush=True)
    return 0


Found = Mapping[str, list[tuple[Kept, Kept]]]
"""By what was commanded: where it was by its estimate, and where it truly was."""


def _fly(autopilot: Autopilot, minutes: int) -> Found:
    found: dict[str, list[tuple[Kept, Kept]]] = {name: [] for name in VELOCITIES}
    with autopilot.pilot() as pilot, RealUav(autopilot, Tracker.REFERENCE) as uav:
        truth = Truth()
        truth.listen(pilot)
        ground = uav.take_off(pilot)
        home = Pose.at(ground.position.x, ground.position.y, _HEIGHT_M, ground.yaw_rad)
        uav.ual.go_to_waypoint(home)
        for _ in range(minutes):
            for name, velocity in VELOCITIES.items():
                found[name].append(_keep_place(uav, truth, velocity))
                print(
                    f"{autopilot.name}, {name}: width {found[name][-1][0].width_m:.2f} m", file=sys.stderr, flush=True
                )
        uav.ual.go_to_waypoint(home)
        uav.land()
    return found


def _keep_place(uav: RealUav, truth: Truth, velocity: Vector3 | None) -> tuple[Kept, Kept]:
    """Commands for a minute; begins again where a busy computer has let the autopilot take over."""
    here = uav.ual.pose().pose
    if velocity is None:
        command: Callable[[], None] = lambda: uav.ual.set_pose(here)  # noqa: E731
    else:
        command = lambda: uav.ual.set_velocity(Twist(velocity))  # noqa: E731
    while True:
        try:
            places, true_places = _places(uav, truth, command)
        except UalError as error:
            print(f"again, because {error}", file=sys.stderr, flush=True)
            uav.take_control(uav.ual.pose().pose)
        else:
            along = velocity or Vector3()
            return Kept(along, places), Kept(along, true_places)


def _places(uav: RealUav, truth: Truth, command: Callable[[], None]) -> tuple[list[Vector3], list[Vector3]]:
    places, true_places = [], []
    begin_s = time.monotonic()
    while (passed_s := time.monotonic() - begin_s) < _REACHED_S + _DURATION_S:
        command()
        time.sleep(_PERIOD_S)
        true_place = truth.position
        if passed_s > _REACHED_S and true_place is not None:
            places.append(uav.ual.pose().pose.position)
            true_places.append(true_place)
    return places, true_places


def _table(title: str, found: Found) -> str:
    """Returns the largest value of all minutes."""
    rows = [f"| {title} | width, m | height, m | drift, m | width by truth, m | height by truth, m |", "|---" * 6 + "|"]
    for name, minutes in found.items():
        kept, true = [each for each, _ in minutes], [each for _, each in minutes]
        figures = (
            [each.width_m for each in kept],
            [each.height_m for each in kept],
            [each.drift_m for each in kept],
            [each.width_m for each in true],
            [each.height_m for each in true],
        )
        rows.append(f"| {name} | {' | '.join(f'{max(values):.2f}' for values in figures)} |")
    return "\n".join(rows)


if __name__ == "__main__":
    sys.exit(main())
