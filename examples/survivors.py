"""A team that surveys a field, and goes on when it loses one of its members.

``python -m examples.survivors uav_1 uav_2 uav_3 --arm --plot survivors.svg``

Nobody owns a part of the field: each takes the next lane that is left. A member is lost when its daemon, its link or
its autopilot gives up, or its safety pilot takes it over; then its lane is flown by another one. A UAV that is lost is
not commanded any more: its daemon holds or its pilot flies. Each flies at a height of its own.
"""

from __future__ import annotations

import asyncio

import ual
from examples.together import land_if_flying, parser, team_of, together
from examples.tracks import Tracks

LENGTH_M, APART_M = 8.0, 1.5
LOWEST_M, LAYER_M = 2.0, 1.0


class Lanes:
    """The lanes of the field, and the UAV of each."""

    def __init__(self, count: int) -> None:
        self.flown: dict[int, str] = {}
        self._left = list(range(count))
        self._in_work = 0
        self._changed = asyncio.Condition()

    async def take(self) -> int | None:
        """Returns the next lane; None when all are flown. Waits while one that is in work may still come back."""
        async with self._changed:
            await self._changed.wait_for(lambda: self._left or not self._in_work)
            if not self._left:
                return None
            self._in_work += 1
            return self._left.pop(0)

    async def finish(self, lane: int, name: str = "") -> None:
        """Counts a lane as flown by a UAV; without a name it is left again."""
        async with self._changed:
            self._in_work -= 1
            if name:
                self.flown[lane] = name
            else:
                self._left.insert(0, lane)
            self._changed.notify_all()


async def work(name: str, uav: ual.aio.Uav, height_m: float, lanes: Lanes) -> None:
    """Flies lanes until none is left, or until the UAV is lost."""
    try:
        await uav.take_off(height_m)
    except ual.UalError as error:
        print(f"{name} is lost at its take-off: {error.message}", flush=True)
        return
    is_back = False
    while (lane := await lanes.take()) is not None:
        ends = (LENGTH_M, 0.0) if is_back else (0.0, LENGTH_M)
        path = [ual.PoseStamped(ual.Pose.at(x, lane * APART_M, height_m), "map") for x in ends]
        print(f"{name} flies lane {lane}", flush=True)
        try:
            await uav.follow_path(path)
        except ual.UalError as error:
            print(f"{name} is lost in lane {lane}: {error.message}", flush=True)
            await lanes.finish(lane)
            return
        await lanes.finish(lane, name)
        is_back = not is_back


async def survey(names: list[str], count: int, *, is_arming: bool, tracks: Tracks) -> dict[int, str]:
    """Returns the UAV of each lane that was flown.

    Raises:
        RuntimeError: All are lost, and lanes are left.

    """
    lanes = Lanes(count)
    async with ual.aio.Team(names) as team:
        try:
            if is_arming:
                await team.arm()
            async with tracks.kept(team_of(team)):
                heights = [LOWEST_M + LAYER_M * i for i in range(len(names))]
                await together(*(work(name, team[name], z, lanes) for name, z in zip(names, heights, strict=True)))
        finally:
            try:
                await team.ask(land_if_flying)
            except ual.TeamError as error:
                print(f"not all could be asked to land: {error.message}", flush=True)
    if len(lanes.flown) < count:
        raise RuntimeError(f"all are lost, and lanes are left: {sorted(set(range(count)) - set(lanes.flown))}")
    return lanes.flown


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--lanes", type=int, default=8, help="how many lanes the field has")
    arguments = options.parse_args()
    tracks = Tracks()
    flown = asyncio.run(survey(arguments.names, arguments.lanes, is_arming=arguments.arm, tracks=tracks))
    if arguments.plot is not None:
        tracks.draw(arguments.plot, "A team that loses a member", {})
    for name in arguments.names:
        print(f"{name} has flown {sorted(lane for lane, by in flown.items() if by == name)}")
    print("the field is done")


if __name__ == "__main__":
    main()
