"""The asyncio client: one UAV, flown through its daemon."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from typing_extensions import Self, override

from ual import _calls
from ual._calls import Call
from ual._setpoints import EXTERNAL_POSES
from ual._target import DaemonTarget
from ual.aio._connection import Connection
from ual.aio._derived import SimulationMembers, UavMembers
from ual.aio._derived_parts import PartMembers, Parts
from ual.aio._lease import Lease
from ual.aio._setpoints import Setpoints
from ual.aio._subscription import Subscription
from ual.aio._task import Task
from ual.credentials import Credentials
from ual.errors import UalError
from ual.interface import DryRun, TaskCommands
from ual.shared import views
from ual.shared.time_limit import time_limit
from ual.shared.uncopied import Uncopied
from ual.shared.waiting import ends_within
from ual.types import Info, MotionRequest, Plan, State, TaskRequest

if TYPE_CHECKING:
    from ual.network import Network, NetworkSettings

T = TypeVar("T")


class Uav(Uncopied, PartMembers, UavMembers, TaskCommands[Coroutine[Any, Any, Task]]):
    """One UAV, flown through its daemon from one event loop. The members of `ual.interface.Uav` are coroutines here.

    It is made as `ual.Uav` is. A call that is cancelled is cancelled in the daemon, too: a go-to or path ends then, and
    the UAV holds its position.

    Example:
        >>> async with ual.aio.Uav("uav_1") as uav:
        ...     await uav.take_off(3.0)
        ...     await uav.go_to_waypoint(ual.Pose.at(4.0, 2.0, 3.0))
        ...     await uav.land()

    """

    def __init__(
        self,
        ns: str | None = None,
        *,
        address: str | None = None,
        tls_ca: str | Path | None = None,
        credentials: Credentials | None = None,
        network: Network | NetworkSettings | str | Path | None = None,
    ) -> None:
        self._connection = Connection(DaemonTarget(ns, address, tls_ca, credentials, network))
        self._lease: Lease | None = None
        self._setpoints = Setpoints(self._connection)
        self._external_poses = Setpoints(self._connection, EXTERNAL_POSES)
        self._dry_run: DryRun[Coroutine[Any, Any, Plan]] = DryRun(self._plan)
        self._simulation = Simulation(self._connection)
        self._parts = Parts(self._connection)
        self._subscriptions: set[Subscription] = set()

    def __repr__(self) -> str:
        return f"<ual.aio.Uav {self._connection.described}>"

    @property
    def ns(self) -> str:
        """The namespace: as given, as registered on this computer, or as the daemon said in `info`.

        Raises:
            UalError: Only an address was given, and `info` was not called yet.
        """
        ns = self._connection.target.known_ns
        if not ns:
            raise UalError("the namespace is not known yet: call `await uav.info()` first")
        return ns

    @property
    def address(self) -> str:
        """Address of the daemon, even while it does not run."""
        return self._connection.target.address()

    async def close(self) -> None:
        """Ends the setpoints, the subscriptions, the lease and the connection.

        A task of the UAV goes on, unless there was a lease; a velocity does not.
        """
        await self._setpoints.settle()
        try:
            if self._lease is not None:
                await self._lease.release()
        finally:  # also where this task is cancelled while it waits for the daemon
            await self._external_poses.settle()  # raises on another event loop, which could not close the rest
            for subscription in tuple(self._subscriptions):
                await subscription.close()
            await self._connection.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exc: object) -> None:
        await self.close()

    @override
    async def info(self) -> Info:
        info = await super().info()
        self._connection.target.note_ns(info.namespace)
        return info

    async def wait_for(self, *states: State, timeout_s: float | None = None) -> State:
        """Waits until the UAV is in one of some states, and returns that one; see `ual.interface.Uav.wait_for`.

        Raises:
            InvalidArgumentError: No state is given, or one is no `State`.
            UalTimeoutError: None of the states came in time.
        """
        views.require_states(states)
        limit_s = time_limit(timeout_s)
        reaching = asyncio.ensure_future(self._first_of(states))
        if await ends_within(reaching, limit_s):
            return reaching.result()
        raise views.not_reached(states, await self.telemetry(), limit_s)

    async def _first_of(self, states: Sequence[State]) -> State:
        async with self.subscribe() as samples:
            async for sample in samples:
                if sample.state in states:
                    return sample.state
        raise _calls.closed()

    def subscribe(self, rate_hz: float = 0.0) -> Subscription:
        """Returns new samples, to be iterated with ``async for``.

        An iteration that is too slow gets the newest sample, and sees in its `missed_count` how many it lost.

        Args:
            rate_hz: The highest number of samples a second. 0: every update.

        Raises:
            InvalidArgumentError: The rate is no number.

        Example:
            >>> async with uav.subscribe(rate_hz=5.0) as samples:
            ...     async for sample in samples:
            ...         print(sample.state)

        """
        subscription = Subscription(self._connection, _calls.rate(rate_hz), self._subscriptions.discard)
        self._subscriptions.add(subscription)
        return subscription

    @override
    async def _begin(self, request: TaskRequest, blocking: bool, timeout_s: float | None) -> Task:
        return Task(self._connection, await self._command(_calls.begin_task(request, blocking), timeout_s))

    def lease(self, holder: str = "", *, take: bool = False) -> Lease:
        """Returns the lease, to be awaited or to be used in ``async with``; see `ual.interface.Uav.lease`.

        Example:
            >>> async with uav.lease("survey"):
            ...     await uav.take_off(3.0)

        """
        self._lease = Lease(self._connection, holder, take=take, settle=self._setpoints.settle)
        return self._lease

    def extension(self, name: str) -> Any:  # noqa: ANN401 (the package's own)
        """Returns the asyncio client of an extension; see `ual.interface.Uav.extension`.

        Raises:
            NotSupportedError: No package with such a client is installed here.

        """
        from ual import extension
        from ual.aio import extension as aio_extension

        return extension.load(aio_extension.GROUP, name)(aio_extension.Link(self._connection))

    async def task(self, task_id: str) -> Task:
        """Returns the handle of a task that runs, or ended lately.

        Raises:
            InvalidArgumentError: There is no such task.

        """
        return Task(self._connection, await self._connection.run(_calls.get_task(task_id)))

    @property
    def dry_run(self) -> DryRun[Coroutine[Any, Any, Plan]]:
        """The motions as questions, as coroutines: what would happen, without anything moving."""
        return self._dry_run

    @property
    def simulation(self) -> Simulation:
        """The world around a simulated UAV. Its members raise `NotSupportedError` for a real one."""
        return self._simulation

    async def _plan(self, motion: MotionRequest) -> Plan:
        return await self._connection.run(_calls.dry_run(motion))

    @override
    async def _command(self, call: Call[T], timeout_s: float | None = None) -> T:
        """Makes a call that comes after the setpoints given before it: none of them may overtake an abort."""
        await self._setpoints.settle()
        return await self._connection.run(call, timeout_s)


class Simulation(SimulationMembers):
    """The world around a simulated UAV; the members of `ual.interface.Simulation` as coroutines."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Simulation of {self._connection.described}>"
