"""Several UAVs, flown from one event loop by one call each."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable, Coroutine, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from typing_extensions import Self, override

from ual.aio._client import Uav
from ual.aio._derived_team import TeamMembers
from ual.aio._lease import Lease
from ual.aio._task import Task
from ual.credentials import Credentials
from ual.errors import InvalidArgumentError, TeamError, UalError
from ual.interface import DryRun, TaskCommands
from ual.shared.uncopied import Uncopied
from ual.types import LandRequest, MotionRequest, Plan, ReturnToLaunchRequest, TaskRequest

_ENDS_A_FLIGHT = (LandRequest, ReturnToLaunchRequest)

if TYPE_CHECKING:
    from ual._target import NetworkChoice
    from ual.network import Network, NetworkSettings

T = TypeVar("T")
All = Coroutine[Any, Any, dict[str, T]]
"""Coroutine that returns one value of each UAV, by name."""


class Team(Uncopied, TeamMembers, TaskCommands[All[Task]]):
    """Several UAVs. Its members are those of `ual.aio.Uav`, of all of them at once, with the results by name.

    A member's documentation is that of one UAV. A pose or velocity without a frame is in each one's own ``<ns>/odom``.

    A command goes to all of them at the same moment, once each of them has answered; where one cannot be reached, none
    gets it. What ends a flight (`land`, `return_to_launch`, `abort`, `pause`) goes to all that can be reached. All are
    waited for, also where one refuses or fails; then `TeamError` names the UAV and the reason.

    Args:
        uavs: The namespaces of daemons on this computer, or addresses (``host:50051``, ``unix:/run/ual/uav_2.sock``).
            These are the names of the results.
        tls_ca: A file with the certificates to trust, for daemons that use TLS. Default: ``$UAL_TLS_CA``.
        credentials: Credentials that the daemons check. Default: the environment's (`Credentials.from_environment`).
        network: Where names are looked for instead of on this computer; see `ual.Uav`.

    Raises:
        InvalidArgumentError: There is no UAV, or one is named twice.

    Example:
        >>> async with ual.aio.Team(["uav_1", "uav_2"]) as team:
        ...     await team.take_off(3.0)
        ...     goals = {"uav_1": ual.Pose.at(4.0, 0.0, 3.0), "uav_2": ual.Pose.at(0.0, 4.0, 3.0)}
        ...     await team.each(lambda name, uav: uav.go_to_waypoint(goals[name]))
        ...     await team.land()

    """

    def __init__(
        self,
        uavs: Iterable[str],
        *,
        tls_ca: str | Path | None = None,
        credentials: Credentials | None = None,
        network: Network | NetworkSettings | str | Path | None = None,
    ) -> None:
        names = _checked(uavs)
        self._uavs = {name: _uav(name, tls_ca, credentials, network) for name in names}
        self._dry_run: DryRun[All[Plan]] = DryRun(self._plan)

    def __repr__(self) -> str:
        return f"<ual.aio.Team {', '.join(self._uavs)}>"

    def __getitem__(self, name: str) -> Uav:
        return self._uavs[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._uavs)

    def __len__(self) -> int:
        return len(self._uavs)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exc: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Closes the connections. Tasks of the UAVs go on; velocities do not."""
        await asyncio.gather(*(uav.close() for uav in self._uavs.values()))

    @override
    async def ask(self, call: Callable[[str, Uav], Coroutine[Any, Any, T]]) -> dict[str, T]:
        """Calls something for each UAV at the same time. Returns the results by name.

        Args:
            call: What to do with one UAV, given its name.

        Raises:
            TeamError: One of them refused or failed; it has the errors and the other results.

        """
        calls = [_awaitable(call(name, uav)) for name, uav in self._uavs.items()]
        outcomes = await asyncio.gather(*calls, return_exceptions=True)
        return _results(dict(zip(self._uavs, outcomes, strict=True)))

    @override
    async def each(self, command: Callable[[str, Uav], Coroutine[Any, Any, T]]) -> dict[str, T]:
        """Gives each UAV a command, all at the same moment: different goals, for instance. Returns the results by name.

        Args:
            command: What to do with one UAV, given its name.

        Raises:
            TeamError: One of them cannot be reached, and none got the command; or one refused or failed.

        """
        await self.info()
        return await self.ask(command)

    def lease(self, holder: str = "", *, take: bool = False) -> TeamLease:
        """Returns the leases of all of them, to be used in ``async with``; see `ual.interface.Uav.lease`.

        Where one cannot be had, none is kept.

        Example:
            >>> async with team.lease("survey"):
            ...     await team.take_off(3.0)

        """
        return TeamLease(self, holder, take=take)

    @override
    async def _begin(self, request: TaskRequest, blocking: bool, timeout_s: float | None) -> dict[str, Task]:
        give = self.ask if isinstance(request, _ENDS_A_FLIGHT) else self.each
        return await give(lambda _, uav: uav._begin(request, blocking, timeout_s))  # noqa: SLF001 (the same base)

    @property
    def dry_run(self) -> DryRun[All[Plan]]:
        """The motions as questions, as coroutines: what would happen, without anything moving."""
        return self._dry_run

    async def _plan(self, motion: MotionRequest) -> dict[str, Plan]:
        return await self.ask(lambda _, uav: uav._plan(motion))  # noqa: SLF001 (as above)


class TeamLease:
    """The leases of a team, from `acquire` (or the beginning of its ``async with`` block) until `release`."""

    def __init__(self, team: Team, holder: str, *, take: bool) -> None:
        self._team = team
        self._holder = holder
        self._take = take
        self._leases: dict[str, Lease] = {}

    @property
    def lost(self) -> dict[str, UalError]:
        """Leases that have ended by themselves, and the reasons, by name."""
        return {name: lease.lost for name, lease in self._leases.items() if lease.lost is not None}

    async def acquire(self) -> Self:
        """Acquires all of them, or none.

        Raises:
            TeamError: One of them is held by another program, or may not be taken.

        """
        self._leases = {name: self._team[name].lease(self._holder, take=self._take) for name in self._team}
        try:
            await self._team.each(lambda name, _: self._leases[name].acquire())
        except BaseException:
            await self.release()
            raise
        return self

    async def release(self) -> None:
        """Ends those that are held."""
        await asyncio.gather(*(lease.release() for lease in self._leases.values()))

    async def __aenter__(self) -> Self:
        return await self.acquire()

    async def __aexit__(self, *exc: object) -> None:
        await self.release()


def _checked(uavs: Iterable[str]) -> list[str]:
    names = list(uavs)
    if isinstance(uavs, str) or not names or not all(isinstance(name, str) and name for name in names):
        raise InvalidArgumentError(f"uavs: names or addresses are needed, not {uavs!r}", {"field": "uavs"})
    if len(set(names)) < len(names):
        raise InvalidArgumentError(f"uavs: one is named twice: {', '.join(names)}", {"field": "uavs"})
    return names


def _awaitable(call: Coroutine[Any, Any, T]) -> Coroutine[Any, Any, T]:
    if not inspect.isawaitable(call):
        raise InvalidArgumentError(
            f"call: it returned {call!r}, which is no coroutine: return a call of the ual.aio.Uav that is given"
        )
    return call


def _uav(
    name: str,
    tls_ca: str | Path | None,
    credentials: Credentials | None,
    network: NetworkChoice | None,
) -> Uav:
    if ":" in name:
        return Uav(address=name, tls_ca=tls_ca, credentials=credentials)
    return Uav(name, tls_ca=tls_ca, credentials=credentials, network=network)


def _results(outcomes: Mapping[str, T | BaseException]) -> dict[str, T]:
    errors = {name: outcome for name, outcome in outcomes.items() if isinstance(outcome, UalError)}
    results: dict[str, T] = {}
    for name, outcome in outcomes.items():
        if not isinstance(outcome, BaseException):
            results[name] = outcome
        elif name not in errors:
            raise outcome  # a mistake, or the cancellation of this call
    if errors:
        raise TeamError(errors, results)
    return results
