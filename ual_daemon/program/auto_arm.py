"""Has a simulated safety pilot arm the UAV whenever it is ready on the ground, so that one person at a desk can fly."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from ual.errors import PermissionDeniedError, UalError
from ual.types import State
from ual_daemon import logs
from ual_daemon.backends.base import Clock, SafetyPilot
from ual_daemon.server.telemetry_stream import Updates

_log = logging.getLogger(__name__)

_READY_TIME_S = 1.0
_CHECK_PERIOD_S = 0.1


async def auto_arm(pilot: SafetyPilot, clock: Clock, updates: Updates, why_not: Callable[[], str] = str) -> None:
    """Arms whenever the UAV has been disarmed and ready for 1 s of its own time. Runs until it is cancelled.

    `why_not` returns why it is not to be armed, human-readable: in a mode in which that would start a flight. Ends,
    without sending anything, if the vehicle is found not to be simulated. Uses no processor time unless the UAV is
    disarmed on the ground.
    """
    since_s: float | None = None
    refused = ""
    while True:
        if updates.state is not State.LANDED_DISARMED:
            since_s = None
            await updates.change()
            continue
        try:
            may_arm = pilot.may_arm()
        except PermissionDeniedError as error:
            logs.event(_log, logging.ERROR, "auto_arm_ended", why=error)
            return
        now_s, why = clock.now_s(), why_not()
        if why and why != refused:
            logs.event(_log, logging.WARNING, "auto_arm_waits", why=f"{why}: select another mode, or arm by command")
            refused = why
        may_arm = may_arm and not why
        since_s = (now_s if since_s is None else since_s) if may_arm else None
        if since_s is not None and now_s - since_s >= _READY_TIME_S:
            since_s = None
            try:
                await asyncio.to_thread(pilot.arm)
            except UalError as error:
                if str(error) != refused:
                    logs.event(_log, logging.WARNING, "auto_arm_refused", why=error)
                refused = str(error)
            else:
                refused = ""
        # A simulation's clock may run at any speed, stand still or be stepped: so it has to be polled.
        await updates.change(_CHECK_PERIOD_S)
