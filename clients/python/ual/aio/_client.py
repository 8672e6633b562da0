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
from ual._target import Target
from ual.aio._connection import Connection
from ual.aio._lease import Lease
from ual.aio._setpoints import Setpoints
from ual.aio._subscription import Subscription
from ual.aio._task import Task
from ual.credentials import Credentials
from ual.errors import UalError
from ual.geometry import Pose, PoseStamped, Transform, Twist, TwistStamped, Vector3, stamped_pose, stamped_twist
from ual.interface import DryRun, TaskCommands
from ual.shared import views
from ual.shared.time_limit import time_limit
from ual.simulation import Fault, SimulationPart
from ual.types import (
    ExternalPose,
    Frame,
    Geofence,
    Info,
    LeaseInfo,
    MotionRequest,
    Odometry,
    Plan,
    Route,
    State,
    TaskRequest,
    Telemetry,
)

if TYPE_CHECKING:
    from ual.network import Network

T = TypeVar("T")


class Uav(TaskCommands[Coroutine[Any, Any, Task]]):
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
        network: Network | None = None,
    ) -> None:
        self._connection = Connection(Target(ns, address, tls_ca, credentials, network))
        self._lease: Lease | None = None
        self._setpoints = Setpoints(self._connection)
        self._external_poses = Setpoints(self._connection, EXTERNAL_POSES)
        self._dry_run: DryRun[Coroutine[Any, Any, Plan]] = DryRun(self._plan)
        self._simulation = Simulation(self._connection)
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
        """Where the daemon is, or would be."""
        return self._connection.target.address()

    async def close(self) -> None:
        """Ends the setpoints, the subscriptions, the lease and the connection.

        A task of the UAV goes on, unless there was a lease; a velocity does not.
        """
        await self._setpoints.settle()
        if self._lease is not None:
            await self._lease.release()
        await self._external_poses.settle()
        for subscription in tuple(self._subscriptions):
            await subscription.close()
        await self._connection.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exc: object) -> None:
        await self.close()

    async def info(self) -> Info:
        """Returns who the UAV is and what it can do; see `ual.interface.Uav.info`."""
        info = await self._connection.run(_calls.get_info())
        self._connection.target.note_ns(info.namespace)
        return info

    async def telemetry(self) -> Telemetry:
        """Returns the newest sample of everything known; see `ual.interface.Uav.telemetry`."""
        return await self._connection.run(_calls.get_telemetry())

    async def state(self) -> State:
        """Returns the state, estimated from the newest data of the autopilot."""
        return (await self.telemetry()).state

    async def wait_for(self, *states: State, timeout_s: float | None = None) -> State:
        """Waits until the UAV is in one of some states, and returns that one; see `ual.interface.Uav.wait_for`.

        Raises:
            InvalidArgumentError: No state is given, or one is no `State`.
            UalTimeoutError: None of the states came in time.
        """
        views.require_states(states)
        limit_s = time_limit(timeout_s)
        try:
            return await asyncio.wait_for(self._first_of(states), limit_s)
        except asyncio.TimeoutError:
            raise views.not_reached(states, await self.telemetry(), limit_s) from None

    async def _first_of(self, states: Sequence[State]) -> State:
        async with self.subscribe() as samples:
            async for sample in samples:
                if sample.state in states:
                    return sample.state
        raise _calls.closed()

    async def is_ready(self) -> bool:
        """Returns True when the state is not UNINITIALIZED."""
        return views.is_ready(await self.telemetry())

    async def is_idle(self) -> bool:
        """Returns True when no task runs."""
        return views.is_idle(await self.telemetry())

    async def pose(self) -> PoseStamped:
        """Returns the pose of the body; see `ual.interface.Uav.pose`.

        Raises:
            WrongStateError: The pose is not known (yet).

        """
        return views.pose(await self.telemetry())

    async def velocity(self) -> TwistStamped:
        """Returns the velocity in m/s and rad/s; see `ual.interface.Uav.velocity`.

        Raises:
            WrongStateError: The velocity is not known (yet).

        """
        return views.velocity(await self.telemetry())

    async def odometry(self) -> Odometry:
        """Returns the pose with the velocity in the body; see `ual.interface.Uav.odometry`.

        Raises:
            WrongStateError: The odometry is not known (yet).

        """
        return views.odometry(await self.telemetry())

    async def reference_pose(self) -> PoseStamped | None:
        """Returns where the UAV is commanded to be now; None while no pose is commanded."""
        return views.reference_pose(await self.telemetry())

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

    async def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        """Returns what takes coordinates from a frame to another; see `ual.interface.Uav.transform`."""
        return await self._connection.run(_calls.get_transform(target_frame_id, source_frame_id))

    async def frames(self) -> list[Frame]:
        """Returns all frames, each with its parent."""
        return await self._connection.run(_calls.list_frames())

    async def geofence(self) -> Geofence:
        """Returns where the UAV may fly; see `ual.interface.Uav.geofence`."""
        return await self._connection.run(_calls.get_geofence())

    async def route(self) -> Route | None:
        """Returns the way that is flown, if one is known; see `ual.interface.Uav.route`."""
        return await self._connection.run(_calls.get_route())

    async def add_frame(self, transform: Transform) -> None:
        """Adds a frame, or moves one that was added; see `ual.interface.Uav.add_frame`."""
        await self._connection.run(_calls.add_frame(transform))

    async def remove_frame(self, frame_id: str) -> None:
        """Removes a frame that was added; see `ual.interface.Uav.remove_frame`."""
        await self._connection.run(_calls.remove_frame(frame_id))

    async def set_home(self, set_z: bool = False) -> None:
        """Makes the present position the origin of ``<ns>/odom``; see `ual.interface.Uav.set_home`."""
        await self._command(_calls.set_home(set_z))

    async def arm(self, *, timeout_s: float | None = None) -> None:
        """Arms the motors, in LANDED_DISARMED; see `ual.interface.Uav.arm`."""
        await self._command(_calls.arm(), timeout_s)

    async def disarm(self, *, timeout_s: float | None = None) -> None:
        """Disarms the motors, in LANDED_ARMED; see `ual.interface.Uav.disarm`."""
        await self._command(_calls.disarm(), timeout_s)

    @override
    async def _begin(self, request: TaskRequest, blocking: bool, timeout_s: float | None) -> Task:
        return Task(self._connection, await self._command(_calls.begin_task(request, blocking), timeout_s))

    async def set_pose(self, pose: PoseStamped | Pose) -> None:
        """Sends a pose as the reference, in FLYING_AUTO; see `ual.interface.Uav.set_pose`."""
        await self._setpoints.send(_calls.setpoint(stamped_pose(pose), "pose"))

    async def set_velocity(self, velocity: TwistStamped | Twist) -> None:
        """Sends a velocity as the reference, in FLYING_AUTO; see `ual.interface.Uav.set_velocity`."""
        await self._setpoints.send(_calls.setpoint(stamped_twist(velocity), "velocity"))

    async def set_external_pose(
        self,
        pose: PoseStamped | Pose,
        *,
        position_std_dev_m: float | None = None,
        orientation_std_dev_rad: float | None = None,
    ) -> None:
        """Gives the autopilot a pose that was measured from outside; see `ual.interface.Uav.set_external_pose`."""
        measured = ExternalPose(stamped_pose(pose), position_std_dev_m, orientation_std_dev_rad)
        await self._external_poses.send(_calls.external_pose(measured))

    async def recover_from_manual(self, *, force: bool = False, timeout_s: float | None = None) -> None:
        """Takes control back, in FLYING_MANUAL; see `ual.interface.Uav.recover_from_manual`."""
        await self._command(_calls.recover_from_manual(force), timeout_s)

    async def abort(self, freeze: bool = False) -> None:
        """Cancels the task or reference, and stops the UAV; see `ual.interface.Uav.abort`."""
        await self._command(_calls.abort(freeze))

    async def pause(self) -> None:
        """Stops the running task on its way; see `ual.interface.Uav.pause`."""
        await self._command(_calls.pause())

    async def resume(self) -> None:
        """Goes on with the paused task; see `ual.interface.Uav.resume`."""
        await self._command(_calls.resume())

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

    async def lease_info(self) -> LeaseInfo | None:
        """Returns who holds the lease; None where nobody does."""
        return await self._connection.run(_calls.get_lease())

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

    async def _command(self, call: Call[T], timeout_s: float | None = None) -> T:
        """Makes a call that comes after the setpoints given before it: none of them may overtake an abort."""
        await self._setpoints.settle()
        return await self._connection.run(call, timeout_s)


class Simulation:
    """The world around a simulated UAV; the members of `ual.interface.Simulation` as coroutines."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Simulation of {self._connection.described}>"

    async def parts(self) -> frozenset[SimulationPart]:
        """Returns the parts that this simulation offers; see `ual.interface.Simulation.parts`."""
        return await self._connection.run(_calls.list_parts())

    async def pilot_arm(self) -> None:
        """Arms, as the safety pilot does; see `ual.interface.Simulation.pilot_arm`."""
        await self._connection.run(_calls.pilot_arm())

    async def pilot_disarm(self) -> None:
        """Disarms, as the safety pilot does; see `ual.interface.Simulation.pilot_disarm`."""
        await self._connection.run(_calls.pilot_disarm())

    async def pilot_take_over(self) -> None:
        """Switches to a mode in which the safety pilot flies; see `ual.interface.Simulation.pilot_take_over`."""
        await self._connection.run(_calls.pilot_take_over())

    async def pilot_move_sticks(
        self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0
    ) -> None:
        """Moves the sticks, each from -1 to 1; see `ual.interface.Simulation.pilot_move_sticks`."""
        await self._connection.run(_calls.pilot_move_sticks(forward, left, up, turn))

    async def pilot_give_back(self) -> None:
        """Switches back to the mode that takes references from UAL; see `ual.interface.Simulation.pilot_give_back`."""
        await self._connection.run(_calls.pilot_give_back())

    async def begin_fault(self, fault: Fault, duration_s: float = 0.0) -> str:
        """Begins a fault, and returns its identifier; see `ual.interface.Simulation.begin_fault`."""
        return await self._connection.run(_calls.begin_fault(fault, duration_s))

    async def end_fault(self, fault_id: str = "") -> None:
        """Ends a fault, or all of them; see `ual.interface.Simulation.end_fault`."""
        await self._connection.run(_calls.end_fault(fault_id))

    async def faults(self) -> dict[str, Fault]:
        """Returns the faults that are active, by their identifiers; see `ual.interface.Simulation.faults`."""
        return await self._connection.run(_calls.list_faults())

    async def set_speed_factor(self, speed_factor: float) -> None:
        """Sets how fast simulated time passes; see `ual.interface.Simulation.set_speed_factor`."""
        await self._connection.run(_calls.set_speed_factor(speed_factor))

    async def step(self, duration_s: float) -> None:
        """Lets simulated time pass; see `ual.interface.Simulation.step`."""
        await self._connection.run(_calls.step(duration_s))

    async def set_noise(self, *, position_m: float, velocity_m_s: float) -> None:
        """Sets the noise of the estimate; see `ual.interface.Simulation.set_noise`."""
        await self._connection.run(_calls.set_noise(position_m, velocity_m_s))

    async def set_wind(self, velocity_m_s: Vector3) -> None:
        """Sets the wind; see `ual.interface.Simulation.set_wind`."""
        await self._connection.run(_calls.set_wind(velocity_m_s))

    async def place_on_ground(self, position: Vector3, yaw_rad: float = 0.0) -> None:
        """Puts the UAV on the ground at a place; see `ual.interface.Simulation.place_on_ground`."""
        await self._connection.run(_calls.place_on_ground(position, yaw_rad))
