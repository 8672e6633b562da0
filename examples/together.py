"""Common part of the use cases: their options, a team that lands whatever fails, and telemetry while a UAV is flown."""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import AsyncIterator, Coroutine, Iterable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import ual


def parser(doc: str | None, names_count: int | str | None = "+") -> argparse.ArgumentParser:
    """Returns a parser of the names of UAVs (`names`; None: one UAV, `name`), of ``--arm`` and of ``--plot``."""
    made = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    if names_count is None:
        made.add_argument("name", metavar="NAME")
    else:
        made.add_argument("names", nargs=names_count, metavar="NAME")
    made.add_argument("--arm", action="store_true", help="arm, where the daemon may")
    made.add_argument("--plot", type=Path, metavar="FILE", help="draw where they were (PNG, SVG or PDF)")
    return made


@asynccontextmanager
async def landing_team(names: Iterable[str], *, is_arming: bool) -> AsyncIterator[ual.aio.Team]:
    """Connects, arms if it is to, and lands those that are ours to land when the block ends or fails."""
    async with ual.aio.Team(names) as team:
        try:
            if is_arming:
                await team.arm()
            yield team
        finally:
            await team.ask(land_if_flying)


async def together(*flights: Coroutine[Any, Any, object]) -> None:
    """Runs all. Where one fails, ends the others before it raises: nobody commands a UAV that is about to land."""
    tasks = [asyncio.ensure_future(flight) for flight in flights]
    try:
        await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def next_in_flight(ns: str, samples: ual.aio.Subscription) -> ual.Telemetry:
    """Returns the next sample of a UAV that is flown by programs.

    Raises:
        WrongStateError: It is not any more: its safety pilot, a failsafe or another caller has it.
        DaemonUnreachableError: Nothing comes any more.

    """
    sample = await samples.__anext__()
    if sample.state is not ual.State.FLYING_AUTO:
        raise ual.WrongStateError(f"{ns}: {sample.state.name}: {sample.state_reason}")
    return sample


def team_of(team: ual.aio.Team) -> Mapping[str, ual.aio.Uav]:
    """Returns the UAVs of a team by name."""
    return {name: team[name] for name in team}


async def land_if_flying(_name: str, uav: ual.aio.Uav) -> None:
    """Lands a UAV that is ours to land: neither one on the ground nor one that its pilot flies."""
    if await uav.state() is ual.State.TAKING_OFF:  # only the safety pilot ends a take-off
        await uav.wait_for(*set(ual.State) - {ual.State.TAKING_OFF})
    if await uav.state() is ual.State.FLYING_AUTO:
        await uav.land()
