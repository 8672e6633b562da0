"""What the use cases share: coroutines that fail together, and a team that lands."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine, Mapping
from typing import Any

import ual


async def together(*flights: Coroutine[Any, Any, object]) -> None:
    """Runs all. Where one fails, ends the others before it raises: nobody commands a UAV that is about to land."""
    tasks = [asyncio.ensure_future(flight) for flight in flights]
    try:
        await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def team_of(team: ual.aio.Team) -> Mapping[str, ual.aio.Uav]:
    """Returns the UAVs of a team by name."""
    return {name: team[name] for name in team}


async def land_if_flying(_name: str, uav: ual.aio.Uav) -> None:
    """Lands a UAV that is ours to land: neither one on the ground nor one that its pilot flies."""
    if await uav.state() is ual.State.TAKING_OFF:  # only the safety pilot ends a take-off
        await uav.wait_for(*set(ual.State) - {ual.State.TAKING_OFF})
    if await uav.state() is ual.State.FLYING_AUTO:
        await uav.land()
