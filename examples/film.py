"""Two UAVs film a moving car: they circle it, chase it, and fly by.

``python -m examples.film uav_1 uav_2 --arm --plot film.svg``

The car is a frame that moves in map: here a simulated one that drives a curve, in the field what its receiver says.
Each shot is a path in the car's frame, flown by poses in it; the nose points at the car, and so does a camera that is
fixed to it. With ``--gimbal`` the cameras are on gimbals, which look at the car by themselves, on the way from shot to
shot, too. With ``--pictures`` each takes a picture a second, for ``ual camera fetch``. The two fly at two heights. In
the end each returns to where it took off, and lands.
"""

from __future__ import annotations

import argparse
import asyncio
import math
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager, nullcontext

import ual
from examples.together import landing_team, next_in_flight, parser, team_of, together
from examples.tracks import Tracks

SPEED_M_S, CURVE_M = 0.5, 15.0
"""The car's speed, and the radius of its way."""
RATE_HZ, PICTURE_S = 20.0, 1.0
START_M = (6.0, 0.0)
HEIGHTS_M = (2.0, 3.0)

Shot = Callable[[float], tuple[float, float]]
"""Position of a camera at a share of the shot, along x (ahead of the car) and y (left of it)."""


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
    """A car on a circle, and its frame in the trees of the UAVs that film it."""

    def __init__(self) -> None:
        self.is_parked = False
        self._clock = asyncio.get_running_loop().time
        self._began_s = self._clock()

    def transform(self) -> ual.Transform:
        """Returns where it is in map."""
        angle = SPEED_M_S * (self._clock() - self._began_s) / CURVE_M
        x, y = START_M[0] + CURVE_M * math.sin(angle), START_M[1] + CURVE_M * (1.0 - math.cos(angle))
        return ual.Transform(ual.Vector3(x, y), ual.Quaternion.from_yaw(angle), "map", "car")

    async def drive(self, team: ual.aio.Team) -> None:
        """Tells all where it is, until it is parked."""
        while not self.is_parked:
            await team.add_frame(self.transform())
            await asyncio.sleep(1.0 / RATE_HZ)


async def film(uav: ual.aio.Uav, shot: Shot, height_m: float, duration_s: float) -> None:
    """Flies one shot. Its first third is the way to its first place."""
    clock = asyncio.get_running_loop().time
    began_s = clock()
    async with uav.subscribe(rate_hz=RATE_HZ) as samples:
        while True:
            await next_in_flight(uav.ns, samples)
            share = (clock() - began_s) / duration_s
            if share >= 1.0:
                return
            x, y = shot(max(0.0, 1.5 * share - 0.5))
            pose = ual.Pose.at(x, y, height_m, yaw_rad=math.atan2(-y, -x))
            await uav.set_pose(ual.PoseStamped(pose, "car"))


async def point_gimbal_at_the_car(_name: str, uav: ual.aio.Uav) -> None:
    """Points its gimbal at the car, from now on."""
    await uav.gimbals[0].point_at(ual.PointStamped(ual.Vector3(), "car"))


@asynccontextmanager
async def taking_pictures(team: ual.aio.Team, names: list[str]) -> AsyncIterator[None]:
    """Has each take pictures during the block."""
    try:
        await team.each(lambda _, uav: uav.cameras[0].start_photos(interval_s=PICTURE_S))
        yield
    finally:
        await team.each(lambda _, uav: uav.cameras[0].stop_photos())
    for name in names:
        print(f"{name}: {len(await team[name].cameras[0].photos())} pictures")


async def shoot(team: ual.aio.Team, names: list[str], duration_s: float, car: Car, has: argparse.Namespace) -> None:
    """Takes off, flies all shots, and returns to where they stood."""
    heights = dict(zip(names, HEIGHTS_M, strict=True))
    await team.each(lambda name, uav: uav.take_off(heights[name]))
    if has.gimbal:
        await team.each(point_gimbal_at_the_car)
    async with taking_pictures(team, names) if has.pictures else nullcontext():
        await fly_shots(team, names, duration_s, heights)
    await team.each(lambda name, uav: uav.go_to_waypoint(ual.Pose.at(0.0, 0.0, heights[name])))
    car.is_parked = True


async def fly_shots(team: ual.aio.Team, names: list[str], duration_s: float, heights: Mapping[str, float]) -> None:
    for title, shots in SHOTS.items():
        print(title, flush=True)
        flights = zip(names, shots, strict=True)
        await together(*(film(team[name], shot, heights[name], duration_s) for name, shot in flights))


async def film_all(given: argparse.Namespace, tracks: Tracks) -> None:
    async with landing_team(given.names, is_arming=given.arm) as team:
        car = Car()
        async with tracks.kept(team_of(team)):
            # Together: nobody goes on filming a car of which nothing is heard any more.
            await together(car.drive(team), shoot(team, given.names, given.shot_s, car, given))


def main() -> None:
    options = parser(__doc__, names_count=2)
    options.add_argument("--shot-s", type=float, default=12.0, help="how long a shot takes")
    options.add_argument("--gimbal", action="store_true", help="the cameras are on gimbals")
    options.add_argument("--pictures", action="store_true", help="take a picture a second")
    given = options.parse_args()
    tracks = Tracks()
    asyncio.run(film_all(given, tracks))
    if given.plot is not None:
        tracks.draw(given.plot, "Filming a moving car", {"the car's start": [START_M]})
    print("filmed, landed")


if __name__ == "__main__":
    main()
