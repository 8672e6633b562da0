"""Requests that waited unread while the daemon stood still move nothing, on each transport."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, cast

import grpc
import pytest
from typing_extensions import override

from tests.conftest import StartDaemon
from tests.ual_daemon.server.serving import serving
from tests.waiting import until_async
from ual import UalTimeoutError
from ual.access.roles import Role
from ual.v1 import mission_pb2, ual_pb2_grpc
from ual.v1 import ual_pb2 as pb
from ual.wire import rpc_errors
from ual_daemon.server.access.needed import needed_role
from ual_daemon.server.calls import Calls
from ual_daemon.server.standstill import BEAT_S, LONGEST_QUEUEING_S, MOVES, STANDSTILL_S, Standstill
from ual_daemon.server.telemetry_stream import Updates
from ual_daemon.server.transport.selection import Choice
from ual_daemon.server.uav_service import UalServicer
from ual_daemon.vehicle.vehicle import Vehicle

OBEYED_LATE = {
    "ual.v1.UalService": (
        *("Land", "Abort", "Pause", "Disarm"),  # they end a motion
        *("AddFrame", "RemoveFrame", "AcquireLease", "KeepLease", "ReleaseLease"),  # they move nothing
        *("SetExternalPose", "StreamExternalPoses"),  # they have stamps of their own
    ),
    "ual.v1.MissionService": ("UploadMission", "ClearMission", "PauseMission"),
}
"""Methods that need more than an observer, and are no part of `MOVES`, in the services that fly."""


class Clock:
    """Moves when the test says so."""

    now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


class Servicer(UalServicer):
    """Notes what came through."""

    def __init__(self) -> None:
        super().__init__(cast("Vehicle", None), cast("Updates", None))
        self.taken: list[str] = []

    @override
    def SetPose(self, request: Any, context: object) -> pb.SetPoseResponse:
        self.taken.append("SetPose")
        return pb.SetPoseResponse()

    @override
    def Abort(self, request: Any, context: object) -> pb.AbortResponse:
        self.taken.append("Abort")
        return pb.AbortResponse()

    @override
    def StreamSetpoints(  # type: ignore[override] # as the servicer that it stands for: see `dispatch`
        self, request_iterator: None, context: object
    ) -> Any:
        while (yield) is not None:
            self.taken.append("StreamSetpoints")
        return pb.StreamSetpointsResponse()


def go_on(standstill: Standstill, clock: Clock, time_s: float) -> None:
    """Lets the daemon run for a while."""
    for _ in range(round(time_s / BEAT_S)):
        clock.now_s += BEAT_S
        standstill.beat()


def running(clock: Clock) -> Standstill:
    """Of a daemon that has just run."""
    standstill = Standstill(clock)
    standstill.beat()
    return standstill


def serve(transport: Choice, ask: Callable[[Any, Clock, Servicer, Standstill], Any]) -> list[str]:
    """Serves on a clock that stands, and returns what came through."""

    async def run() -> None:
        standstill = running(clock)
        calls = Calls("uav_1", shutdown_refuses=(), standstill=standstill)
        register = partial(ual_pb2_grpc.add_UalServiceServicer_to_server, servicer)
        async with serving(transport, calls, register) as (channel, _):
            await ask(ual_pb2_grpc.UalServiceStub(channel), clock, servicer, standstill)

    clock, servicer = Clock(), Servicer()
    asyncio.run(run())
    return servicer.taken


async def refused(call: Any) -> UalTimeoutError:
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await call
    error = rpc_errors.from_rpc_error(caught.value)
    assert isinstance(error, UalTimeoutError)
    return error


def test_a_call_that_may_have_waited_meanwhile_is_refused_and_what_stops_is_obeyed(transport: Choice) -> None:
    async def ask(stub: Any, clock: Clock, _: Servicer, standstill: Standstill) -> None:
        clock.now_s += 5.0
        error = await refused(stub.SetPose(pb.SetPoseRequest()))
        assert "SetPose: the daemon stood still for 5.0 s" in error.message
        assert error.metadata["stood_still_s"] == "5.000"
        await stub.Abort(pb.AbortRequest())
        go_on(standstill, clock, 4.5)
        await refused(stub.SetPose(pb.SetPoseRequest()))
        go_on(standstill, clock, 0.5)
        await stub.SetPose(pb.SetPoseRequest())

    assert serve(transport, ask) == ["Abort", "SetPose"]


def test_a_setpoint_of_a_stream_that_may_have_waited_meanwhile_ends_the_stream(transport: Choice) -> None:
    async def ask(stub: Any, clock: Clock, servicer: Servicer, _: Standstill) -> None:
        stream = stub.StreamSetpoints()
        await stream.write(pb.StreamSetpointsRequest())
        await until_async(lambda: servicer.taken, "the first setpoint")
        clock.now_s += 3.0
        await stream.write(pb.StreamSetpointsRequest())
        assert "StreamSetpoints: the daemon stood still for 3.0 s" in (await refused(stream)).message

    assert serve(transport, ask) == ["StreamSetpoints"]


def test_a_busy_computer_is_no_standstill() -> None:
    clock = Clock()
    standstill = running(clock)
    clock.now_s += STANDSTILL_S
    standstill.require_running("/ual.v1.UalService/SetPose")


def test_an_event_loop_that_is_held_up_is_no_standstill_while_setpoints_are_read() -> None:
    clock = Clock()
    standstill = running(clock)
    for _ in range(5):
        clock.now_s += 0.9 * STANDSTILL_S
        standstill.require_running("/ual.v1.UalService/StreamSetpoints")


def test_after_a_long_sleep_it_waits_no_longer_than_what_was_sent_can_take() -> None:
    clock = Clock()
    standstill = running(clock)
    clock.now_s += 3600.0
    standstill.beat()
    go_on(standstill, clock, LONGEST_QUEUEING_S)
    standstill.require_running("/ual.v1.UalService/SetPose")


def test_a_start_that_takes_long_is_no_standstill() -> None:
    clock = Clock()
    standstill = Standstill(clock)
    clock.now_s += 60.0
    standstill.require_running("/ual.v1.UalService/SetPose")
    standstill.beat()
    standstill.require_running("/ual.v1.UalService/SetPose")


@pytest.mark.parametrize("service", OBEYED_LATE)
def test_each_method_of_what_flies_is_either_refused_or_obeyed_late(service: str) -> None:
    of_file = {**pb.DESCRIPTOR.services_by_name, **mission_pb2.DESCRIPTOR.services_by_name}
    names = [method.name for method in of_file[service.rpartition(".")[2]].methods]
    commands = {name for name in names if needed_role(f"/{service}/{name}") is not Role.OBSERVER}
    moving = {method.rpartition("/")[2] for method in MOVES if method.startswith(f"/{service}/")}
    assert moving | set(OBEYED_LATE[service]) == commands
    assert not moving & set(OBEYED_LATE[service])


def test_a_daemon_that_was_stopped_refuses_what_waited_and_says_so(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--backend", "light")
    with grpc.insecure_channel(daemon.address) as channel, ThreadPoolExecutor(1) as thread:
        stub = ual_pb2_grpc.UalServiceStub(channel)
        stub.GetInfo(pb.GetInfoRequest(), wait_for_ready=True)
        stub.SetHome(pb.SetHomeRequest())  # from here on it is watched
        with daemon.frozen():
            waiting = thread.submit(stub.SetHome, pb.SetHomeRequest())
            threading.Event().wait(STANDSTILL_S + 0.3)  # the time that passes is what is tested
        with pytest.raises(grpc.RpcError, match="the daemon stood still for"):
            waiting.result(30.0)
    assert daemon.wait_for("stood_still")["stood_still_s"] > STANDSTILL_S
