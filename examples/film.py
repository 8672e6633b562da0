"""Two UAVs film a moving car: they circle it, chase it, and fly by.

``python -m examples.film uav_1 uav_2 --arm --plot film.svg``

The car is a frame that moves in map: here a simulated one that drives a curve, in the field what its receiver says.
Each shot is a path in the car's frame, flown by poses in it; the nose points at the car, and so does a camera that is
fixed to it. The two fly at two heights. In the end each returns to where it took off, and lands.
"""

from __future__ import annotations

import argparse
import asyncio
import math
from collections.abc import Callable
from pathlib import Path

import ual
from examples.together import land_if_flying, team_of, together
from examples.tracks import Tracks

SPEED_M_S, CURVE_M = 0.5, 15.0
"""The car's speed, and the radius of its way."""
RATE_HZ = 20.0
START_M = (6.0, 0.0)
HEIGHTS_M = (2.0, 3.0)

Shot = Callable[[float], tuple[float, float]]
"""Where a camera is at a share of the shot, along x (ahead of the car) and y (left of it)."""


def circle(begin_rad: float) -> Shot:
    """Half a circle around the car, 4 m from it."""
    return lambda share: (4.0 * math.cos(begin_rad + math.pi * share), 4.0 * math.sin(begin_rad + math.pi * share))


def keep(x: float, y: float) -> Shot:
    """A place that goes with the car: a chase from behind, or ahead of it."""
    return lambda _share: (x, y)


def fly_by(y: float) -> Shot:
    """From behind the car to ahead of it, on one side."""
    return lambda share: (-4.0 + 8.0 * share, y)


SHOTS: dict[str, tuple[Shot, Shot]] = {
    "circle": (circle(math.pi), circle(0.0)),
    "chase": (keep(-4.0, 0.0), keep(4.0, 0.0)),
    "fly-by": (fly_by(3.0), fly_by(-3.0)),
}


class Car:
    """A car on a circle, and its frame in the trees of those who film it."""

    def __init__(self) -> None:
        self._clock = asyncio.get_running_loop().time
        self._began_s = self._clock()

    def place(self) -> ual.Transform:
        """Returns where it is in map."""
        angle = SPEED_M_S * (self._clock() - self._began_s) / CURVE_M
        x, y = START_M[0] + CURVE_M * math.sin(angle), START_M[1] + CURVE_M * (1.0 - math.cos(angle))
        return ual.Transform(ual.Vector3(x, y), ual.Quaternion.from_yaw(angle), "map", "car")

    async def drive(self, team: ual.aio.Team) -> None:
        """Tells all where it is, until it is cancelled."""
        while True:
            await team.add_frame(self.place())
            await asyncio.sleep(1.0 / RATE_HZ)


async def film(uav: ual.aio.Uav, shot: Shot, height_m: float, duration_s: float) -> None:
    """Flies one shot. Its first third is the way to its first place."""
    clock = asyncio.get_running_loop().time
    began_s = clock()
    async with uav.subscribe(rate_hz=RATE_HZ) as samples:
        async for sample in samples:
            if sample.state is not ual.State.FLYING_AUTO:
                raise ual.WrongStateError(f"{sample.state.name}: {sample.state_reason}")
            share = (clock() - began_s) / duration_s
            if share >= 1.0:
                return
            x, y = shot(max(0.0, 1.5 * share - 0.5))
            pose = ual.Pose.at(x, y, height_m, yaw_rad=math.atan2(-y, -x))
            await uav.set_pose(ual.PoseStamped(pose, "car"))


async def film_all(names: list[str], duration_s: float, *, is_arming: bool, tracks: Tracks) -> None:
    async with ual.aio.Team(names) as team:
        car = Car()
        driving = asyncio.create_task(car.drive(team))
        try:
            if is_arming:
                await team.arm()
            heights = dict(zip(names, HEIGHTS_M, strict=True))
            await team.each(lambda name, uav: uav.take_off(heights[name]))
            async with tracks.kept(team_of(team)):
                for title, shots in SHOTS.items():
                    print(title, flush=True)
                    flights = zip(names, shots, strict=True)
                    await together(*(film(team[n], shot, heights[n], duration_s) for n, shot in flights))
                await team.each(lambda name, uav: uav.go_to_waypoint(ual.Pose.at(0.0, 0.0, heights[name])))
        finally:
            driving.cancel()
            await team.ask(land_if_flying)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs=2, metavar="NAME")
    parser.add_argument("--shot-s", type=float, default=12.0, help="how long a shot takes")
    parser.add_argument("--arm", action="store_true", help="arm them, where their daemons may")
    parser.add_argument("--plot", type=Path, metavar="FILE")
    arguments = parser.parse_args()
    tracks = Tracks()
    asyncio.run(film_all(arguments.names, arguments.shot_s, is_arming=arguments.arm, tracks=tracks))
    if arguments.plot is not None:
        tracks.draw(arguments.plot, "Filming a moving car", {"the car's start": [START_M]})
    print("filmed, landed")


if __name__ == "__main__":
    main()
