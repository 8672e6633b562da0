"""The daemon as a real process: how it starts, what it refuses, and how it ends."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import grpc
import pytest
import yaml
from grpc_health.v1 import health_pb2, health_pb2_grpc

from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.ports import free_port
from tests.ual_daemon.program.refusal import refused
from ual import discovery
from ual.errors import TaskAbortedError
from ual.v1 import simulation_pb2, simulation_pb2_grpc, ual_pb2_grpc
from ual.v1 import ual_pb2 as pb
from ual.wire import rpc_errors

TLS = Path(__file__).parents[2] / "data" / "tls"
started = pytest.mark.usefixtures("started_daemons")
"""For how it starts, and how a signal ends it; what it does in between is that of one which was forked off."""


def stub_of(daemon: DaemonProcess) -> ual_pb2_grpc.UalServiceStub[Any]:
    return ual_pb2_grpc.UalServiceStub(daemon.channel())


def namespace_of(channel: grpc.Channel) -> str:
    return ual_pb2_grpc.UalServiceStub(channel).GetInfo(pb.GetInfoRequest(), timeout=LIMIT_S).namespace


def health_of(daemon: DaemonProcess, service: str = "") -> Any:
    stub: Any = health_pb2_grpc.HealthStub(daemon.channel())
    return stub.Check(health_pb2.HealthCheckRequest(service=service), timeout=LIMIT_S).status


def waypoint(x: float, y: float, z: float) -> pb.GoToWaypointRequest:
    request = pb.GoToWaypointRequest()
    request.waypoint.pose.position.x = x
    request.waypoint.pose.position.y = y
    request.waypoint.pose.position.z = z
    return request


def flying(daemon: DaemonProcess, height_m: float = 2.0) -> ual_pb2_grpc.UalServiceStub[Any]:
    """A stub of the daemon, whose UAV flies."""
    daemon.wait_for("state", new="LANDED_ARMED")
    stub = stub_of(daemon)
    stub.TakeOff(pb.TakeOffRequest(height_m=height_m), timeout=LIMIT_S)
    return stub


def let_time_stand_still(daemon: DaemonProcess) -> None:
    simulation = simulation_pb2_grpc.SimulationServiceStub(daemon.channel())
    simulation.SetSpeedFactor(simulation_pb2.SetSpeedFactorRequest(speed_factor=0.0), timeout=LIMIT_S)


# --- Starting ---------------------------------------------------------------------------------------------------------


@started
def test_two_daemons_fly_side_by_side(start_daemon: StartDaemon) -> None:
    daemons = [start_daemon(ns=ns) for ns in ("uav_1", "uav_2")]
    for daemon in daemons:
        assert namespace_of(daemon.channel()) == daemon.ns
    assert [each.ns for each in discovery.list_daemons()] == ["uav_1", "uav_2"]
    assert discovery.find("uav_2") == daemons[1].address


def test_a_namespace_flies_once_on_a_computer(start_daemon: StartDaemon) -> None:
    first = start_daemon()
    address = first.address
    second = start_daemon()
    assert second.wait() == 1
    assert second.stderr == (
        f"ual-daemon: uav_1 is already flown by pid {first.pid} at {address}: "
        "stop that daemon, or choose another --ns\n"
    )
    assert namespace_of(first.channel()) == "uav_1"


@started
def test_what_a_killed_daemon_left_is_in_nobodys_path(start_daemon: StartDaemon) -> None:
    listen = f"127.0.0.1:{free_port()}"
    killed = start_daemon(listen=listen)
    killed.wait_for("listening")
    killed.signal(signal.SIGKILL)
    assert killed.wait() == -signal.SIGKILL
    again = start_daemon(listen=listen)
    assert again.address == listen
    found = discovery.registered("uav_1")
    assert found is not None
    assert found.pid == again.pid


@pytest.mark.parametrize("transport", ["core", "aio"])
def test_a_port_in_use_is_refused_and_says_by_whom(transport: str, start_daemon: StartDaemon) -> None:
    first = start_daemon("--transport", transport)
    second = start_daemon("--transport", transport, ns="uav_2", listen=first.address)
    assert second.wait() == 1
    assert second.stderr.startswith(
        f"ual-daemon: cannot listen on {first.address}: the port is in use by pid {first.pid} ("
    )
    assert discovery.registered("uav_2") is None


@pytest.mark.parametrize("transport", ["core", "aio"])
def test_garbage_on_the_port_disturbs_nobody(transport: str, start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--transport", transport)
    host, _, port = daemon.address.partition(":")
    generator = os.urandom
    for garbage in (b"GET / HTTP/1.1\r\n\r\n", generator(4096), b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + generator(4096)):
        with socket.create_connection((host, int(port)), LIMIT_S) as connection:
            connection.sendall(garbage)
            connection.shutdown(socket.SHUT_WR)
    with socket.create_connection((host, int(port)), LIMIT_S):  # and one that says nothing at all
        assert namespace_of(daemon.channel()) == "uav_1"


@pytest.mark.parametrize("transport", ["core", "aio"])
def test_it_listens_on_several_addresses_and_on_a_unix_socket(
    transport: str, start_daemon: StartDaemon, tmp_path: Path
) -> None:
    path = tmp_path / "uav_1.sock"
    daemon = start_daemon("--transport", transport, "--listen", f"unix:{path}")
    assert namespace_of(daemon.channel()) == "uav_1"
    with grpc.insecure_channel(f"unix:{path}") as channel:
        assert namespace_of(channel) == "uav_1"
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0
    assert not path.exists()


@pytest.mark.parametrize("transport", ["core", "aio"])
def test_with_tls_it_serves_who_trusts_it_beyond_loopback(
    transport: str, start_daemon: StartDaemon, tmp_path: Path
) -> None:
    key = tmp_path / "key.pem"
    key.touch(0o600)
    key.write_bytes((TLS / "key.pem").read_bytes())
    daemon = start_daemon(
        "--transport",
        transport,
        "--tls-certificate",
        str(TLS / "certificate.pem"),
        "--tls-key",
        str(key),
        listen="0.0.0.0:0",
    )
    port = daemon.address.rpartition(":")[2]
    trusted = grpc.ssl_channel_credentials((TLS / "certificate.pem").read_bytes())
    with grpc.secure_channel(f"localhost:{port}", trusted) as channel:
        assert namespace_of(channel) == "uav_1"
    with (
        grpc.insecure_channel(f"127.0.0.1:{port}") as plain,
        pytest.raises(grpc.RpcError),
    ):
        namespace_of(plain)


def test_without_an_autopilot_it_answers_and_does_not_serve(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--url", f"udpin://127.0.0.1:{free_port()}", backend="mavlink")
    stub = stub_of(daemon)
    assert stub.GetInfo(pb.GetInfoRequest(), timeout=LIMIT_S).backend == "mavlink"
    telemetry = stub.GetTelemetry(pb.GetTelemetryRequest(), timeout=LIMIT_S).telemetry
    assert telemetry.state == pb.STATE_UNINITIALIZED
    assert "nothing heard from the autopilot" in telemetry.state_reason
    for service in ("", "ual.v1.UalService"):
        assert health_of(daemon, service) == health_pb2.HealthCheckResponse.NOT_SERVING
    with pytest.raises(grpc.RpcError) as caught:
        health_of(daemon, "ual.v1.SimulationService")
    assert caught.value.code() is grpc.StatusCode.NOT_FOUND
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0


# --- Configuration ----------------------------------------------------------------------------------------------------


@pytest.fixture
def refusal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Function that returns the error of ``ual-daemon`` when it refuses its flags, with exit status 2 and in one
    line.
    """
    monkeypatch.chdir(tmp_path)

    def run(*flags: str, **environment: str) -> str:
        return refused(flags, {**os.environ, discovery.RUNTIME_DIR_VARIABLE: str(tmp_path / "ual"), **environment})

    return run


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        (
            ["--backend", "parrot"],
            "ual-daemon: --backend: there is no backend 'parrot'; known are airsim, crazyflie, dji, light, mavlink",
        ),
        (["--ns", "uav 1"], "ual-daemon: --ns: expected a name: letters"),
        (["--listen", "50051"], "ual-daemon: --listen: '50051' is no address: expected HOST:PORT or unix:PATH"),
        (["--listen", "127.0.0.1:٥٠"], "ual-daemon: --listen: '127.0.0.1:٥٠' is no address"),
        (["--backend", "airsim", "--url", "h:٥٠"], "ual-daemon: --url: 'h:٥٠' is no address"),
        (["--backend", "mavros", "--url", "rosbridge://h:٥٠"], "ual-daemon: --url: 'rosbridge://h:٥٠' is no address"),
        (["--listen", "0.0.0.0:1"], "ual-daemon: --listen: 0.0.0.0:1 can be reached from other computers"),
        (["--set", "limits.climb_speed_m_s=x"], "ual-daemon: --set limits.climb_speed_m_s: expected a number"),
        (["--set", "light.speed=x"], "ual-daemon: --set light.speed: there is no such setting"),
        (["--tls-key", "k.pem"], "ual-daemon: tls_certificate: a certificate and its key are needed together"),
        (
            ["--tls-key", "k.pem", "--tls-certificate", "c.pem"],
            "ual-daemon: --tls-certificate: c.pem cannot be read: No such file or directory",
        ),
        (["--config", "no.yaml"], "ual-daemon: no.yaml: cannot be read: No such file or directory"),
        (
            ["--auto-arm", "--backend", "mavlink", "--url", "serial:///dev/ttyACM0:57600"],
            "ual-daemon: --auto-arm: the mavlink backend flies a real UAV at serial:///dev/ttyACM0:57600: its",
        ),
    ],
)
def test_wrong_flags_are_reported_in_one_message(refusal: Callable[..., str], flags: list[str], expected: str) -> None:
    assert refusal(*flags).startswith(expected)


@pytest.mark.parametrize("autopilot", ["px4", "ArduPilot"])
def test_the_name_of_an_autopilot_is_answered_with_its_backend(refusal: Callable[..., str], autopilot: str) -> None:
    assert refusal("--backend", autopilot).endswith(f"; {autopilot} is flown by mavlink")


def test_a_wrong_file_is_reported_with_row_and_key(refusal: Callable[..., str], tmp_path: Path) -> None:
    (tmp_path / "uav.yaml").write_text("ns: uav_1\nlight:\n  seed: many\nlimits: {climb_speed_m_s: 0}\n")
    assert refusal("--config", "uav.yaml").startswith(
        "ual-daemon: uav.yaml:4: limits.climb_speed_m_s: expected a number"
    )
    (tmp_path / "uav.yaml").write_text("ns: uav_1\nlight:\n  seed: many\n")
    assert refusal("--config", "uav.yaml").startswith(
        "ual-daemon: uav.yaml:3: light.seed: expected a whole number, got text"
    )


def test_print_config_makes_the_checks_of_the_start(refusal: Callable[..., str], tmp_path: Path) -> None:
    (tmp_path / "uav.yaml").write_text("ns: uav_1\ngeofence: {polygon: [[0, 0], [9, 9], [9, 0], [0, 9]]}\n")
    assert refusal("--print-config", "--config", "uav.yaml").startswith("ual-daemon: uav.yaml:2: geofence: is no")
    (tmp_path / "uav.yaml").write_text("frames:\n  - {frame_id: a, parent_frame_id: b}\n")
    assert refusal("--print-config", "--config", "uav.yaml").startswith("ual-daemon: uav.yaml:2: frames[0].parent")


def test_files_without_an_end_and_aliases_of_aliases_are_refused(refusal: Callable[..., str], tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    for path in ("/dev/zero", "pipe.yaml"):
        assert refusal("--config", path) == (
            f"ual-daemon: {path}: cannot be read: it is not a regular file (a device or a pipe)"
        )
    (tmp_path / "long.yaml").write_bytes(b"#" * (1 << 20) + b"\n")
    assert refusal("--config", "long.yaml") == "ual-daemon: long.yaml: cannot be read: it is longer than 1048576 bytes"
    levels = [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 9)]
    (tmp_path / "aliases.yaml").write_text("\n".join(["a0: &a0 [x]", *levels]))
    line = refusal("--config", "aliases.yaml")
    assert line.startswith("ual-daemon: aliases.yaml:")
    assert "more than 100000 values, those that aliases (*name) repeat included" in line


def test_a_key_that_everyone_can_read_is_refused(refusal: Callable[..., str], tmp_path: Path) -> None:
    key = tmp_path / "key.pem"
    key.write_bytes((TLS / "key.pem").read_bytes())
    key.chmod(0o644)
    line = refusal("--tls-key", "key.pem", "--tls-certificate", str(TLS / "certificate.pem"))
    assert line.startswith("ual-daemon: --tls-key: every user of this computer can read or change key.pem: run `chmod")


def test_a_wrong_environment_is_reported_by_its_variable(refusal: Callable[..., str]) -> None:
    assert refusal(UAL_BACKEND="parrot").startswith("ual-daemon: UAL_BACKEND: there is no backend 'parrot'")
    assert refusal(UAL_SET="light.seed=x").startswith("ual-daemon: UAL_SET light.seed: expected a whole number")


def test_flags_win_over_environment_over_file_over_defaults(tmp_path: Path) -> None:
    def printed(*flags: str, **environment: str) -> dict[str, Any]:
        found = subprocess.run(
            [sys.executable, "-m", "ual_daemon", "--print-config", *flags],
            cwd=tmp_path,
            env={**os.environ, **environment},
            capture_output=True,
            check=True,
            text=True,
            timeout=LIMIT_S,
        )
        (tmp_path / "printed.yaml").write_text(found.stdout)
        values: dict[str, Any] = yaml.safe_load(found.stdout)
        return values

    (tmp_path / "uav.yaml").write_text("ns: uav_2\nlog_level: debug\nallow_arming: true\nlight: {seed: 1}\n")
    values = printed(
        "--config", "uav.yaml", "--ns", "uav_4", "--no-allow-arming", UAL_NS="uav_3", UAL_LOG_LEVEL="warning"
    )
    # What is the default is a comment: `allow_arming`, and where it listens.
    assert values == {"backend": "light", "ns": "uav_4", "log_level": "warning", "light": {"seed": 1}}
    assert printed("--config", "printed.yaml") == values


def test_a_daemon_that_only_watches_says_so_and_cannot_arm(
    start_daemon: StartDaemon, refusal: Callable[..., str]
) -> None:
    assert refusal("--watch-only", "--auto-arm") == (
        "ual-daemon: --auto-arm: a daemon that only watches arms nothing: leave out watch_only or auto_arm"
    )
    assert refusal("--allow-arming", UAL_WATCH_ONLY="1").startswith("ual-daemon: --allow-arming: a daemon that only")
    daemon = start_daemon("--watch-only")
    daemon.wait_for("state", new="LANDED_DISARMED")
    stub = stub_of(daemon)
    for attempt in (
        lambda: stub.Arm(pb.ArmRequest(), timeout=LIMIT_S),
        lambda: stub.TakeOff(pb.TakeOffRequest(height_m=2.0), timeout=LIMIT_S),
    ):
        with pytest.raises(grpc.RpcError, match="--watch-only") as caught:
            attempt()
        assert caught.value.code() is grpc.StatusCode.PERMISSION_DENIED
    assert not stub.GetInfo(pb.GetInfoRequest(), timeout=LIMIT_S).is_arming_allowed


# --- Ending -----------------------------------------------------------------------------------------------------------


@started
def test_a_shell_that_ignores_ctrl_c_does_not_make_the_daemon_deaf(start_daemon: StartDaemon) -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as of what a script starts with `&`
    try:
        daemon = start_daemon()
    finally:
        signal.signal(signal.SIGINT, before)
    daemon.wait_for("state", new="LANDED_DISARMED")
    daemon.signal(signal.SIGINT)
    assert daemon.wait() == 0
    assert daemon.wait_for("signal", name="SIGINT")["level"] == "info"


@started
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_on_the_ground_a_signal_ends_it_cleanly(start_daemon: StartDaemon, number: signal.Signals) -> None:
    if number is signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
        pytest.skip(f"{number.name} is ignored where these tests run (nohup), and so by the daemon")
    daemon = start_daemon()
    daemon.wait_for("state", new="LANDED_DISARMED")
    daemon.signal(number)
    assert daemon.wait() == 0
    assert discovery.registered("uav_1") is None
    assert not discovery.registry_file("uav_1").exists()
    daemon.wait_for("ended")


@started
def test_in_a_go_to_a_signal_makes_the_autopilot_hold_and_tells_the_callers(daemon: DaemonProcess) -> None:
    stub = flying(daemon)
    telemetry = stub.StreamTelemetry(pb.StreamTelemetryRequest())
    next(telemetry)
    going = stub.GoToWaypoint.future(waypoint(1000.0, 0.0, 2.0))
    daemon.wait_for("command", command="go_to_waypoint")
    daemon.signal(signal.SIGTERM)
    with pytest.raises(grpc.RpcError) as caught:
        going.result(LIMIT_S)
    error = rpc_errors.from_rpc_error(caught.value)
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "shutdown"
    with pytest.raises(grpc.RpcError, match="the daemon is shutting down") as caught:
        for _ in telemetry:
            pass
    assert caught.value.code() is grpc.StatusCode.UNAVAILABLE
    assert daemon.wait() == 0
    daemon.wait_for("hold_by_autopilot")


def test_a_take_off_ends_before_a_signal_ends_the_daemon(daemon: DaemonProcess) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")
    stub = stub_of(daemon)
    simulation = simulation_pb2_grpc.SimulationServiceStub(daemon.channel())
    rising = stub.TakeOff.future(pb.TakeOffRequest(height_m=2.0))
    daemon.wait_for("state", new="TAKING_OFF")
    let_time_stand_still(daemon)
    health_stub: Any = health_pb2_grpc.HealthStub(daemon.channel())  # its types know no Watch
    health = health_stub.Watch(health_pb2.HealthCheckRequest(), timeout=LIMIT_S)
    assert next(health).status == health_pb2.HealthCheckResponse.SERVING
    daemon.signal(signal.SIGTERM)
    assert next(health).status == health_pb2.HealthCheckResponse.NOT_SERVING
    with pytest.raises(grpc.RpcError, match="the daemon is shutting down"):
        stub.Land(pb.LandRequest(), timeout=LIMIT_S)
    simulation.SetSpeedFactor(simulation_pb2.SetSpeedFactorRequest(speed_factor=10.0), timeout=LIMIT_S)
    assert rising.result(LIMIT_S).task.status == pb.TASK_STATUS_SUCCEEDED
    assert daemon.wait() == 0
    daemon.wait_for("hold_by_autopilot")


def test_many_long_paths_are_refused_and_do_not_delay_the_end(daemon: DaemonProcess) -> None:
    stub = flying(daemon)
    path = pb.FollowPathRequest(dry_run=True, corner_radius_m=0.5)
    for i in range(10_000):
        pose = path.waypoints.add().pose
        pose.position.x, pose.position.y, pose.position.z = 5.0 * (i % 2), 3.0 * (i % 7), 2.0
    planned = [stub.FollowPath.future(path) for _ in range(30)]
    codes = [each.code() for each in planned if each.exception(LIMIT_S) is not None]
    assert set(codes) == {grpc.StatusCode.RESOURCE_EXHAUSTED}
    assert len(codes) < len(planned)
    planned = [stub.FollowPath.future(path) for _ in range(2)]
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0


@started
def test_a_daemon_that_leaves_a_uav_in_motion_has_an_exit_status_of_its_own_and_says_what_it_did(
    start_daemon: StartDaemon,
) -> None:
    """Only the safety pilot ends a take-off. Time stands still, so that it does not end in time."""
    daemon = start_daemon(
        "--auto-arm", "--set", "light.speed_factor=10", module="tests.ual_daemon.program.impatient_daemon"
    )
    daemon.wait_for("state", new="LANDED_ARMED")
    stub_of(daemon).TakeOff(pb.TakeOffRequest(height_m=100.0, non_blocking=True), timeout=LIMIT_S)
    daemon.wait_for("state", new="TAKING_OFF")
    let_time_stand_still(daemon)
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 3
    left = daemon.wait_for("leaving_in_flight", state="TAKING_OFF", task="take_off")
    assert left["why"] == "it was not at rest after 1 s"
    assert "in uav_1/odom" in left["position"]
    assert {"progress", "speed_m_s"} <= left.keys()
    assert not any(event.get("event") == "ended" for event in daemon.events)


@started
def test_a_second_signal_ends_it_at_once(daemon: DaemonProcess) -> None:
    """Time stands still, so that the first signal waits for the take-off until the second comes."""
    daemon.wait_for("state", new="LANDED_ARMED")
    stub_of(daemon).TakeOff(pb.TakeOffRequest(height_m=100.0, non_blocking=True), timeout=LIMIT_S)
    daemon.wait_for("state", new="TAKING_OFF")
    let_time_stand_still(daemon)
    daemon.signal(signal.SIGTERM)
    daemon.wait_for("signal")
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 128 + signal.SIGTERM


def test_the_simulated_pilot_arms_again_after_a_landing(daemon: DaemonProcess) -> None:
    stub = flying(daemon)
    stub.Land(pb.LandRequest(), timeout=LIMIT_S)
    disarmed = daemon.wait_for("state", old="LANDED_ARMED", new="LANDED_DISARMED")
    daemon.wait_for("state", after=disarmed, new="LANDED_ARMED")
