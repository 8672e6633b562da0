from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Future
from contextlib import asynccontextmanager, suppress
from functools import partial
from typing import Any, cast

import grpc
import pytest
from typing_extensions import override

from tests.ual_daemon.server import raw
from tests.ual_daemon.server.raw import answer_to
from tests.ual_daemon.server.serving import reported, serving
from tests.waiting import LIMIT_S, until_async
from tests.work.memory_calls import MemoryCall
from ual.access.roles import Role
from ual.errors import (
    InvalidArgumentError,
    ResourceExhaustedError,
    TaskAbortedError,
    UalError,
    UnauthenticatedError,
    WrongStateError,
)
from ual.geometry import TwistStamped
from ual.types import ExternalPose, State, TaskKind, Telemetry
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc
from ual.wire import rpc_errors
from ual_daemon import UAL, logs
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.server import calls as calls_module
from ual_daemon.server.access.caller import Caller
from ual_daemon.server.access.policy import Access
from ual_daemon.server.calls import MOST_CALLS_PER_METHOD, MOST_CALLS_WITHOUT_REQUEST, Calls
from ual_daemon.server.server import NEEDED_TO_LAND
from ual_daemon.server.telemetry_stream import Updates
from ual_daemon.server.transport.base import ServedCall
from ual_daemon.server.transport.selection import Choice
from ual_daemon.server.uav_service import UalServicer
from ual_daemon.vehicle.vehicle import Vehicle


class StandingClock:
    """Time does not matter here."""

    def now_s(self) -> float:
        return 0.0

    def utc_s(self) -> float:
        return 0.0


class FakeVehicle:
    """Does what a test tells it to."""

    ns = "uav_1"

    def __init__(self) -> None:
        self.arming: Future[None] = Future()
        self.is_arming = threading.Event()
        self.callers: list[str] = []
        self.taken: list[TwistStamped] = []
        self.has_setpoint = threading.Event()
        self.holders: list[str] = []
        self.is_held_up, self.goes_on = threading.Event(), threading.Event()
        self.goes_on.set()
        self.commands = self.setpoints = self.external_poses = self
        self.poses: list[ExternalPose] = []
        self.has_pose = threading.Event()
        self.watched = VehicleTask(TaskKind.LAND, "a task that runs", StandingClock())

    def telemetry(self) -> Telemetry:
        return Telemetry(State.LANDED_DISARMED)

    def state(self) -> State:
        return State.LANDED_DISARMED

    def subscribe(self, *_: object) -> Any:
        return lambda: None

    def listen_to_state(self, _: object) -> Any:
        return lambda: None

    def set_home(self, set_z: bool, _: str) -> None:
        self.is_held_up.set()
        assert self.goes_on.wait(LIMIT_S)
        who = logs.caller.get()
        assert who is not None
        self.callers.append(who())
        if set_z:
            raise WrongStateError("set_home: not in FLYING_AUTO", {"state": "FLYING_AUTO"})

    def acquire_lease(self, holder: str, *_: object, **__: object) -> str:
        self.holders.append(holder)
        self.has_setpoint.set()
        return "1"

    def lease(self) -> None:
        return None

    def frames(self) -> object:
        raise RuntimeError("a defect")

    def task(self, task_id: str) -> VehicleTask:
        return self.watched

    def arm(self, _: str) -> Future[None]:
        self.is_arming.set()
        return self.arming

    def set_velocity(self, velocity: TwistStamped, _: str) -> None:
        if velocity.twist.linear.x > 1.0:
            raise InvalidArgumentError("velocity: too fast")
        self.taken.append(velocity)
        self.has_setpoint.set()

    def offer(self, measured: ExternalPose) -> str:
        self.poses.append(measured)
        self.has_pose.set()
        return "it is old" if len(self.poses) == 2 else ""

    def set(self, measured: ExternalPose) -> str:
        return self.offer(measured)


class FakeAccess(Access):
    """Knows its caller until that is revoked."""

    def __init__(self) -> None:
        super().__init__()
        self.is_revoked = False

    def identify(self, call: ServedCall) -> Caller:
        if self.is_revoked:
            raise UnauthenticatedError("revoked")
        return Caller("field", Role.PILOT, is_named=True)


class LongServicer(ual_pb2_grpc.UalServiceServicer):
    """Has a method of each kind that goes on until its call ends, and says which of them have begun and ended."""

    def __init__(self) -> None:
        self.begun: set[str] = set()
        self.ended: set[str] = set()

    @override
    def Land(self, request: pb.LandRequest, context: Any) -> Any:
        return self._go_on("Land")

    @override
    def StreamTelemetry(self, request: pb.StreamTelemetryRequest, context: Any) -> Any:
        self.begun.add("StreamTelemetry")
        return partial(self.ended.add, "StreamTelemetry")

    @override
    async def WatchTask(self, request: pb.WatchTaskRequest, context: Any) -> Any:
        await self._go_on("WatchTask")
        yield pb.WatchTaskResponse()

    async def _go_on(self, name: str) -> Any:
        self.begun.add(name)
        try:
            await asyncio.get_running_loop().create_future()
        finally:
            self.ended.add(name)


class Served:
    """A server of a fake vehicle, and a client."""

    def __init__(self, vehicle: FakeVehicle, calls: Calls, channel: grpc.aio.Channel, address: str) -> None:
        self.vehicle = vehicle
        self.address = address
        self.calls = calls
        self.channel = channel
        self.stub = ual_pb2_grpc.UalServiceStub(channel)


@asynccontextmanager
async def served(transport: Choice) -> AsyncIterator[Served]:
    vehicle = FakeVehicle()
    calls = Calls("uav_1", shutdown_refuses=("/ual.v1.UalService/",), shutdown_keeps=NEEDED_TO_LAND)
    updates = Updates(cast("Vehicle", vehicle), lambda _: None)
    servicer = UalServicer(cast("Vehicle", vehicle), updates)
    async with serving(transport, calls, partial(ual_pb2_grpc.add_UalServiceServicer_to_server, servicer)) as (
        channel,
        address,
    ):
        yield Served(vehicle, calls, channel, address)


async def error_of(call: Any) -> UalError:
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await call
    return rpc_errors.from_rpc_error(caught.value)


def speed(x: float) -> pb.TwistStamped:
    return pb.TwistStamped(twist=pb.Twist(linear=pb.Vector3(x=x), angular=pb.Vector3()))


def test_a_refusal_goes_out_as_status_with_reason_and_metadata(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            error = await error_of(it.stub.SetHome(pb.SetHomeRequest(set_z=True)))
            assert isinstance(error, WrongStateError)
            assert error.message == "set_home: not in FLYING_AUTO"
            assert error.state == "FLYING_AUTO"
            assert it.calls.figures.failures == {"WRONG_STATE": 1}

    asyncio.run(run())


def test_streams_and_waiting_calls_of_one_method_are_bounded_and_others_get_through(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            streams = [it.stub.StreamTelemetry(pb.StreamTelemetryRequest()) for _ in range(MOST_CALLS_PER_METHOD)]
            for stream in streams:
                await stream.read()
            error = await error_of(it.stub.StreamTelemetry(pb.StreamTelemetryRequest()).read())
            assert isinstance(error, ResourceExhaustedError)
            assert error.metadata["limit"] == "100"
            assert "100 calls of /ual.v1.UalService/StreamTelemetry are under way for uav_1" in error.message
            await it.stub.GetTelemetry(pb.GetTelemetryRequest())
            arming = [asyncio.ensure_future(it.stub.Arm(pb.ArmRequest())) for _ in range(MOST_CALLS_PER_METHOD)]
            await until_async(lambda: it.calls.running_count == 2 * MOST_CALLS_PER_METHOD)
            assert isinstance(await error_of(it.stub.Arm(pb.ArmRequest())), ResourceExhaustedError)
            assert it.calls.figures == (1, {"StreamTelemetry": MOST_CALLS_PER_METHOD}, {"RESOURCE_EXHAUSTED": 2})
            await it.stub.SetVelocity(pb.SetVelocityRequest(velocity=speed(0.5)))
            streams.pop().cancel()
            await until_async(lambda: it.calls.running_count < 2 * MOST_CALLS_PER_METHOD)
            await it.stub.StreamTelemetry(pb.StreamTelemetryRequest()).read()
            it.vehicle.arming.set_result(None)
            await asyncio.gather(*arming)

    asyncio.run(run())


def test_a_defect_is_internal_logged_and_the_server_goes_on(
    transport: Choice, caplog: pytest.LogCaptureFixture
) -> None:
    async def run() -> None:
        async with served(transport) as it:
            with pytest.raises(grpc.aio.AioRpcError) as caught:
                await it.stub.ListFrames(pb.ListFramesRequest())
            assert caught.value.code() is grpc.StatusCode.INTERNAL
            assert "RuntimeError: a defect" in (caught.value.details() or "")
            assert it.calls.figures.failures == {"INTERNAL": 1}
            await it.stub.GetTelemetry(pb.GetTelemetryRequest())

    with caplog.at_level(logging.ERROR, "ual_daemon"):
        asyncio.run(run())
    (record,) = reported(caplog)
    assert record.exc_info is not None
    assert "/ual.v1.UalService/ListFrames failed unexpectedly" in record.getMessage()


def test_a_caller_who_goes_away_is_no_defect_and_his_call_ends(
    transport: Choice, caplog: pytest.LogCaptureFixture
) -> None:
    async def run() -> None:
        async with served(transport) as it:
            watching = it.stub.WatchTask(pb.WatchTaskRequest(task_id="1", rate_hz=1000.0))
            await watching.read()
            arming = it.stub.Arm(pb.ArmRequest())
            assert await asyncio.to_thread(it.vehicle.is_arming.wait, LIMIT_S)
            telemetry = it.stub.StreamTelemetry(pb.StreamTelemetryRequest())
            await telemetry.read()
            assert it.calls.running_count == 3
            for call in (watching, arming, telemetry):
                call.cancel()
            await until_async(lambda: not it.calls.running_count)
            assert not it.vehicle.arming.done()  # what others may wait for goes on

    with caplog.at_level(logging.INFO, "ual_daemon"):
        asyncio.run(run())
    assert not reported(caplog)


def test_what_is_no_message_is_refused(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            call: Any = it.channel.unary_unary("/ual.v1.UalService/SetHome")
            with pytest.raises(grpc.aio.AioRpcError, match="no such message") as caught:
                await call(b"\x0a\xff")
            assert caught.value.code() is grpc.StatusCode.INVALID_ARGUMENT  # the caller's mistake, and not ours
            assert not it.vehicle.callers

    asyncio.run(run())


def test_a_method_that_is_not_there_is_unimplemented(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            call: Any = it.channel.unary_unary("/ual.v1.UalService/Loop")
            with pytest.raises(grpc.aio.AioRpcError, match=r"no method /ual\.v1\.UalService/Loop") as caught:
                await call(b"")
            assert caught.value.code() is grpc.StatusCode.UNIMPLEMENTED

    asyncio.run(run())


def test_a_call_without_its_request_is_refused(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            call: Any = it.channel.stream_unary("/ual.v1.UalService/SetHome")()
            await call.done_writing()
            with pytest.raises(grpc.aio.AioRpcError, match="takes one request"):
                await call
            assert not it.vehicle.callers

    asyncio.run(run())


def test_calls_without_their_request_are_bounded_and_others_get_in(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            open_call: Any = it.channel.stream_unary("/ual.v1.UalService/SetHome")
            first = open_call()
            await until_async(lambda: it.calls.without_request_count == 1)
            others = [open_call() for _ in range(MOST_CALLS_WITHOUT_REQUEST - 1)]
            await until_async(lambda: it.calls.without_request_count == MOST_CALLS_WITHOUT_REQUEST)
            await it.stub.SetHome(pb.SetHomeRequest())  # in the place of the first
            error = await error_of(first)
            assert isinstance(error, ResourceExhaustedError)
            assert "100 later calls wait for their request" in error.message
            assert it.calls.without_request_count == MOST_CALLS_WITHOUT_REQUEST - 1
            assert len(it.vehicle.callers) == 1
            for each in others:
                each.cancel()
            await until_async(lambda: it.calls.without_request_count == 0)

    asyncio.run(run())


@pytest.mark.parametrize("method", ["SetHome", "StreamTelemetry", "WatchTask"])
def test_a_call_whose_request_is_late_is_ended_and_logged_in_one_message(
    transport: Choice, method: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def run() -> None:
        async with served(transport) as it:
            open_call: Any = it.channel.stream_unary(f"/ual.v1.UalService/{method}")
            for call in [open_call() for _ in range(3)]:
                error = await error_of(call)
                assert isinstance(error, ResourceExhaustedError)
                assert "did not come within" in error.message
            assert it.calls.without_request_count == it.calls.running_count == 0

    monkeypatch.setattr(calls_module, "REQUEST_S", 0.5)
    with caplog.at_level(logging.INFO, "ual_daemon"):
        asyncio.run(run())
    assert 1 <= len(caplog.records) <= 3
    assert all(record.exc_info is None for record in caplog.records)


def test_metadata_that_are_too_large_are_refused(transport: Choice, caplog: pytest.LogCaptureFixture) -> None:
    async def run() -> None:
        async with served(transport) as it:
            # gRPC's own clients do not send them. gRPC's server looks at each frame of them by itself.
            large = {b"x%03d" % number: b"y" * 100 for number in range(400)}
            method = {b":path": b"/ual.v1.UalService/SetHome"}
            for _ in range(5):  # one in some 400 is refused by gRPC's own server, without a word
                answer = await asyncio.to_thread(answer_to, it.address, {**method, **large})
                assert b"grpc-status\x018" in answer  # RESOURCE_EXHAUSTED
                if b"at most 16384 are accepted" in answer:
                    break
            else:
                raise AssertionError("nobody says how large they may be")
            assert not it.vehicle.callers
            assert b"grpc-status\x010" in await asyncio.to_thread(answer_to, it.address, method)

    asyncio.run(run())
    assert not reported(caplog)


def test_another_uavs_name_is_refused(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            await it.stub.SetHome(pb.SetHomeRequest(), metadata=(("ual-ns", "uav_1"),))
            error = await error_of(it.stub.SetHome(pb.SetHomeRequest(), metadata=(("ual-ns", "uav_2"),)))
            assert isinstance(error, InvalidArgumentError)
            assert error.message == "this daemon flies uav_1, not uav_2"
            stream = it.stub.StreamTelemetry(pb.StreamTelemetryRequest(), metadata=(("ual-ns", "uav_2"),))
            assert isinstance(await error_of(anext(aiter(stream))), InvalidArgumentError)
            assert len(it.vehicle.callers) == 1

    asyncio.run(run())


def test_the_vehicle_knows_who_calls(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            await it.stub.SetHome(pb.SetHomeRequest())
            (caller,) = it.vehicle.callers
            assert caller.startswith("ipv4:127.0.0.1:")
        assert logs.caller.get() is None

    asyncio.run(run())


@pytest.mark.parametrize(
    ("rate_hz", "why"),
    [
        (-1.0, "-1 is negative"),
        (float("nan"), "nan is not a finite number"),
        (float("inf"), "inf is not a finite number"),
    ],
)
def test_a_rate_that_is_none_is_refused_as_the_class_does(transport: Choice, rate_hz: float, why: str) -> None:
    with UAL() as uav, pytest.raises(InvalidArgumentError) as caught:
        uav.subscribe(print, rate_hz)
    assert caught.value.message == f"rate_hz: {why}"

    async def run() -> None:
        async with served(transport) as it:
            stream = it.stub.StreamTelemetry(pb.StreamTelemetryRequest(rate_hz=rate_hz))
            error = await error_of(anext(aiter(stream)))
            assert isinstance(error, InvalidArgumentError)
            assert error.message == f"rate_hz: {why}"
            assert error.metadata["field"] == "rate_hz"

    asyncio.run(run())


def test_the_first_refused_setpoint_ends_the_stream(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            stream = it.stub.StreamSetpoints()
            await stream.write(pb.StreamSetpointsRequest(velocity=speed(0.5)))
            await stream.write(pb.StreamSetpointsRequest(velocity=speed(9.0)))
            error = await error_of(stream)
            assert error.message == "velocity: too fast"
            assert [each.twist.linear.x for each in it.vehicle.taken] == [0.5]

    asyncio.run(run())


def test_a_setpoint_stream_that_ends_tells_how_many_were_taken(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            stream = it.stub.StreamSetpoints()
            for _ in range(3):
                await stream.write(pb.StreamSetpointsRequest(velocity=speed(0.5)))
            await stream.done_writing()
            assert (await stream).accepted_count == 3

    asyncio.run(run())


@pytest.mark.parametrize(
    ("method", "request_of"),
    [
        ("SetVelocity", lambda x: pb.SetVelocityRequest(velocity=speed(x))),
        ("StreamSetpoints", lambda x: pb.StreamSetpointsRequest(velocity=speed(x))),
        ("AcquireLease", lambda x: pb.AcquireLeaseRequest(holder=str(x))),
    ],
)
def test_what_its_caller_gave_up_before_it_was_read_moves_nothing(
    transport: Choice, method: str, request_of: Callable[[float], Any]
) -> None:
    """The thread that reads was held up, by less than what is a standstill of the daemon."""

    def call(it: Served) -> None:
        path, given_up, later = f"/ual.v1.UalService/{method}", request_of(0.5), request_of(0.25)
        with raw.Caller(it.address) as caller:
            caller.send(raw.requests("/ual.v1.UalService/SetHome", 1, b"") + raw.end(1))
            assert it.vehicle.is_held_up.wait(LIMIT_S)
            caller.send(raw.requests(path, 3, given_up.SerializeToString()) + raw.end(3))
            caller.send(raw.give_up(3))
            it.vehicle.goes_on.set()
            caller.send(raw.requests(path, 5, later.SerializeToString()) + raw.end(5))
            assert it.vehicle.has_setpoint.wait(LIMIT_S)

    async def run() -> None:
        async with served(transport) as it:
            it.vehicle.goes_on.clear()
            await asyncio.to_thread(call, it)
            taken = [each.twist.linear.x for each in it.vehicle.taken]
            assert [*taken, *map(float, it.vehicle.holders)] == [0.25]

    asyncio.run(run())


def test_a_call_that_ended_before_it_was_read_is_not_taken_for_that_of_a_stranger() -> None:
    class EndedCall(MemoryCall):
        """One of which gRPC does not know any more where it came from."""

        @override
        def peer(self) -> str:
            return ""

    async def run() -> None:
        calls, ended = Calls("uav_1", shutdown_refuses=()), EndedCall("/ual.v1.UalService/GetInfo", ())
        calls.on_call(ended)
        assert ended.code is grpc.StatusCode.CANCELLED
        assert not calls.figures.failures

    asyncio.run(run())


def test_a_request_that_comes_while_late_ones_are_searched_changes_nothing_under_the_search() -> None:
    class Watched(dict[Any, float]):
        """Waiting calls; each change needs the lock."""

        def __init__(self, lock: threading.Lock) -> None:
            super().__init__()
            self._lock = lock

        @override
        def pop(self, key: object, *default: Any) -> Any:
            assert self._lock.locked()
            return super().pop(key, *default)

    async def run() -> None:
        calls = Calls("uav_1", shutdown_refuses=())
        calls._without_request = Watched(calls._lock)
        calls.has_request(cast("Any", object()))

    asyncio.run(run())


def pose_outside() -> pb.ExternalPose:
    pose = pb.Pose(position=pb.Vector3(x=1.0), orientation=pb.Quaternion(w=1.0))
    return pb.ExternalPose(pose=pb.PoseStamped(pose=pose), position_std_dev_m=0.005)


def test_a_stream_of_poses_from_outside_counts_those_that_were_dropped(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            stream = it.stub.StreamExternalPoses()
            for _ in range(3):
                await stream.write(pb.StreamExternalPosesRequest(external_pose=pose_outside()))
            await stream.done_writing()
            response = await stream
            assert (response.accepted_count, response.dropped_count) == (2, 1)
            assert it.vehicle.poses[0].position_std_dev_m == 0.005
            assert it.vehicle.poses[0].orientation_std_dev_rad is None
            single = pb.SetExternalPoseRequest(external_pose=pose_outside())
            assert (await it.stub.SetExternalPose(single)).dropped == ""
            assert isinstance(
                await error_of(it.stub.SetExternalPose(pb.SetExternalPoseRequest())), InvalidArgumentError
            )

    asyncio.run(run())


def test_poses_from_outside_go_on_until_the_flight_has_ended(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            stream = it.stub.StreamExternalPoses()
            await stream.write(pb.StreamExternalPosesRequest(external_pose=pose_outside()))
            assert await asyncio.to_thread(it.vehicle.has_pose.wait, LIMIT_S)
            it.calls.begin_shutdown()
            it.vehicle.has_pose.clear()
            await stream.write(pb.StreamExternalPosesRequest(external_pose=pose_outside()))
            assert await asyncio.to_thread(it.vehicle.has_pose.wait, LIMIT_S)
            single = pb.SetExternalPoseRequest(external_pose=pose_outside())
            assert (await it.stub.SetExternalPose(single)).dropped == ""
            it.calls.end_waiting()
            for call in (stream, it.stub.SetExternalPose(single)):
                with pytest.raises(grpc.aio.AioRpcError, match="the daemon is shutting down"):
                    await call

    asyncio.run(run())


def test_shutdown_ends_streams_and_refuses_new_calls_while_others_go_on(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            telemetry = it.stub.StreamTelemetry(pb.StreamTelemetryRequest())
            await telemetry.read()
            setpoints = it.stub.StreamSetpoints()
            await setpoints.write(pb.StreamSetpointsRequest(velocity=speed(0.5)))
            assert await asyncio.to_thread(it.vehicle.has_setpoint.wait, LIMIT_S)
            arming = it.stub.Arm(pb.ArmRequest())
            assert await asyncio.to_thread(it.vehicle.is_arming.wait, LIMIT_S)
            it.calls.begin_shutdown()
            for call in (telemetry.read(), setpoints, it.stub.GetTelemetry(pb.GetTelemetryRequest())):
                with pytest.raises(grpc.aio.AioRpcError, match="the daemon is shutting down") as caught:
                    await call
                assert caught.value.code() is grpc.StatusCode.UNAVAILABLE
            it.vehicle.arming.set_result(None)
            await arming

    asyncio.run(run())


def test_shutdown_ends_at_last_what_still_waits_as_aborted(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            arming = it.stub.Arm(pb.ArmRequest())
            assert await asyncio.to_thread(it.vehicle.is_arming.wait, LIMIT_S)
            it.calls.begin_shutdown()
            it.calls.end_waiting()
            error = await error_of(arming)
            assert isinstance(error, TaskAbortedError)
            assert error.metadata["by"] == "shutdown"

    asyncio.run(run())


def test_a_call_that_begins_to_wait_after_the_waiting_was_ended_is_ended_too(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            it.calls.end_waiting()
            error = await error_of(it.stub.Arm(pb.ArmRequest()))
            assert isinstance(error, TaskAbortedError)
            assert error.metadata["by"] == "shutdown"

    asyncio.run(run())


def test_shutdown_ends_a_stream_that_has_only_just_begun(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            stream = it.stub.StreamTelemetry(pb.StreamTelemetryRequest())
            await stream.wait_for_connection()
            it.calls.begin_shutdown()  # perhaps in the middle of its first message
            with pytest.raises(grpc.aio.AioRpcError, match="the daemon is shutting down"):
                async for _ in stream:
                    pass

    asyncio.run(run())


def test_no_setpoint_is_taken_after_the_shutdown_has_begun(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as it:
            stream = it.stub.StreamSetpoints()
            await stream.write(pb.StreamSetpointsRequest(velocity=speed(0.5)))
            assert await asyncio.to_thread(it.vehicle.has_setpoint.wait, LIMIT_S)
            it.calls.begin_shutdown()
            with suppress(grpc.aio.AioRpcError):  # it may know of the end already
                await stream.write(pb.StreamSetpointsRequest(velocity=speed(0.6)))
            assert await stream.code() is not grpc.StatusCode.OK
            assert [each.twist.linear.x for each in it.vehicle.taken] == [0.5]

    asyncio.run(run())


def test_what_begins_at_once_begins_in_the_order_of_the_calls(transport: Choice) -> None:
    """An abort that was sent after a motion must not come before it."""

    def call(vehicle: FakeVehicle, address: str) -> None:
        with grpc.insecure_channel(address) as channel:
            stub = ual_pb2_grpc.UalServiceStub(channel)
            # Connected: calls that wait for their connection leave a client in any order.
            stub.SetHome(pb.SetHomeRequest(), timeout=LIMIT_S)
            arming = stub.Arm.future(pb.ArmRequest())
            stub.SetHome(pb.SetHomeRequest(), timeout=LIMIT_S)
            assert vehicle.is_arming.is_set()
            arming.cancel()

    async def run() -> None:
        async with served(transport) as it:
            if transport == "core":  # which does so however busy the event loop is: it stands still meanwhile
                call(it.vehicle, it.address)
            else:
                await asyncio.to_thread(call, it.vehicle, it.address)

    asyncio.run(run())


def test_what_is_done_for_a_caller_ends_with_its_token(transport: Choice, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calls_module, "REQUEST_S", 0.05)

    async def main() -> None:
        access = FakeAccess()
        servicer = LongServicer()  # type: ignore[abstract] # it has only what the test calls
        calls = Calls("uav_1", shutdown_refuses=(), access=access)
        register = partial(ual_pb2_grpc.add_UalServiceServicer_to_server, servicer)
        async with serving(transport, calls, register) as (channel, _):
            stub = ual_pb2_grpc.UalServiceStub(channel)
            streams = (stub.StreamTelemetry(pb.StreamTelemetryRequest()), stub.WatchTask(pb.WatchTaskRequest()))
            landing = stub.Land(pb.LandRequest())
            running: list[Any] = [landing, *(asyncio.create_task(stream.read()) for stream in streams)]
            await until_async(lambda: len(servicer.begun) == 3, "begun")
            access.is_revoked = True
            for each in running:
                assert (await error_of(each)).reason == "UNAUTHENTICATED"
            await until_async(lambda: servicer.ended == servicer.begun, "ended")
            assert not calls.running_count

    asyncio.run(main())
