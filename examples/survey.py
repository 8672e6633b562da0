"""Several UAVs survey a field and bring what they find to one drop zone, which only one may enter at a time (MBZIRC).

``python -m examples.survey uav_1 uav_2 uav_3 --arm --plot survey.svg``

Each has a strip of the field, and a height of its own, at which it never meets another one. It flies its strip in
lanes, picks up what lies there, waits at the edge of the drop zone until nobody is in it, drops the thing, and leaves.
The zone is free again when telemetry has shown that the UAV has left it. If one fails within it, nobody else goes in.
"""

from __future__ import annotations

import asyncio
import math
import random

import ual
from examples.together import landing_team, parser, team_of, together
from examples.tracks import Tracks

FIELD_M = (12.0, 9.0)
"""Its size along x and y of map; one corner is at the origin."""
LANES = 2
ZONE = ual.Vector3(6.0, -5.0, 0.0)
ZONE_RADIUS_M = 2.0
LOWEST_M, LAYER_M = 3.0, 1.0
PICK_M = 1.0
"""The height at which a magnet takes a thing, or lets it fall."""


def things(count: int, seed: int) -> list[tuple[float, float]]:
    """Returns where the things lie. A camera would find them in flight."""
    chance = random.Random(seed)  # noqa: S311 (no secret)
    return [(chance.uniform(0.5, FIELD_M[0] - 0.5), chance.uniform(0.5, FIELD_M[1] - 0.5)) for _ in range(count)]


class Surveyor:
    """One UAV with the strip `index` of `count`."""

    def __init__(self, name: str, uav: ual.aio.Uav, index: int, count: int, zone: asyncio.Lock) -> None:
        self.name = name
        self._uav = uav
        self._zone = zone
        self.height_m = LOWEST_M + LAYER_M * index
        self._south_m, self._north_m = FIELD_M[1] * index / count, FIELD_M[1] * (index + 1) / count
        # Waiting UAVs stand apart from each other, on the side of the field.
        angle = math.pi * (index + 1) / (count + 1)
        self._gate = (
            ZONE.x + (ZONE_RADIUS_M + 1.0) * math.cos(angle),
            ZONE.y + (ZONE_RADIUS_M + 1.0) * math.sin(angle),
        )

    async def survey(self, found: list[tuple[float, float]]) -> None:
        """Flies the lanes, then fetches what lies in the strip."""
        await self._uav.follow_path(self._lanes())
        mine = [(x, y) for x, y in found if self._south_m <= y < self._north_m]
        print(f"{self.name} has seen its strip: {len(mine)} things")
        for x, y in mine:
            await self._go(x, y)
            await self._dip(x, y)
            await self._drop()
        await self._go(0.0, self._south_m + 1.0)

    def _lanes(self) -> list[ual.PoseStamped]:
        corners = []
        for lane in range(LANES):
            y = self._south_m + (self._north_m - self._south_m) * (lane + 0.5) / LANES
            xs = (0.0, FIELD_M[0]) if lane % 2 == 0 else (FIELD_M[0], 0.0)
            corners += [ual.PoseStamped(ual.Pose.at(x, y, self.height_m), "map") for x in xs]
        return corners

    async def _drop(self) -> None:
        await self._go(*self._gate)
        await self._zone.acquire()
        # Not `async with`: after a failure within the zone it stays closed.
        print(f"{self.name} enters the zone")
        await self._go(ZONE.x, ZONE.y)
        await self._dip(ZONE.x, ZONE.y)
        await self._go(*self._gate)
        here = (await self._uav.transform()).translation
        if math.hypot(here.x - ZONE.x, here.y - ZONE.y) <= ZONE_RADIUS_M:
            raise RuntimeError(f"{self.name} has not left the zone: it is at {here}")
        print(f"{self.name} has left the zone")
        self._zone.release()

    async def _dip(self, x: float, y: float) -> None:
        """Goes down to the ground's things and up again, where nobody else is: in its strip, or in the zone."""
        await self._go(x, y, PICK_M)
        await self._go(x, y)

    async def _go(self, x: float, y: float, height_m: float | None = None) -> None:
        z = self.height_m if height_m is None else height_m
        await self._uav.go_to_waypoint(ual.PoseStamped(ual.Pose.at(x, y, z), "map"))


async def survey(names: list[str], found: list[tuple[float, float]], *, is_arming: bool, tracks: Tracks) -> None:
    zone = asyncio.Lock()
    # Whatever fails, all that fly land where they are: in their strips, or where they wait.
    async with landing_team(names, is_arming=is_arming) as team:
        surveyors = {name: Surveyor(name, team[name], i, len(names), zone) for i, name in enumerate(names)}
        await team.each(lambda name, uav: uav.take_off(surveyors[name].height_m))
        async with tracks.kept(team_of(team)):
            await together(*(surveyor.survey(found) for surveyor in surveyors.values()))


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--things", type=int, default=4, help="how many things lie in the field")
    options.add_argument("--seed", type=int, default=1, help="where they lie")
    arguments = options.parse_args()
    found, tracks = things(arguments.things, arguments.seed), Tracks()
    asyncio.run(survey(arguments.names, found, is_arming=arguments.arm, tracks=tracks))
    if arguments.plot is not None:
        tracks.draw(arguments.plot, "A survey with one drop zone", {"things": found, "zone": [(ZONE.x, ZONE.y)]})
    print("all dropped, all landed")


if __name__ == "__main__":
    main()
