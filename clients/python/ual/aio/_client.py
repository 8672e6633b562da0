"""The asyncio client: one UAV, flown through its daemon."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from typing_extensions import Self

from ual import _calls, _views
from ual._calls import Call
from ual._target import Target
from ual.aio._connection import Connection
from ual.aio._dry_run import DryRun
from ual.aio._setpoints import Setpoints
from ual.aio._subscription import Subscription
from ual.aio._task import Task
from ual.geometry import PointStamped, Pose, PoseStamped, Transform, Twist, TwistStamped, Vector3
from ual.simulation import Fault
from ual.types import AltitudeReference, Frame, Info, Odometry, PathHeading, State, TaskInfo, Telemetry, Waypoints

T = TypeVar("T")


class Uav:
    """One UAV, flown through its daemon from one event loop; made as `ual.Uav` is."""

    def __init__(self, ns: str | None = None, *, address: str | None = None, tls_ca: str | Path | None = None) -> None:
        self._connection = Connection(Target(ns, address, tls_ca))
        self._setpoints = Setpoints(self._connection)
        self._dry_run = DryRun(self._connection)
        self._simulation = Simulation(self._connection)
        self._subscriptions: set[Subscription] = set()

    async def ns(self) -> str:
        """The namespace; asks the daemon where none was given."""
        return self._connection.target.ns or (await self.info()).namespace

    @property
    def address(self) -> str:
        """Where the daemon is, or would be."""
        return self._connection.target.address()

    async def close(self) -> None:
        """Ends the setpoints, the subscriptions and the connection. The UAV goes on as the interface says."""
        await self._setpoints.settle()
        for subscription in tuple(self._subscriptions):
            await subscription.close()
        await self._connection.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exc: object) -> None:
        await self.close()

    async def info(self) -> Info:
        return await self._connection.run(_calls.get_info())

    async def is_ready(self) -> bool:
        return _views.is_ready(await self.telemetry())

    async def is_idle(self) -> bool:
        return _views.is_idle(await self.telemetry())

    async def state(self) -> State:
        return (await self.telemetry()).state

    async def pose(self) -> PoseStamped:
        return _views.pose(await self.telemetry())

    async def velocity(self) -> TwistStamped:
        return _views.velocity(await self.telemetry())

    async def odometry(self) -> Odometry:
        return _views.odometry(await self.telemetry())

    async def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        return await self._connection.run(_calls.get_transform(target_frame_id, source_frame_id))

    async def reference_pose(self) -> PoseStamped | None:
        return _views.reference_pose(await self.telemetry())

    async def telemetry(self) -> Telemetry:
        return await self._connection.run(_calls.get_telemetry())

    def subscribe(self, rate_hz: float = 0.0) -> Subscription:
        """New samples, at most `rate_hz` (0: every update), to be iterated with ``async for``.

        An iteration that is too slow gets the newest sample and sees in `missed_count` how many it lost.
        """
        subscription = Subscription(self._connection, _calls.rate(rate_hz), self._subscriptions.discard)
        self._subscriptions.add(subscription)
        return subscription

    async def frames(self) -> list[Frame]:
        return await self._connection.run(_calls.list_frames())

    async def add_frame(self, transform: Transform) -> None:
        await self._connection.run(_calls.add_frame(transform))

    async def arm(self, *, timeout_s: float | None = None) -> None:
        await self._command(_calls.arm(), timeout_s)

    async def disarm(self, *, timeout_s: float | None = None) -> None:
        await self._command(_calls.disarm(), timeout_s)

    async def take_off(self, height_m: float, *, blocking: bool = True, timeout_s: float | None = None) -> Task:
        return await self._command_task(_calls.take_off(height_m, blocking), timeout_s)

    async def land(self, *, blocking: bool = True, timeout_s: float | None = None) -> Task:
        return await self._command_task(_calls.land(blocking), timeout_s)

    async def go_to_waypoint(
        self,
        waypoint: PoseStamped | Pose,
        *,
        max_speed_m_s: float | None = None,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> Task:
        return await self._command_task(_calls.go_to_waypoint(waypoint, max_speed_m_s, blocking), timeout_s)

    async def go_to_waypoint_geo(
        self,
        latitude_deg: float,
        longitude_deg: float,
        altitude_m: float,
        altitude_reference: AltitudeReference = AltitudeReference.HOME,
        *,
        yaw_rad: float | None = None,
        max_speed_m_s: float | None = None,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> Task:
        call = _calls.go_to_waypoint_geo(
            latitude_deg, longitude_deg, altitude_m, altitude_reference, yaw_rad, max_speed_m_s, blocking
        )
        return await self._command_task(call, timeout_s)

    async def follow_path(
        self,
        waypoints: Waypoints,
        *,
        corner_radius_m: float = 0.0,
        max_speed_m_s: float | None = None,
        leg_speeds_m_s: Sequence[float] = (),
        heading: PathHeading = PathHeading.WAYPOINTS,
        point_of_interest: PointStamped | Vector3 | None = None,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> Task:
        call = _calls.follow_path(
            waypoints, corner_radius_m, max_speed_m_s, leg_speeds_m_s, heading, point_of_interest, blocking
        )
        return await self._command_task(call, timeout_s)

    async def set_pose(self, pose: PoseStamped | Pose) -> None:
        await self._setpoints.send(_calls.pose_setpoint(pose))

    async def set_velocity(self, velocity: TwistStamped | Twist) -> None:
        await self._setpoints.send(_calls.velocity_setpoint(velocity))

    async def recover_from_manual(self, *, timeout_s: float | None = None) -> None:
        await self._command(_calls.recover_from_manual(), timeout_s)

    async def set_home(self, set_z: bool = False) -> None:
        await self._command(_calls.set_home(set_z))

    async def abort(self, freeze: bool = False) -> None:
        await self._command(_calls.abort(freeze))

    async def task(self, task_id: str) -> Task:
        """A task, running or ended lately, by its id. `InvalidArgumentError` if there is none."""
        return await self._task(_calls.get_task(task_id), None)

    @property
    def dry_run(self) -> DryRun:
        """The motions, as questions: what would happen, without anything moving."""
        return self._dry_run

    @property
    def simulation(self) -> Simulation:
        """The world around a simulated UAV. Its members raise `NotSupportedError` for a real one."""
        return self._simulation

    async def _command(self, call: Call[T], timeout_s: float | None = None) -> T:
        """Makes a call that comes after the setpoints given before it: none of them may overtake an abort."""
        await self._setpoints.settle()
        return await self._connection.run(call, timeout_s)

    async def _command_task(self, call: Call[TaskInfo], timeout_s: float | None) -> Task:
        return Task(self._connection, await self._command(call, timeout_s))

    async def _task(self, call: Call[TaskInfo], timeout_s: float | None) -> Task:
        return Task(self._connection, await self._connection.run(call, timeout_s))


class Simulation:
    """The world around a simulated UAV; the members of `ual.interface.Simulation` as coroutines."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    async def pilot_arm(self) -> None:
        await self._connection.run(_calls.pilot_arm())

    async def pilot_disarm(self) -> None:
        await self._connection.run(_calls.pilot_disarm())

    async def pilot_take_over(self) -> None:
        await self._connection.run(_calls.pilot_take_over())

    async def pilot_move_sticks(
        self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0
    ) -> None:
        await self._connection.run(_calls.pilot_move_sticks(forward, left, up, turn))

    async def pilot_give_back(self) -> None:
        await self._connection.run(_calls.pilot_give_back())

    async def begin_fault(self, fault: Fault, duration_s: float = 0.0) -> str:
        return await self._connection.run(_calls.begin_fault(fault, duration_s))

    async def end_fault(self, fault_id: str = "") -> None:
        await self._connection.run(_calls.end_fault(fault_id))

    async def faults(self) -> dict[str, Fault]:
        return await self._connection.run(_calls.list_faults())

    async def set_speed_factor(self, speed_factor: float) -> None:
        await self._connection.run(_calls.set_speed_factor(speed_factor))

    async def step(self, duration_s: float) -> None:
        await self._connection.run(_calls.step(duration_s))

    async def set_noise(self, *, position_m: float, velocity_m_s: float) -> None:
        await self._connection.run(_calls.set_noise(position_m, velocity_m_s))

    async def set_wind(self, velocity_m_s: Vector3) -> None:
        await self._connection.run(_calls.set_wind(velocity_m_s))
