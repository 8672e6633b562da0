"""A simulated safety pilot who arms whenever the UAV stands ready, so that one person at a desk can fly."""

from __future__ import annotations

import asyncio
import logging

from ual.errors import UalError
from ual.types import State
from ual_daemon import logs
from ual_daemon.server.updates import Updates
from ual_daemon.vehicle import Vehicle

_log = logging.getLogger(__name__)

_STANDS_S = 1.0


async def auto_arm(vehicle: Vehicle, updates: Updates) -> None:
    """Arms once the UAV has stood disarmed for 1 s of its own time, again and again, until cancelled."""
    simulation = vehicle.simulation()
    since_s: float | None = None
    with updates.reader() as reader:
        while True:
            sample, _ = await reader.read()
            if sample.telemetry.state is not State.LANDED_DISARMED:
                since_s = None
                continue
            now_s = vehicle.backend.clock.now_s()
            since_s = now_s if since_s is None else since_s
            if now_s - since_s >= _STANDS_S:
                since_s = None
                try:
                    await asyncio.to_thread(simulation.pilot_arm)
                except UalError as error:
                    logs.event(_log, logging.WARNING, "auto_arm_refused", why=error)
