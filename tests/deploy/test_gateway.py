"""The gateway of deploy/gateway, with the real nginx and a fleet behind it."""

from __future__ import annotations

import os
import shutil
import socket
import ssl
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from http.client import HTTPSConnection
from pathlib import Path
from typing import Any

import grpc
import pytest
from click.testing import CliRunner, Result
from cryptography import x509
from cryptography.x509.oid import NameOID
from grpc_health.v1 import health_pb2, health_pb2_grpc

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.ports import free_port
from tests.ual_daemon.server.access.entrances import Made, beyond_loopback, make_files
from tests.waiting import until
from ual import discovery
from ual.errors import UalError
from ual.geometry import Pose, PoseStamped, Twist, TwistStamped, Vector3
from ual.types import State
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc
from ual.wire import motions
from ual_tools.access import certificates
from ual_tools.main import cli

GATEWAY = Path(__file__).parents[2] / "deploy" / "gateway"
TLS = Path(__file__).parents[1] / "data" / "tls"
NGINX = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin") or ""  # not on everybody's path
COUNT = 3

pytestmark = pytest.mark.skipif(
    not NGINX,
    reason="NGINX IS MISSING, the gateway is NOT TESTED: apt-get install nginx-light",
)

StartGateway = Callable[..., str]


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
            # Started by root, its workers would run as a user that may not open the test's sockets.
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

            def is_there() -> bool:
                assert nginx.poll() is None, nginx.communicate()[1]
                with socket.socket() as probe:
                    return probe.connect_ex((host, int(port))) == 0

            until(is_there)
            return address

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
    uavs = {each.ns: each.address for each in discovery.list_daemons() if each.pid == fleet.pid}
    assert len(uavs) == COUNT
    return start_gateway(uavs)


def up(uav: ual.Uav) -> None:
    uav.take_off(2.0, timeout_s=LIMIT_S)
    assert uav.state() is State.FLYING_AUTO


def test_calls_get_to_the_uav_that_the_metadata_names(gateway: str) -> None:
    for number in range(1, COUNT + 1):
        with ual.Uav(f"uav_{number}", address=gateway) as uav:
            assert uav.info().namespace == f"uav_{number}"
    with ual.Uav("uav_2", address=gateway) as flies, ual.Uav("uav_3", address=gateway) as stays:
        up(flies)
        flies.go_to_waypoint(Pose.at(1.0, 0.0, 2.0), timeout_s=LIMIT_S)
        assert stays.state() is State.LANDED_ARMED
        flies.land(timeout_s=LIMIT_S)


def test_the_command_flies_several_through_it(gateway: str) -> None:
    def run(*words: str) -> Result:
        return CliRunner().invoke(cli, ("--address", gateway, "--ns", *words))

    result = run("uav_1,uav_3", "takeoff", "2")
    assert (result.exit_code, result.stdout.count("TAKE_OFF SUCCEEDED")) == (0, 2), result.output
    lines = run("uav_1,uav_2,uav_3", "watch", "--once").stdout.splitlines()
    assert [line.split("\t")[:2] for line in sorted(lines)] == [
        ["uav_1", "FLYING_AUTO"],
        ["uav_2", "LANDED_ARMED"],
        ["uav_3", "FLYING_AUTO"],
    ]
    result = run("uav_1,uav_9", "goto", "1", "0", "2")
    assert (result.exit_code, "knows no UAV of the namespace uav_9" in result.stderr) == (1, True), result.output


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
            velocity=motions.setpoint_to_proto(TwistStamped(Twist(Vector3(1.0, 0.0, 0.0)))).velocity
        )
        is_moving = False

        def setpoints() -> Iterator[pb.StreamSetpointsRequest]:
            deadline_s = time.monotonic() + LIMIT_S
            while not is_moving and time.monotonic() < deadline_s:
                yield moving  # the stream stays open: were it buffered, nothing would come before its end
                time.sleep(0.01)  # at a pilot's rate

        call = stub.StreamSetpoints.future(setpoints(), metadata=(("ual-ns", "uav_1"),), timeout=LIMIT_S)
        while not is_moving and not call.done():
            is_moving = uav.velocity().twist.linear.x > 0.5
        assert is_moving
        assert call.result().accepted_count > 1


def test_a_caller_that_gives_up_ends_its_go_to(gateway: str, fleet: DaemonProcess) -> None:
    with ual.Uav("uav_1", address=gateway) as uav:
        up(uav)

        def go_to(limit_s: float) -> None:
            with pytest.raises(UalError):
                uav.go_to_waypoint(PoseStamped(Pose.at(1000.0, 0.0, 2.0)), timeout_s=limit_s)

        fleet.give_up_begun("go_to_waypoint", go_to)
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
        (None, grpc.StatusCode.NOT_FOUND, "the gateway has many UAVs: name one (`ual --ns`, else the metadata ual-ns)"),
        ("uav_1", grpc.StatusCode.UNAVAILABLE, "the gateway cannot reach the daemon of uav_1 at 127.0.0.1:1"),
    ],
)
def test_a_uav_that_is_not_there_is_reported(
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


# --- The gateway's own errors, as they are on the wire ----------------------------------------------------------------

HEADERS, DATA, SETTINGS = 1, 0, 4
END_STREAM, END_HEADERS = 1, 4
HTTP_STATUS_200 = b"\x88"  # the static table of HPACK has it whole
CONTENT_TYPE_GRPC = bytes.fromhex("5f8b1d75d0620d263d4c4d6564")  # content-type: application/grpc, in Huffman's code


def http2_frame(kind: int, flags: int, stream: int, payload: bytes = b"") -> bytes:
    return len(payload).to_bytes(3, "big") + bytes([kind, flags]) + stream.to_bytes(4, "big") + payload


def http2_headers(**more: str) -> bytes:
    fields = {
        ":method": "POST",
        ":scheme": "http",
        ":path": "/ual.v1.UalService/GetInfo",
        ":authority": "gateway",
        "content-type": "application/grpc",
        "te": "trailers",
        **{name.replace("_", "-"): value for name, value in more.items()},
    }
    # Each as HPACK's literal that is not indexed, without Huffman's code.
    return b"".join(
        bytes([0, len(name), *name.encode(), len(value), *value.encode()]) for name, value in fields.items()
    )


def frames_of_answer(address: str, headers: bytes) -> list[tuple[int, int, bytes]]:
    """Kind, flags and payload of each frame that answers one request, until the stream ends."""
    host, _, port = address.rpartition(":")
    with socket.create_connection((host, int(port)), timeout=LIMIT_S) as connection, connection.makefile("rb") as read:
        connection.sendall(
            b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
            + http2_frame(SETTINGS, 0, 0)
            + http2_frame(HEADERS, END_HEADERS, 1, headers)
            + http2_frame(DATA, END_STREAM, 1, bytes(5))
        )
        found: list[tuple[int, int, bytes]] = []
        while True:
            head = read.read(9)
            payload = read.read(int.from_bytes(head[:3], "big"))
            if int.from_bytes(head[5:], "big") == 1:
                found.append((head[3], head[4], payload))
                if head[3] not in (HEADERS, DATA) or head[4] & END_STREAM:
                    return found


@pytest.mark.parametrize("ns", ["uav_9", "uav_1", ""])
def test_an_error_is_one_frame_of_headers_as_grpc_prescribes(start_gateway: StartGateway, ns: str) -> None:
    headers = http2_headers(ual_ns=ns) if ns else http2_headers()
    [(kind, flags, payload)] = frames_of_answer(start_gateway({"uav_1": "127.0.0.1:1"}), headers)
    assert kind == HEADERS
    assert flags & END_STREAM
    assert payload.startswith(HTTP_STATUS_200)
    assert CONTENT_TYPE_GRPC in payload


def test_a_gateway_without_a_free_connection_says_so(start_daemon: StartDaemon, start_gateway: StartGateway) -> None:
    daemon = start_daemon()

    def with_few_connections(text: str) -> str:
        assert "worker_connections 8192;" in text
        return text.replace("worker_connections 8192;", "worker_connections 8;").replace(
            "worker_processes auto;", "worker_processes 1;"
        )

    address = start_gateway({"uav_1": daemon.address}, with_few_connections)
    with grpc.insecure_channel(address) as channel:
        stub: Any = ual_pb2_grpc.UalServiceStub(channel)
        streams = [
            stub.StreamTelemetry(pb.StreamTelemetryRequest(), metadata=(("ual-ns", "uav_1"),), timeout=LIMIT_S)
            for _ in range(12)
        ]
        codes = []
        for stream in streams:
            try:
                next(stream)
            except grpc.RpcError as error:
                codes.append(error.code())
        for stream in streams:
            stream.cancel()
    assert codes
    assert set(codes) == {grpc.StatusCode.RESOURCE_EXHAUSTED}


def test_a_caller_without_a_certificate_is_unauthenticated(
    start_daemon: StartDaemon, start_gateway: StartGateway
) -> None:
    daemon = start_daemon()

    def with_callers(text: str) -> str:
        files = f"ssl_certificate {TLS}/certificate.pem; ssl_certificate_key {TLS}/key.pem;"
        callers = f"ssl_client_certificate {TLS}/certificate.pem; ssl_verify_client on;"
        return text.replace("listen 127.0.0.1:50050 http2", f"{files} {callers} listen 127.0.0.1:50050 ssl http2")

    address = start_gateway({"uav_1": daemon.address}, with_callers).replace("127.0.0.1", "localhost")
    with (
        ual.Uav("uav_1", address=address, tls_ca=TLS / "certificate.pem") as uav,
        pytest.raises(ual.UnauthenticatedError, match="certificate"),
    ):
        uav.info()


@pytest.fixture
def made(tmp_path: Path) -> Made:
    return make_files(tmp_path / "team", beyond_loopback())


def test_a_caller_from_elsewhere_needs_a_token_behind_it(
    start_daemon: StartDaemon, start_gateway: StartGateway, made: Made
) -> None:
    host, port = beyond_loopback(), free_port()
    daemon = start_daemon("--tokens", str(made.directory / "tokens.json"))
    near = start_gateway(
        {"uav_1": daemon.address},
        lambda text: text.replace("listen 127.0.0.1:50050", f"listen {host}:{port} http2; listen 127.0.0.1:50050"),
    )
    with ual.Uav("uav_1", address=near) as uav:
        uav.set_home()  # a caller of this computer is a commander, as without the gateway
    forged = (("ual-ns", "uav_1"), ("x-forwarded-for", "127.0.0.1"), ("x-ual-certificate", "commander"))
    shown = (("ual-ns", "uav_1"), ("authorization", f"Bearer {made.tokens['observer']}"))
    with grpc.insecure_channel(f"{host}:{port}") as channel:
        stub = ual_pb2_grpc.UalServiceStub(channel)
        for metadata in (forged[:1], forged):
            with pytest.raises(grpc.RpcError) as caught:
                stub.GetInfo(pb.GetInfoRequest(), metadata=metadata, timeout=LIMIT_S)
            assert caught.value.code() is grpc.StatusCode.UNAUTHENTICATED
        assert stub.GetInfo(pb.GetInfoRequest(), metadata=shown, timeout=LIMIT_S).namespace == "uav_1"
        with pytest.raises(grpc.RpcError) as caught:
            stub.SetHome(pb.SetHomeRequest(), metadata=shown, timeout=LIMIT_S)
        assert caught.value.code() is grpc.StatusCode.PERMISSION_DENIED


def test_it_passes_on_the_name_in_a_callers_certificate(
    start_daemon: StartDaemon, start_gateway: StartGateway, made: Made
) -> None:
    daemon = start_daemon("--roles", str(made.directory / "roles.yaml"))
    pair = certificates.files(made.directory, "uav_1")

    def with_callers(text: str) -> str:
        files = f"ssl_certificate {pair.certificate}; ssl_certificate_key {pair.key};"
        callers = f"ssl_client_certificate {made.authority}; ssl_verify_client on;"
        return text.replace("listen 127.0.0.1:50050 http2", f"{files} {callers} listen 127.0.0.1:50050 ssl http2")

    address = start_gateway({"uav_1": daemon.address}, with_callers)
    for name in ("observer", "commander", "unknown"):
        mine = certificates.files(made.directory, name)
        shown = ual.Credentials(tls_certificate=mine.certificate, tls_key=mine.key)
        with ual.Uav("uav_1", address=address, tls_ca=made.authority, credentials=shown) as uav:
            if name == "commander":
                uav.set_home()
                continue
            with pytest.raises(ual.PermissionDeniedError if name == "observer" else ual.UnauthenticatedError):
                uav.set_home()


@pytest.mark.parametrize(
    ("subject", "name"),
    [
        ([("CN", "pilot.a-1@x_y")], "pilot.a-1@x_y"),
        ([("O", "a team"), ("CN", "pilot")], "pilot"),
        ([("CN", "pilot"), ("O", "a team")], "pilot"),
        ([("CN", "pilot"), ("O", "x,CN=commander")], "pilot"),
        ([("CN", "pilot"), ("O", r"x\,CN=commander")], "pilot"),
        ([("O", "x,CN=commander"), ("CN", "pilot")], "pilot"),
        ([("CN", "commander,x")], ""),
        ([("CN", "x,CN=commander")], ""),
        ([("CN", "commander\nx")], ""),
        ([("CN", "commander+x")], ""),
        ([("CN", "kommandör")], ""),
        ([("CN", "pilot"), ("CN", "commander")], ""),
        ([("O", "x")], ""),
    ],
)
def test_only_a_plain_common_name_is_a_callers_name(
    start_gateway: StartGateway, made: Made, monkeypatch: pytest.MonkeyPatch, subject: list[tuple[str, str]], name: str
) -> None:
    kinds = {"CN": NameOID.COMMON_NAME, "O": NameOID.ORGANIZATION_NAME}
    written = x509.Name([x509.NameAttribute(kinds[kind], value) for kind, value in subject])
    monkeypatch.setattr(certificates, "_subject", lambda _: written)
    mine = certificates.make_caller(made.directory, "odd", 1.0)
    pair = certificates.files(made.directory, "uav_1")

    def with_callers(text: str) -> str:
        files = f"ssl_certificate {pair.certificate}; ssl_certificate_key {pair.key};"
        callers = f"ssl_client_certificate {made.authority}; ssl_verify_client on;"
        shown = "location = /who { return 200 $certificate; }"
        return text.replace("listen 127.0.0.1:50050 http2", f"{files} {callers} {shown} listen 127.0.0.1:50050 ssl")

    context = ssl.create_default_context(cafile=str(made.authority))
    context.check_hostname = False
    context.load_cert_chain(mine.certificate, mine.key)
    with closing(HTTPSConnection(start_gateway({}, with_callers), context=context, timeout=LIMIT_S)) as connection:
        connection.request("GET", "/who")
        assert connection.getresponse().read().decode() == name


def test_a_daemon_that_dies_during_a_call_is_unreachable_to_the_python_client(
    start_daemon: StartDaemon, start_gateway: StartGateway
) -> None:
    daemon = start_daemon("--auto-arm", "--set", "light.speed_factor=10")
    daemon.wait_for("state", new="LANDED_ARMED")
    with ual.Uav("uav_1", address=start_gateway({"uav_1": daemon.address})) as uav:
        task = uav.take_off(100.0, blocking=False)
        progress = task.watch()
        next(progress)
        daemon.process.kill()
        with pytest.raises(ual.DaemonUnreachableError, match="was lost"):
            for _ in progress:
                pass


def test_the_python_client_says_in_words_what_the_gateway_misses(start_gateway: StartGateway) -> None:
    address = start_gateway({"uav_1": "127.0.0.1:1"})
    for ns, message in (
        ("uav_9", "the gateway knows no UAV of the namespace uav_9"),
        ("uav_1", "the gateway cannot reach the daemon of uav_1 at 127.0.0.1:1"),
    ):
        with ual.Uav(ns, address=address) as uav, pytest.raises(ual.DaemonUnreachableError) as caught:
            uav.info()
        assert caught.value.message == f"{message} (at {address})"


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
            "from ual_tools.main import main; main()",
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
