"""The client for asyncio programs: `ual.aio.Uav` has the members of `ual.Uav` as coroutines.

>>> async def fly():
...     async with ual.aio.Uav("uav_1") as uav:
...         await uav.take_off(3.0)
...         async for telemetry in uav.subscribe(rate_hz=1.0):
...             print(telemetry.pose)
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import grpc
import grpc.aio
from typing_extensions import Self

from ual import _calls, _views, convert, rpc_errors
from ual._calls import Call
from ual._setpoints import CONTINUES_S, STALE_S
from ual._subscription import RETRY_S
from ual._target import CHANNEL_OPTIONS, Stubs, Target
from ual._task import WAIT_RATE_HZ, has_not_ended
from ual.errors import DaemonUnreachableError, InvalidArgumentError, UalError, WrongStateError
from ual.geometry import Pose, PoseStamped, Transform, Twist, TwistStamped, Vector3
from ual.simulation import Fault
from ual.types import AltitudeReference, Frame, Info, Odometry, State, TaskInfo, TaskKind, Telemetry
from ual.v1 import ual_pb2 as pb

__all__ = ["Simulation", "Subscription", "Task", "Uav"]

T = TypeVar("T")

_log = logging.getLogger(__name__)

_CLOSE_S = 2.0


class Uav:
    """One UAV, flown through its daemon from one event loop; made as `ual.Uav` is."""

    def __init__(self, ns: str | None = None, *, address: str | None = None, tls_ca: str | Path | None = None) -> None:
        self._connection = _Connection(Target(ns, address, tls_ca))
        self._setpoints = _Setpoints(self._connection)
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
        subscription = Subscription(self._connection, rate_hz, self._subscriptions.discard)
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
        self, waypoint: PoseStamped | Pose, *, blocking: bool = True, timeout_s: float | None = None
    ) -> Task:
        return await self._command_task(_calls.go_to_waypoint(waypoint, blocking), timeout_s)

    async def go_to_waypoint_geo(
        self,
        latitude_deg: float,
        longitude_deg: float,
        altitude_m: float,
        altitude_reference: AltitudeReference = AltitudeReference.HOME,
        *,
        yaw_rad: float | None = None,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> Task:
        call = _calls.go_to_waypoint_geo(latitude_deg, longitude_deg, altitude_m, altitude_reference, yaw_rad, blocking)
        return await self._command_task(call, timeout_s)

    async def follow_path(
        self,
        waypoints: Sequence[PoseStamped | Pose],
        *,
        corner_radius_m: float = 0.0,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> Task:
        return await self._command_task(_calls.follow_path(waypoints, corner_radius_m, blocking), timeout_s)

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


class Task:
    """A manoeuvre under way, or ended; the members of `ual.interface.Task` as coroutines."""

    def __init__(self, connection: _Connection, info: TaskInfo) -> None:
        self._connection = connection
        self._info = info

    @property
    def id(self) -> str:
        """By which `Uav.task` finds it."""
        return self._info.id

    @property
    def kind(self) -> TaskKind:
        """Which manoeuvre it is."""
        return self._info.kind

    async def info(self) -> TaskInfo:
        if not _calls.has_ended(self._info):
            self._info = await self._connection.run(_calls.get_task(self.id))
        return self._info

    async def done(self) -> bool:
        return _calls.has_ended(await self.info())

    async def wait(self, timeout_s: float | None = None) -> TaskInfo:
        async for info in self._watch(WAIT_RATE_HZ, timeout_s):
            self._info = info
        if self._info.error is not None:
            raise self._info.error
        return self._info

    async def cancel(self) -> None:
        if await self.done():
            return
        try:
            await self._connection.run(_calls.abort(task_id=self.id))
        except (WrongStateError, InvalidArgumentError):
            if not await self.done():
                raise

    async def watch(self, rate_hz: float = 10.0) -> AsyncIterator[TaskInfo]:
        async for info in self._watch(rate_hz, None):
            self._info = info
            yield info

    def __repr__(self) -> str:
        return f"<Task {self.id} {self.kind.name} {self._info.status.name}>"

    async def _watch(self, rate_hz: float, timeout_s: float | None) -> AsyncIterator[TaskInfo]:
        if _calls.has_ended(self._info):
            yield self._info
            return
        request = pb.WatchTaskRequest(task_id=self.id, rate_hz=rate_hz)
        call = self._connection.stubs().ual.WatchTask(
            request, timeout=timeout_s, metadata=self._connection.target.metadata
        )
        try:
            async for response in call:
                yield convert.task_from_proto(response.task)
        except grpc.aio.AioRpcError as error:
            if timeout_s is not None and error.code() is grpc.StatusCode.DEADLINE_EXCEEDED:
                raise has_not_ended(self.kind, timeout_s) from error
            raise self._connection.error(error) from error
        finally:
            call.cancel()


class Subscription:
    """New samples, newest first served; goes on by itself when the daemon comes back.

    Ends by `close`, on leaving its ``async with`` block, or with its `Uav`. An iteration raises what the daemon refuses
    at its beginning.
    """

    def __init__(self, connection: _Connection, rate_hz: float, on_close: Any) -> None:  # noqa: ANN401
        self._connection = connection
        self._rate_hz = rate_hz
        self._on_close = on_close
        self._changed = asyncio.Event()
        self._newest: pb.StreamTelemetryResponse | None = None
        self._missed_count = 0
        self._refusal: UalError | None = None
        self._is_closed = False
        self._draining: asyncio.Task[None] | None = None

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Telemetry:
        if self._draining is None and not self._is_closed:
            self._draining = asyncio.create_task(self._drain())
        while self._newest is None:
            if self._refusal is not None:
                raise self._refusal
            if self._is_closed:
                raise StopAsyncIteration
            self._changed.clear()
            await self._changed.wait()
        response, self._newest = self._newest, None
        missed_count, self._missed_count = self._missed_count, 0
        return convert.telemetry_from_proto(response.telemetry, missed_count)

    async def close(self) -> None:
        self._is_closed = True
        self._newest = None
        self._changed.set()
        self._on_close(self)
        if self._draining is not None:
            self._draining.cancel()
            await asyncio.wait((self._draining,))

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exc: object) -> None:
        await self.close()

    async def _drain(self) -> None:
        reported = ""
        has_begun = False
        while True:
            try:
                async for response in self._connection.stream_telemetry(self._rate_hz):
                    has_begun = True
                    if reported:
                        reported = ""
                        _log.info("telemetry is back")
                    self._missed_count += response.missed_count + (self._newest is not None)
                    self._newest = response
                    self._changed.set()
            except UalError as error:
                if not has_begun:
                    self._refusal = error
                    self._changed.set()
                    return
                if error.reason != reported:
                    reported = error.reason
                    _log.warning("telemetry is interrupted: %s: %s", error.reason, error.message)
            await asyncio.sleep(RETRY_S)


class Simulation:
    """The world around a simulated UAV; the members of `ual.interface.Simulation` as coroutines."""

    def __init__(self, connection: _Connection) -> None:
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


class _Connection:
    """Makes calls to the daemon of a target, on one event loop; see `ual._connection`."""

    def __init__(self, target: Target) -> None:
        self.target = target
        self._channel: grpc.aio.Channel | None = None
        self._stubs: Stubs | None = None
        self._address = ""
        self._is_closed = False
        self._was_reached = False
        self._retired: set[asyncio.Task[None]] = set()

    async def run(self, call: Call[T], timeout_s: float | None = None) -> T:
        """Makes a call and waits for its answer; cancelled with the task that waits."""
        limit_s = _calls.deadline(call, timeout_s)
        try:
            return await self._run_once(call, limit_s)
        except DaemonUnreachableError as error:
            if not (self._was_reached and rpc_errors.was_never_sent(error)):
                raise
            self._was_reached = False
            await self._wait_until_back(error)
        return await self._run_once(call, limit_s)

    async def stream_telemetry(self, rate_hz: float) -> AsyncIterator[pb.StreamTelemetryResponse]:
        """The stream of telemetry."""
        request = pb.StreamTelemetryRequest(rate_hz=rate_hz)
        call = self.stubs().ual.StreamTelemetry(request, metadata=self.target.metadata)
        try:
            async for response in call:
                yield response
        except grpc.aio.AioRpcError as error:
            raise self.error(error) from error
        finally:
            call.cancel()

    def stubs(self) -> Stubs:
        """The daemon's services, where it is now."""
        if self._is_closed:
            raise UalError("this client is closed")
        address = self.target.address()
        if self._stubs is None or address != self._address:
            if self._channel is not None:
                closing = asyncio.create_task(self._channel.close())
                self._retired.add(closing)
                closing.add_done_callback(self._retired.discard)
            self._channel, self._address = self._make_channel(address), address
            self._stubs = Stubs(self._channel)
        return self._stubs

    def error(self, error: grpc.RpcError) -> UalError:
        """What a call of this connection ended with."""
        return rpc_errors.from_rpc_error(error, address=self._address, ns=self.target.ns)

    async def close(self) -> None:
        """Ends every call that runs, and refuses new ones."""
        self._is_closed = True
        if self._channel is not None:
            await self._channel.close()
        if self._retired:
            await asyncio.wait(self._retired)

    async def _run_once(self, call: Call[T], limit_s: float | None) -> T:
        method = self.stubs().method(call)
        try:
            response = await method(call.request, timeout=limit_s, metadata=self.target.metadata)
        except grpc.aio.AioRpcError as error:
            raise _calls.in_time(self.error(error), call, limit_s) from error
        self._was_reached = True
        return call.read(response)

    def _make_channel(self, address: str) -> grpc.aio.Channel:
        if self.target.credentials is None:
            return grpc.aio.insecure_channel(address, CHANNEL_OPTIONS)
        return grpc.aio.secure_channel(address, self.target.credentials, CHANNEL_OPTIONS)

    async def _wait_until_back(self, unreachable: DaemonUnreachableError) -> None:
        probe: Any = self.stubs().ual.GetInfo
        try:
            await probe(
                pb.GetInfoRequest(), timeout=_calls.RECONNECT_S, metadata=self.target.metadata, wait_for_ready=True
            )
        except grpc.aio.AioRpcError as error:
            if error.code() in (grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.UNAVAILABLE):
                raise unreachable from error
            raise self.error(error) from error


class _Setpoints:
    """Sends setpoints, the newest only; see `ual._setpoints`."""

    def __init__(self, connection: _Connection) -> None:
        self._connection = connection
        self._accepted_s: float | None = None
        self._failure: UalError | None = None
        self._changed = asyncio.Event()
        self._newest: tuple[pb.StreamSetpointsRequest, float] | None = None
        self._is_ending = False
        self._writing: asyncio.Task[None] | None = None

    async def send(self, setpoint: pb.StreamSetpointsRequest) -> None:
        """Sends a setpoint; raises the refusal of this one, or of one before."""
        failure, self._failure = self._failure, None
        if failure is not None:
            self._accepted_s = None
            raise failure
        now_s = asyncio.get_running_loop().time()
        if self._accepted_s is None or now_s - self._accepted_s >= CONTINUES_S:
            await self._connection.run(_calls.single_setpoint(setpoint))
            self._accepted_s = asyncio.get_running_loop().time()
            return
        self._accepted_s = now_s
        self._newest = (setpoint, now_s)
        self._changed.set()
        if self._writing is None:
            self._writing = asyncio.create_task(self._write())
        # Lets the writer run, in a program that never waits for anything else.
        await asyncio.sleep(0)

    async def settle(self) -> None:
        """Sends what waits and ends the stream; as `ual._setpoints.Setpoints.settle`."""
        self._accepted_s = None
        if self._writing is not None:
            self._is_ending = True
            self._changed.set()
            _, unfinished = await asyncio.wait((self._writing,), timeout=_CLOSE_S)
            for writing in unfinished:
                writing.cancel()
                await asyncio.wait((writing,))
            self._is_ending = False
        failure, self._failure = self._failure, None
        if failure is not None:
            _log.warning("the last setpoints were refused: %s: %s", failure.reason, failure.message)

    async def _write(self) -> None:
        try:
            call: Any = self._connection.stubs().ual.StreamSetpoints(metadata=self._connection.target.metadata)
            try:
                await self._write_newest(call)
                await call.done_writing()
                await call
            except asyncio.InvalidStateError:
                await call  # it has ended; this says how
            finally:
                call.cancel()
        except grpc.aio.AioRpcError as error:
            self._failure = self._connection.error(error)
        except UalError as error:
            self._failure = error
        else:
            if not self._is_ending:
                self._failure = DaemonUnreachableError("the daemon ended the stream of setpoints")
        finally:
            self._writing = None

    async def _write_newest(self, call: Any) -> None:  # noqa: ANN401 (gRPC's call)
        loop = asyncio.get_running_loop()
        while not call.done():
            if self._newest is None:
                if self._is_ending:
                    return
                self._changed.clear()
                await self._changed.wait()
                continue
            (setpoint, put_s), self._newest = self._newest, None
            if loop.time() - put_s <= STALE_S:
                await call.write(setpoint)
