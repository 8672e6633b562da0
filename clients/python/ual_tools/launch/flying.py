"""Flights of a team's UAVs: observed in their telemetry, and landed by one call each."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable

from ual import aio
from ual.errors import DaemonUnreachableError, UalError
from ual.types import State, Telemetry
from ual_tools.output import error_text

_TELEMETRY_RATE_HZ = 5.0
_LAND_RETRY_S = 0.2
_HOLDER = "ual launch"
_COMMANDED = (State.TAKING_OFF, State.FLYING_AUTO, State.LANDING)
IN_THE_AIR = (*_COMMANDED, State.FLYING_MANUAL)
_ON_GROUND = (State.LANDED_DISARMED, State.LANDED_ARMED)
_DECIDED = (*_ON_GROUND, State.FLYING_AUTO, State.FLYING_MANUAL)
"""A take-off or landing that runs comes to its end first."""
SENDS_NOTHING = "sends nothing"
"""Part of the daemon's reason for a flight that is not UAL's any more (docs/concepts/who-flies.md)."""


class Watched:
    """One UAV: its state, and whether UAL flies it. Follows its daemon through restarts."""

    def __init__(self, ns: str, on_state: Callable[[State], None]) -> None:
        self.ns = ns
        self.state: State | None = None
        self.is_in_control = False
        """Stays while its daemon is away: what it flew, nobody else has taken."""
        self._is_commanded = False
        """By the daemon that runs now: from it a UAV can be taken. After a restart, a failsafe is nobody."""
        self._on_state = on_state

    async def follow(self, address: str) -> None:
        """Follows the telemetry of a daemon until it ends."""
        try:
            async with _client(self.ns, address) as uav, uav.subscribe(_TELEMETRY_RATE_HZ) as samples:
                async for telemetry in samples:
                    self.see(telemetry)
        except UalError:
            return
        finally:
            self.gone()

    def gone(self) -> None:
        """Takes note that its daemon has ended."""
        self.state = None
        self._is_commanded = False

    async def sample_now(self, address: str) -> None:
        """Takes one sample now: the last one of `follow` may be older than a command."""
        with contextlib.suppress(UalError):
            async with _client(self.ns, address) as uav:
                self.see(await uav.telemetry())

    def see(self, telemetry: Telemetry) -> None:
        """Takes one sample."""
        state, before = telemetry.state, self.state
        self.state = state
        if state in _COMMANDED and SENDS_NOTHING not in telemetry.state_reason:
            self.is_in_control = self._is_commanded = True
        elif state in _ON_GROUND or (state is State.FLYING_MANUAL and self._is_commanded):
            self.is_in_control = self._is_commanded = False
        if state is not before:
            self._on_state(state)


def _client(ns: str, address: str) -> aio.Uav:
    """Returns a client of a daemon of the team, which the environment's certificates are not for."""
    return aio.Uav(ns, address=address, tls_ca="")


async def land(watched: Watched, address: Callable[[], str | None], limit_s: float) -> str | None:
    """Lands a UAV that UAL flies, and returns None when it stands; else why it does not.

    A daemon that is started again meanwhile is asked again.
    """
    end_s = time.monotonic() + limit_s
    while watched.is_in_control and (left_s := end_s - time.monotonic()) > 0.0:
        where = address()
        if where is not None:
            try:
                async with _client(watched.ns, where) as uav:
                    await uav.wait_for(*_DECIDED, timeout_s=left_s)
                    watched.see(await uav.telemetry())
                    if not watched.is_in_control:  # it stands, or others have taken it meanwhile
                        break
                    async with uav.lease(_HOLDER, take=True):  # the team's programs may have it
                        await uav.land(timeout_s=max(end_s - time.monotonic(), _LAND_RETRY_S))
            except DaemonUnreachableError:
                pass
            except UalError as error:
                return error_text(error)
            else:
                return None
        await asyncio.sleep(_LAND_RETRY_S)
    if watched.is_in_control:
        return f"not on the ground after {limit_s:g} s"
    return "others fly it by now" if watched.state in IN_THE_AIR else None


async def abort(ns: str, address: str) -> str | None:
    """Stops a UAV, so that it holds its position. Returns why it cannot."""
    try:
        async with _client(ns, address) as uav, uav.lease(_HOLDER, take=True):
            await uav.abort()
    except UalError as error:
        return error_text(error)
    return None
