"""The client for asyncio programs: `ual.aio.Uav` has the members of `ual.Uav` as coroutines.

>>> async def fly():
...     async with ual.aio.Uav("uav_1") as uav:
...         await uav.take_off(3.0)
...         async for telemetry in uav.subscribe(rate_hz=1.0):
...             print(telemetry.pose)
"""

from __future__ import annotations

from ual.aio._client import Simulation, Uav
from ual.aio._derived_parts import Corrections, Fence, Logs, Parameters
from ual.aio._lease import Lease
from ual.aio._subscription import Subscription
from ual.aio._task import Task
from ual.aio._team import Team, TeamLease

__all__ = [
    "Corrections",
    "Fence",
    "Lease",
    "Logs",
    "Parameters",
    "Simulation",
    "Subscription",
    "Task",
    "Team",
    "TeamLease",
    "Uav",
]
