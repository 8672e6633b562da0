"""The gateway of deploy/gateway, with the real nginx and a fleet behind it."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import grpc
import pytest
from grpc_health.v1 import health_pb2, health_pb2_grpc

import ual
from tests.conftest import LIMIT_S, TIME_TO_BEGIN_S, DaemonProcess, StartDaemon
from ual import _convert, _discovery
from ual.errors import UalError
from ual.geometry import Pose, PoseStamped, Twist, TwistStamped, Vector3
from ual.types import State
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc

GATEWAY = Path(__file__).parents[2] / "deploy" / "gateway"
TLS = Path(__file__).parents[1] / "data" / "tls"
NGINX = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin") or ""  # not on everybody's path
COUNT = 3

pytestmark = pytest.mark.skipif(
    not NGINX,
    reason="NGINX IS MISSING, the gateway is NOT TESTED: apt-get install nginx-light",
)

StartGateway = Callable[..., str]


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as found:
        return int(found.getsockname()[1])


@pytest.fixture
def start_gateway(tmp_path: Path) -> Iterator[StartGateway]:
    """Starts nginx with the configuration of deploy/, on a port of its own and with these UAVs; its address."""
    with ExitStack() as stack:

        def start(uavs: dict[str, str], change: Callable[[str], str] = lambda text: text) -> str:
            address = f"127.0.0.1:{free_port()}"
            text = (GATEWAY / "nginx.conf").read_text()
            assert "127.0.0.1:50050" in text
            (tmp_path / "nginx.conf").write_text(change(text).replace("127.0.0.1:50050", address))
            (tmp_path / "uavs.map").write_text("".join(f"{ns} {where};\n" for ns, where in uavs.items()))
            # Started by root, its workers would be somebody who may not open the test's sockets.
            user = "user root; " if os.geteuid() == 0 else ""
            nginx = subprocess.Popen(
                [NGINX, "-p", str(tmp_path), "-c", "nginx.conf", "-g", f"{user}daemon off;"],
                stderr=subprocess.PIPE,
                text=True,
            )

            def end() -> None:
                nginx.terminate()
                _, said = nginx.communicate(timeout=LIMIT_S)
                print(said)

            stack.callback(end)
            host, _, port = address.rpartition(":")
            deadline_s = time.monotonic() + LIMIT_S
            while True:
                with socket.socket() as probe:
                    if probe.connect_ex((host, int(port))) == 0:
                        return address
                assert nginx.poll() is None, nginx.communicate()[1]
                assert time.monotonic() < deadline_s

        yield start


@pytest.fixture
def fleet(start_daemon: StartDaemon) -> DaemonProcess:
    """uav_1 to uav_3, ten times as fast as real, armed."""
    daemon = start_daemon(
        *("--fleet", str(COUNT), "--auto-arm", "--set", "light.speed_factor=10"), listen="127.0.0.1:0"
    )
    for number in range(1, COUNT + 1):
        daemon.wait_for("state", ns=f"uav_{number}", new="LANDED_ARMED")
    return daemon


@pytest.fixture
def gateway(fleet: DaemonProcess, start_gateway: StartGateway) -> str:
    """The address of the gateway to all of them."""
    uavs = {each.ns: each.address for each in _discovery.list_daemons() if each.pid == fleet.pid}
    assert len(uavs) == COUNT
    return start_gateway(uavs)


def up(uav: ual.Uav) -> None:
    uav.take_off(2.0, timeout_s=LIMIT_S)
    assert uav.state() is State.FLYING_AUTO


def test_calls_reach_the_uav_that_the_metadata_names(gateway: str) -> None:
    for number in range(1, COUNT + 1):
        with ual.Uav(f"uav_{number}", address=gateway) as uav:
            assert uav.info().namespace == f"uav_{number}"
    with ual.Uav("uav_2", address=gateway) as flies, ual.Uav("uav_3", address=gateway) as stays:
        up(flies)
        flies.go_to_waypoint(Pose.at(1.0, 0.0, 2.0), timeout_s=LIMIT_S)
        assert stays.state() is State.LANDED_ARMED
        flies.land(timeout_s=LIMIT_S)


def test_an_error_of_the_daemon_comes_through_with_its_reason(gateway: str) -> None:
    with ual.Uav("uav_1", address=gateway) as uav, pytest.raises(ual.WrongStateError, match="LANDED_ARMED"):
        uav.land()


def test_telemetry_streams_through(gateway: str) -> None:
    with grpc.insecure_channel(gateway) as channel:
        stub: Any = ual_pb2_grpc.UalServiceStub(channel)
        metadata = (("ual-ns", "uav_2"),)
        stream = stub.StreamTelemetry(pb.StreamTelemetryRequest(rate_hz=20.0), metadata=metadata, timeout=LIMIT_S)
        frames = [next(stream).telemetry.odometry.child_frame_id for _ in range(20)]
        stream.cancel()
    assert set(frames) == {"uav_2/base_link"}


def test_setpoints_are_not_held_back(gateway: str) -> None:
    with ual.Uav("uav_1", address=gateway) as uav, grpc.insecure_channel(gateway) as channel:
        up(uav)
        stub: Any = ual_pb2_grpc.UalServiceStub(channel)
        moving = pb.StreamSetpointsRequest(
            velocity=_convert.setpoint_to_proto(TwistStamped(Twist(Vector3(1.0, 0.0, 0.0)))).velocity
        )
        is_moving = False

        def setpoints() -> Iterator[pb.StreamSetpointsRequest]:
            deadline_s = time.monotonic() + LIMIT_S
            while not is_moving and time.monotonic() < deadline_s:
                yield moving  # the stream stays open: were it buffered, nothing would come before its end
                time.sleep(0.01)

        call = stub.StreamSetpoints.future(setpoints(), metadata=(("ual-ns", "uav_1"),), timeout=LIMIT_S)
        while not is_moving and not call.done():
            is_moving = uav.velocity().twist.linear.x > 0.5
        assert is_moving
        assert call.result().accepted_count > 1


def test_a_caller_that_gives_up_ends_its_go_to(gateway: str, fleet: DaemonProcess) -> None:
    with ual.Uav("uav_1", address=gateway) as uav:
        up(uav)
        with pytest.raises(UalError):
            uav.go_to_waypoint(PoseStamped(Pose.at(1000.0, 0.0, 2.0)), timeout_s=TIME_TO_BEGIN_S)
        fleet.wait_for("caller_gone", ns="uav_1", cancelled=True)


def test_health_is_that_of_the_uav(gateway: str) -> None:
    with grpc.insecure_channel(gateway) as channel:
        health: Any = health_pb2_grpc.HealthStub(channel)
        answer = health.Check(
            health_pb2.HealthCheckRequest(service="ual.v1.UalService"),
            metadata=(("ual-ns", "uav_3"),),
            timeout=LIMIT_S,
        )
        assert answer.status == health_pb2.HealthCheckResponse.SERVING


@pytest.mark.parametrize(
    ("ns", "code", "message"),
    [
        ("uav_9", grpc.StatusCode.NOT_FOUND, "the gateway knows no UAV of the namespace uav_9"),
        (None, grpc.StatusCode.NOT_FOUND, "the gateway has many UAVs: say which one by the metadata ual-ns"),
        ("uav_1", grpc.StatusCode.UNAVAILABLE, "the gateway cannot reach the daemon of uav_1 at 127.0.0.1:1"),
    ],
)
def test_a_uav_that_is_not_there_is_told(
    start_gateway: StartGateway, ns: str | None, code: grpc.StatusCode, message: str
) -> None:
    with grpc.insecure_channel(start_gateway({"uav_1": "127.0.0.1:1"})) as channel:
        stub: Any = ual_pb2_grpc.UalServiceStub(channel)
        metadata = () if ns is None else (("ual-ns", ns),)
        with pytest.raises(grpc.RpcError) as caught:
            stub.GetInfo(pb.GetInfoRequest(), metadata=metadata, timeout=LIMIT_S)
        assert caught.value.code() is code
        assert caught.value.details() == message
        with pytest.raises(grpc.RpcError) as caught:
            next(stub.StreamTelemetry(pb.StreamTelemetryRequest(), metadata=metadata, timeout=LIMIT_S))
        assert caught.value.code() is code


def test_daemons_on_unix_sockets(start_daemon: StartDaemon, start_gateway: StartGateway, tmp_path: Path) -> None:
    daemon = start_daemon(listen=f"unix:{tmp_path}/uav_1.sock")
    daemon.wait_for("listening")
    with ual.Uav("uav_1", address=start_gateway({"uav_1": daemon.address})) as uav:
        assert uav.info().namespace == "uav_1"


def test_tls(start_daemon: StartDaemon, start_gateway: StartGateway) -> None:
    daemon = start_daemon()

    def with_tls(text: str) -> str:
        plain = "listen 127.0.0.1:50050 http2"
        assert plain in text
        files = f"ssl_certificate {TLS}/certificate.pem; ssl_certificate_key {TLS}/key.pem;"
        return text.replace(plain, f"{files} listen 127.0.0.1:50050 ssl http2")

    address = start_gateway({"uav_1": daemon.address}, with_tls)
    with ual.Uav("uav_1", address=address.replace("127.0.0.1", "localhost"), tls_ca=TLS / "certificate.pem") as uav:
        assert uav.info().namespace == "uav_1"


def test_the_command_goes_through_it(gateway: str) -> None:
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            "from ual._cli.main import main; main()",
            "--address",
            gateway,
            "--ns",
            "uav_2",
            "--json",
            "info",
        ],
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
    )
    assert done.returncode == 0, done.stderr
    assert '"uav_2"' in done.stdout


def test_the_files_as_they_are_can_be_used(tmp_path: Path) -> None:
    shutil.copytree(GATEWAY, tmp_path / "gateway")
    done = subprocess.run(
        [NGINX, "-p", str(tmp_path / "gateway"), "-c", "nginx.conf", "-t"],
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
    )
    assert done.returncode == 0, done.stderr
