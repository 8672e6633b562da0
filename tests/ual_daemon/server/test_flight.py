"""Behaviour that only a server in its own process shows: calls that end early, slow readers, clients without our
code.
"""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from itertools import pairwise
from typing import Any

import grpc
import pytest
from google.protobuf import descriptor_pool, message_factory
from google.rpc.error_details_pb2 import ErrorInfo
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase
from grpc_status import rpc_status

from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.contract_files import SERVICES
from ual.v1 import simulation_pb2, simulation_pb2_grpc, ual_pb2_grpc
from ual.v1 import ual_pb2 as pb

Stub = ual_pb2_grpc.UalServiceStub


@pytest.fixture
def stub(daemon: DaemonProcess) -> Any:
    """A stub of the daemon, whose UAV flies 2 m high."""
    daemon.wait_for("state", new="LANDED_ARMED")
    stub = Stub(daemon.channel())
    stub.TakeOff(pb.TakeOffRequest(height_m=2.0), timeout=LIMIT_S)
    return stub


def far_away() -> pb.GoToWaypointRequest:
    request = pb.GoToWaypointRequest()
    request.waypoint.pose.position.x, request.waypoint.pose.position.z = 9_000.0, 2.0
    return request


def holds(stub: Any) -> bool:
    """True once the UAV stands still in the air with no task, within a while."""
    for answer in stub.StreamTelemetry(pb.StreamTelemetryRequest(), timeout=LIMIT_S):
        telemetry = answer.telemetry
        speed = telemetry.velocity.linear
        if not telemetry.HasField("task") and abs(speed.x) + abs(speed.y) + abs(speed.z) < 0.02:
            return bool(telemetry.state == pb.STATE_FLYING_AUTO)
    return False


# --- Calls that end early ---------------------------------------------------------------------------------------------


def test_a_deadline_that_passes_cancels_the_go_to_and_the_uav_holds(daemon: DaemonProcess, stub: Any) -> None:
    def go_to(limit_s: float) -> None:
        with pytest.raises(grpc.RpcError) as caught:
            stub.GoToWaypoint(far_away(), timeout=limit_s)
        assert caught.value.code() is grpc.StatusCode.DEADLINE_EXCEEDED

    daemon.give_up_begun("go_to_waypoint", go_to)
    daemon.wait_for("caller_gone", kind="GO_TO_WAYPOINT", cancelled=True)
    ended = daemon.wait_for("task_ended", reason="TASK_ABORTED")
    assert ended["caller"].startswith("ipv4:127.0.0.1:")
    assert holds(stub)


def test_a_caller_that_cancels_cancels_his_go_to(daemon: DaemonProcess, stub: Any) -> None:
    going = stub.GoToWaypoint.future(far_away())
    daemon.wait_for("command", command="go_to_waypoint")
    going.cancel()
    daemon.wait_for("task_ended", reason="TASK_ABORTED")
    assert holds(stub)


def test_a_caller_that_is_killed_cancels_his_go_to(daemon: DaemonProcess, stub: Any) -> None:
    program = (
        "import grpc\n"
        "from ual.v1 import ual_pb2 as pb, ual_pb2_grpc\n"
        f"stub = ual_pb2_grpc.UalServiceStub(grpc.insecure_channel({daemon.address!r}))\n"
        f"stub.GoToWaypoint(pb.GoToWaypointRequest.FromString({far_away().SerializeToString()!r}))\n"
    )
    caller = subprocess.Popen([sys.executable, "-c", program])
    try:
        daemon.wait_for("command", command="go_to_waypoint")
    finally:
        caller.send_signal(signal.SIGKILL)
        caller.wait(LIMIT_S)
    daemon.wait_for("caller_gone", cancelled=True)
    assert holds(stub)


class Cable:
    """Carries one TCP connection to a server until it is cut: then nothing comes through any more, not even an end."""

    def __init__(self, address: str) -> None:
        host, _, port = address.partition(":")
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self._server = (host, int(port))
        self._sockets: list[socket.socket] = []
        self._is_cut = threading.Event()
        self._threads = [threading.Thread(target=self._accept)]
        self._threads[0].start()

    def cut(self) -> None:
        self._is_cut.set()

    def close(self) -> None:
        self.cut()
        for each in (*self._sockets, self._listener):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()
        for thread in self._threads:
            thread.join(LIMIT_S)

    def _accept(self) -> None:
        try:
            near, _ = self._listener.accept()
        except OSError:  # it is closed before anybody came
            return
        far = socket.create_connection(self._server)
        self._sockets = [near, far]
        for source, sink in ((near, far), (far, near)):
            self._threads.append(threading.Thread(target=self._carry, args=(source, sink)))
            self._threads[-1].start()

    def _carry(self, source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                if not self._is_cut.is_set():
                    sink.sendall(data)


@pytest.mark.slow
def test_a_caller_whose_host_vanishes_without_a_word_cancels_his_go_to(daemon: DaemonProcess, stub: Any) -> None:
    cable = Cable(daemon.address)
    try:
        with grpc.insecure_channel(cable.address) as channel:
            going = Stub(channel).GoToWaypoint.future(far_away())
            daemon.wait_for("command", command="go_to_waypoint")
            cable.cut()
            daemon.wait_for("caller_gone", cancelled=True)  # by keepalive: a connection that is cut has no end
            going.cancel()
    finally:
        cable.close()
    assert holds(stub)


def test_a_take_off_goes_on_without_its_caller(daemon: DaemonProcess) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")
    stub = Stub(daemon.channel())
    rising = stub.TakeOff.future(pb.TakeOffRequest(height_m=5.0))
    daemon.wait_for("state", new="TAKING_OFF")
    rising.cancel()
    daemon.wait_for("caller_gone", kind="TAKE_OFF", cancelled=False)
    daemon.wait_for("task_done", task="take_off")
    assert holds(stub)


def test_a_task_that_nobody_waits_for_goes_on(stub: Any) -> None:
    request = far_away()
    request.non_blocking = True
    task = stub.GoToWaypoint(request, timeout=LIMIT_S).task
    assert task.status == pb.TASK_STATUS_RUNNING
    watching = stub.WatchTask(pb.WatchTaskRequest(task_id=task.id, rate_hz=100.0), timeout=LIMIT_S)
    assert next(watching).task.status == pb.TASK_STATUS_RUNNING
    stub.Abort(pb.AbortRequest(task_id=task.id), timeout=LIMIT_S)
    last = list(watching)[-1].task
    assert last.status == pb.TASK_STATUS_ABORTED
    assert last.error.reason == "TASK_ABORTED"


def test_a_task_is_watched_at_most_as_often_as_the_uav_is_updated(stub: Any) -> None:
    request = far_away()
    request.non_blocking = True
    task = stub.GoToWaypoint(request, timeout=LIMIT_S).task
    start_s = time.monotonic()
    watching = stub.WatchTask(pb.WatchTaskRequest(task_id=task.id, rate_hz=1e9), timeout=LIMIT_S)
    for _ in range(11):
        next(watching)
    assert time.monotonic() - start_s > 0.19  # ten pauses of 0.02 s
    stub.Abort(pb.AbortRequest(task_id=task.id), timeout=LIMIT_S)
    assert list(watching)[-1].task.status == pb.TASK_STATUS_ABORTED


# --- Telemetry --------------------------------------------------------------------------------------------------------


@pytest.fixture
def fast_daemon(start_daemon: StartDaemon) -> DaemonProcess:
    """A daemon with so many updates that a connection is soon full."""
    return start_daemon("--set", "light.speed_factor=100")


def test_a_slow_reader_gets_the_newest_and_learns_how_many_it_missed(fast_daemon: DaemonProcess) -> None:
    slow, quick = (Stub(fast_daemon.channel()).StreamTelemetry(pb.StreamTelemetryRequest()) for _ in range(2))
    first = next(slow).telemetry.sequence
    # The slow one does not read on until thousands were sent, far more than the connection can hold.
    for answer in quick:
        if answer.telemetry.sequence > first + 5000:
            newest = answer.telemetry.sequence
            break
    quick.cancel()
    expected = first
    missed_count = 0
    for answer in slow:
        missed_count += answer.missed_count
        expected += 1 + answer.missed_count
        assert answer.telemetry.sequence == expected  # each sample was either sent, or is counted
        if answer.telemetry.sequence >= newest:
            break
    slow.cancel()
    assert missed_count > 0


def test_a_reader_that_never_reads_holds_up_nobody_at_shutdown(fast_daemon: DaemonProcess) -> None:
    stuck, quick = (Stub(fast_daemon.channel()).StreamTelemetry(pb.StreamTelemetryRequest()) for _ in range(2))
    first = next(stuck).telemetry.sequence
    next(answer for answer in quick if answer.telemetry.sequence > first + 5000)
    fast_daemon.signal(signal.SIGTERM)
    assert fast_daemon.wait() == 0
    # Bytes that lie unread in the daemon's socket at its end make the system reset the connection, perhaps first.
    with pytest.raises(grpc.RpcError, match=r"the daemon is shutting down|Connection reset by peer"):
        list(stuck)


def test_each_reader_has_the_rate_it_requested(daemon: DaemonProcess) -> None:
    stub = Stub(daemon.channel())
    few = stub.StreamTelemetry(pb.StreamTelemetryRequest(rate_hz=5.0), timeout=LIMIT_S)
    sequences = [next(few).telemetry.sequence for _ in range(12)]
    few.cancel()
    # At ten times the speed there are some hundred updates between two samples. One that a busy computer sends late is
    # followed by the next one sooner.
    assert sequences[-1] - sequences[1] > 5 * len(sequences)
    assert all(later > earlier for earlier, later in pairwise(sequences))


# --- Health -----------------------------------------------------------------------------------------------------------


def test_health_follows_the_link(daemon: DaemonProcess) -> None:
    health: Any = health_pb2_grpc.HealthStub(daemon.channel())
    simulation: Any = simulation_pb2_grpc.SimulationServiceStub(daemon.channel())
    daemon.wait_for("state", new="LANDED_ARMED")
    watching = health.Watch(health_pb2.HealthCheckRequest(service="ual.v1.UalService"), timeout=LIMIT_S)
    assert next(watching).status == health_pb2.HealthCheckResponse.SERVING
    lost = simulation_pb2.Fault(link_lost=simulation_pb2.LinkLost())
    simulation.BeginFault(simulation_pb2.BeginFaultRequest(fault=lost), timeout=LIMIT_S)
    assert next(watching).status == health_pb2.HealthCheckResponse.NOT_SERVING
    simulation.EndFault(simulation_pb2.EndFaultRequest(), timeout=LIMIT_S)
    assert next(watching).status == health_pb2.HealthCheckResponse.SERVING
    watching.cancel()


# --- The simulation ---------------------------------------------------------------------------------------------------


def test_a_long_step_holds_up_no_other_call(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--set", "light.speed_factor=0")
    simulation: Any = simulation_pb2_grpc.SimulationServiceStub(daemon.channel())
    stub = Stub(daemon.channel())
    stepping = simulation.Step.future(simulation_pb2.StepRequest(duration_s=3600.0))
    first = stub.GetTelemetry(pb.GetTelemetryRequest(), timeout=LIMIT_S).telemetry.sequence
    while stub.GetTelemetry(pb.GetTelemetryRequest(), timeout=LIMIT_S).telemetry.sequence == first:
        pass  # not begun yet
    assert not stepping.done()
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0


# --- Without our client code ------------------------------------------------------------------------------------------


class Reflected:
    """A client that knows nothing but the address: everything else it asks the server."""

    def __init__(self, channel: grpc.Channel) -> None:
        self._channel = channel
        self._database = ProtoReflectionDescriptorDatabase(channel)
        self._pool = descriptor_pool.DescriptorPool(self._database)
        self.services = set(self._database.get_services())

    def call(self, service: str, method: str, **fields: object) -> Any:
        pool: Any = self._pool
        found = pool.FindServiceByName(service).FindMethodByName(method)
        request = message_factory.GetMessageClass(found.input_type)(**fields)
        answer = message_factory.GetMessageClass(found.output_type)
        invoke: Any = self._channel.unary_unary(
            f"/{service}/{method}",
            request_serializer=lambda message: message.SerializeToString(),
            response_deserializer=answer.FromString,
        )
        return invoke(request, timeout=LIMIT_S)


def test_it_flies_by_reflection_alone(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--set", "light.speed_factor=10", ns="uav_2")
    client = Reflected(daemon.channel())
    uav, simulation = "ual.v1.UalService", "ual.v1.SimulationService"
    standard = {"grpc.health.v1.Health", "grpc.reflection.v1alpha.ServerReflection"}
    assert client.services == {*SERVICES, *standard}
    assert client.call(uav, "GetInfo").namespace == "uav_2"
    client.call(simulation, "PilotArm")
    daemon.wait_for("state", new="LANDED_ARMED")
    succeeded = 2
    assert client.call(uav, "TakeOff", height_m=3.0).task.status == succeeded
    waypoint = {"pose": {"position": {"x": 4.0, "y": 2.0, "z": 3.0}}}
    assert client.call(uav, "GoToWaypoint", waypoint=waypoint).task.status == succeeded
    position = client.call(uav, "GetTelemetry").telemetry.pose.position
    assert (position.x, position.y, position.z) == pytest.approx((4.0, 2.0, 3.0), abs=0.3)
    with pytest.raises(grpc.RpcError) as caught:
        client.call(uav, "RecoverFromManual")
    assert caught.value.code() is grpc.StatusCode.FAILED_PRECONDITION
    info = ErrorInfo()
    status = rpc_status.from_call(caught.value)
    assert status.details[0].Unpack(info)
    assert (info.domain, info.reason, info.metadata["state"]) == ("ual", "WRONG_STATE", "FLYING_AUTO")
    client.call(simulation, "PilotTakeOver")
    daemon.wait_for("state", new="FLYING_MANUAL")
    client.call(uav, "RecoverFromManual")
    assert client.call(uav, "Land").task.status == succeeded
