"""Several UAVs, flown by one call each."""

from __future__ import annotations

import asyncio
import os
import threading
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Iterator
from concurrent.futures import CancelledError, Future
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from typing_extensions import Self, override

from ual import _forks, aio
from ual._client import Uav
from ual._derived_team import TeamMembers
from ual.credentials import Credentials
from ual.errors import ClientUnusableError, UalError
from ual.interface import DryRun, TaskCommands
from ual.shared.uncopied import Uncopied
from ual.types import MotionRequest, Plan, TaskInfo, TaskKind, TaskRequest

if TYPE_CHECKING:
    from ual._target import NetworkChoice
    from ual.network import Network, NetworkSettings

T = TypeVar("T")


class Team(Uncopied, TeamMembers, TaskCommands[dict[str, "TeamTask"]]):
    """Several UAVs. Its members are those of `ual.Uav`, of all of them at once, with the results by name.

    A member's documentation is that of one UAV. A pose or velocity without a frame is in each one's own ``<ns>/odom``.

    A command goes to all of them at the same moment, once each of them has answered; where one cannot be reached, none
    gets it. What ends a flight (`land`, `return_to_launch`, `abort`, `pause`) goes to all that can be reached. All are
    waited for, also where one refuses or fails; then `ual.TeamError` names the UAV and the reason. Ctrl-C cancels the
    command for all.

    Args:
        uavs: The namespaces of daemons on this computer, or addresses (``host:50051``, ``unix:/run/ual/uav_2.sock``).
            These are the names of the results.
        tls_ca: A file with the certificates to trust, for daemons that use TLS. Default: ``$UAL_TLS_CA``.
        credentials: Credentials that the daemons check. Default: the environment's (`Credentials.from_environment`).
        network: Where names are looked for instead of on this computer; see `ual.Uav`.

    Raises:
        InvalidArgumentError: There is no UAV, or one is named twice.

    Example:
        >>> with ual.Team(["uav_1", "uav_2"]) as team:
        ...     team.take_off(3.0)
        ...     goals = {"uav_1": ual.Pose.at(4.0, 0.0, 3.0), "uav_2": ual.Pose.at(0.0, 4.0, 3.0)}
        ...     team.each(lambda name, uav: uav.go_to_waypoint(goals[name]))
        ...     team.land()

    """

    def __init__(
        self,
        uavs: Iterable[str],
        *,
        tls_ca: str | Path | None = None,
        credentials: Credentials | None = None,
        network: Network | NetworkSettings | str | Path | None = None,
    ) -> None:
        self._loop = _Loop()
        try:
            self._team = self._loop.run(_made(uavs, tls_ca, credentials, network))
        except BaseException:
            self._loop.close()
            raise
        self._tls_ca = tls_ca
        self._credentials = credentials
        self._network = network
        self._uavs: dict[str, Uav] = {}
        self._dry_run: DryRun[dict[str, Plan]] = DryRun(self._plan)

    def __repr__(self) -> str:
        return f"<ual.Team {', '.join(self._team)}>"

    def __getitem__(self, name: str) -> Uav:
        """Returns one UAV, with a connection of its own."""
        if name not in self._team:
            raise KeyError(name)
        if name not in self._uavs:
            if ":" in name:
                uav = Uav(address=name, tls_ca=self._tls_ca, credentials=self._credentials)
            else:
                uav = Uav(name, tls_ca=self._tls_ca, credentials=self._credentials, network=self._network)
            self._uavs[name] = uav
        return self._uavs[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._team)

    def __len__(self) -> int:
        return len(self._team)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connections. Tasks of the UAVs go on; velocities do not."""
        if self._loop.is_closed:
            return
        for uav in self._uavs.values():
            uav.close()
        self._loop.run(self._team.close())
        self._loop.close()

    def each(self, command: Callable[[str, aio.Uav], Coroutine[Any, Any, T]]) -> dict[str, T]:
        """Gives each UAV a command, all at the same moment: different goals, for instance. Returns the results by name.

        Args:
            command: What to do with one UAV, given its name: a call of an `ual.aio.Uav`.

        Raises:
            TeamError: One of them cannot be reached, and none got the command; or one refused or failed.

        """
        return self._loop.run(self._team.each(command))

    def ask(self, call: Callable[[str, aio.Uav], Coroutine[Any, Any, T]]) -> dict[str, T]:
        """Calls something for each UAV that can be reached, at the same time. Returns the results by name.

        Args:
            call: What to do with one UAV, given its name: a call of an `ual.aio.Uav`.

        Raises:
            TeamError: One of them cannot be reached, refused, or failed.

        """
        return self._loop.run(self._team.ask(call))

    def lease(self, holder: str = "", *, take: bool = False) -> TeamLease:
        """Acquires the leases of all of them, or of none; see `ual.interface.Uav.lease`.

        Raises:
            TeamError: One of them is held by another program, or may not be taken.

        Example:
            >>> with team.lease("survey"):
            ...     team.take_off(3.0)

        """
        return TeamLease(self._loop, self._loop.run(self._team.lease(holder, take=take).acquire()))

    @override
    def _begin(self, request: TaskRequest, blocking: bool, timeout_s: float | None) -> dict[str, TeamTask]:
        begun = self._loop.run(self._team._begin(request, blocking, timeout_s))  # noqa: SLF001 (the same base)
        return {name: TeamTask(self._loop, task) for name, task in begun.items()}

    @property
    def dry_run(self) -> DryRun[dict[str, Plan]]:
        """The motions as questions: what would happen, without anything moving."""
        return self._dry_run

    def _plan(self, motion: MotionRequest) -> dict[str, Plan]:
        return self._loop.run(self._team._plan(motion))  # noqa: SLF001 (as above)

    @override
    def _wait(self, coroutine: Coroutine[Any, Any, T]) -> T:
        return self._loop.run(coroutine)


class TeamLease:
    """The leases of a team, until `release` or the end of its ``with`` block."""

    def __init__(self, loop: _Loop, leases: aio.TeamLease) -> None:
        self._loop = loop
        self._leases = leases

    @property
    def lost(self) -> dict[str, UalError]:
        """Leases that have ended by themselves, and the reasons, by name."""
        return self._leases.lost

    def release(self) -> None:
        """Ends those that are held."""
        if not self._loop.is_closed:
            self._loop.run(self._leases.release())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.release()


class TeamTask:
    """The handle of one UAV's task; its members are those of `ual.interface.Task`."""

    def __init__(self, loop: _Loop, task: aio.Task) -> None:
        self._loop = loop
        self._task = task

    def __repr__(self) -> str:
        return repr(self._task)

    @property
    def id(self) -> str:
        """Identifier of the task in the daemon."""
        return self._task.id

    @property
    def kind(self) -> TaskKind:
        """Kind of manoeuvre."""
        return self._task.kind

    def info(self) -> TaskInfo:
        """Returns how it stands now."""
        return self._loop.run(self._task.info())

    def done(self) -> bool:
        """Returns whether it has ended, however it ended."""
        return self._loop.run(self._task.done())

    def wait(self, timeout_s: float | None = None) -> TaskInfo:
        """Blocks until it has ended; see `ual.interface.Task.wait`."""
        return self._loop.run(self._task.wait(timeout_s))

    def cancel(self) -> None:
        """Ends it: the UAV stops and holds its position; see `ual.interface.Task.cancel`."""
        self._loop.run(self._task.cancel())

    def pause(self) -> None:
        """Stops it on its way, and holds there; see `ual.interface.Task.pause`."""
        self._loop.run(self._task.pause())

    def resume(self) -> None:
        """Goes on with it along the rest of its way; see `ual.interface.Task.resume`."""
        self._loop.run(self._task.resume())

    def watch(self, rate_hz: float = 10.0) -> Iterator[TaskInfo]:
        """Yields how it stands, `rate_hz` times a second, until it has ended; the last value says how it ended."""
        samples = self._task.watch(rate_hz)
        while (sample := self._loop.run(_next(samples))) is not None:
            yield sample


class _Loop:
    """An event loop on a thread of its own, which runs coroutines for other threads."""

    def __init__(self) -> None:
        self._process_id = os.getpid()
        self._lock = threading.Lock()
        self._is_closed = False
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="ual team", daemon=True)
        self._thread.start()

    @property
    def is_closed(self) -> bool:
        """Whether `close` was called; in a forked process there is nothing to close."""
        return self._is_parents or self._is_closed

    @property
    def _is_parents(self) -> bool:
        """Whether its thread stayed in the process from which this one was forked."""
        return self._process_id != os.getpid()

    def run(self, coroutine: Coroutine[Any, Any, T]) -> T:
        """Runs a coroutine to its end. An interruption (Ctrl-C) of this thread cancels it.

        Raises:
            UalError: The team is or was closed, or this is the thread of the loop, which would wait for itself.
        """
        future = self._begin(coroutine)
        try:
            return future.result()
        except CancelledError:
            if self.is_closed:
                raise _closed() from None
            raise
        except BaseException:
            future.cancel()
            raise

    def close(self) -> None:
        """Ends what still runs, and the thread."""
        with self._lock:
            if self._is_closed:
                return
            self._is_closed = True
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.run_until_complete(_cancel_others())
        self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        self._loop.close()

    def _begin(self, coroutine: Coroutine[Any, Any, T]) -> Future[T]:
        if self._is_parents:  # its lock may have been held in the fork
            refusal = _forks.asyncio_lost()
        elif threading.current_thread() is self._thread:
            refusal = UalError(
                "a member of a Team was called on its own event loop, which would wait for itself: in `each` and "
                "`ask`, await those of the ual.aio.Uav that is given"
            )
        else:
            with self._lock:
                if not self._is_closed:
                    return asyncio.run_coroutine_threadsafe(coroutine, self._loop)
            refusal = _closed()
        coroutine.close()
        raise refusal


def _closed() -> UalError:
    return ClientUnusableError("the team is closed")


async def _cancel_others() -> None:
    """Cancels all tasks of this loop but this one: their callers wait on other threads."""
    others = asyncio.all_tasks() - {asyncio.current_task()}
    for task in others:
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)


async def _made(
    uavs: Iterable[str],
    tls_ca: str | Path | None,
    credentials: Credentials | None,
    network: NetworkChoice | None,
) -> aio.Team:
    """Makes the team on its loop."""
    return aio.Team(uavs, tls_ca=tls_ca, credentials=credentials, network=network)


async def _next(samples: AsyncIterator[TaskInfo]) -> TaskInfo | None:
    return await anext(samples, None)
