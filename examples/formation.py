"""Flies a square with several UAVs at once, in the formation in which they stand.

``python examples/formation.py uav_1 uav_2 uav_3``; ``--arm`` arms them, where their daemons may.
"""

import argparse
import asyncio
from collections.abc import Coroutine, Iterable
from contextlib import AsyncExitStack
from typing import Any

import ual
import ual.aio

HEIGHT_M = 1.0
CORNERS = ((1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0))


async def together(calls: Iterable[Coroutine[Any, Any, object]]) -> None:
    """Waits for all, also where one fails, so that no UAV is left in the middle of a motion. Raises the first error."""
    for result in await asyncio.gather(*calls, return_exceptions=True):
        if isinstance(result, BaseException):
            raise result


async def fly(team: list[ual.aio.Uav]) -> None:
    """Flies the square with UAVs that are armed. Whatever fails, those in the air land."""
    try:
        await together(uav.take_off(HEIGHT_M) for uav in team)
        for x, y in CORNERS:  # of each UAV's own odom, whose origin is where it stood
            await together(uav.go_to_waypoint(ual.Pose.at(x, y, HEIGHT_M)) for uav in team)
            print(f"all at {x:g}, {y:g}")
    finally:
        await together([uav.land() for uav in team if await uav.state() is ual.State.FLYING_AUTO])


async def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="+", metavar="NAME")
    parser.add_argument("--arm", action="store_true")
    arguments = parser.parse_args()
    async with AsyncExitStack() as opened:
        team = [await opened.enter_async_context(ual.aio.Uav(name)) for name in arguments.names]
        if arguments.arm:
            await together(uav.arm() for uav in team)
        await fly(team)
    print("all landed")


if __name__ == "__main__":
    asyncio.run(main())
