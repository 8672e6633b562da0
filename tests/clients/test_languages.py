"""Each language of `clients/` flies its mission on a light UAV, in real time. `make test-clients` runs these."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.clients.toolchains import LANGUAGES, Language, search_path
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.examples.installing import install
from tests.examples.installing import search_path as search_path_with
from tests.ual_daemon.server.access.entrances import beyond_loopback, make_files
from ual.v1 import ual_pb2, ual_pb2_grpc
from ual_tools.access import certificates

BUILD_LIMIT_S = 1200.0
MISSION_LIMIT_S = 120.0
SHOW_WHO_CALLS = ("go", "typescript")
"""Languages whose missions take --tls-ca, --token-file and --lease."""

pytestmark = [
    pytest.mark.skipif(
        not os.environ.get("UAL_TEST_CLIENTS"), reason="other languages take minutes: make test-clients"
    ),
    pytest.mark.slow,
]


@pytest.fixture(scope="module", params=LANGUAGES, ids=lambda language: language.folder)
def language(request: pytest.FixtureRequest) -> Language:
    """A language, built by the commands of its README."""
    language: Language = request.param
    if missing := language.missing():
        pytest.skip(missing)
    for command in language.build:
        environment = {**os.environ, "PATH": search_path()}
        done = subprocess.run(
            command, cwd=language.path, env=environment, capture_output=True, text=True, timeout=BUILD_LIMIT_S
        )
        assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}\n{done.stderr}"
    return language


@pytest.fixture
def uav(start_daemon: StartDaemon) -> DaemonProcess:
    """A light UAV that its simulated safety pilot arms."""
    started = start_daemon("--auto-arm")
    started.wait_for("listening")
    return started


@contextmanager
def mission(language: Language, uav: DaemonProcess, tmp_path: Path, *flags: str) -> Iterator[subprocess.Popen[str]]:
    """Its mission, under way."""
    # A shell lets what it starts in the background ignore SIGINT; the mission would inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with (tmp_path / "stdout").open("w") as stdout, (tmp_path / "stderr").open("w") as stderr:
        process = subprocess.Popen(
            [*language.mission, "--address", uav.address, *flags],
            cwd=language.path,
            stdout=stdout,
            stderr=stderr,
            text=True,
        )
        try:
            yield process
        finally:
            process.kill()
            process.wait()


def telemetry(uav: DaemonProcess) -> ual_pb2.Telemetry:
    answer: ual_pb2.GetTelemetryResponse = ual_pb2_grpc.UalServiceStub(uav.channel()).GetTelemetry(
        ual_pb2.GetTelemetryRequest(), timeout=LIMIT_S
    )
    return answer.telemetry


@pytest.mark.timeout(BUILD_LIMIT_S + MISSION_LIMIT_S + 60.0)
def test_it_flies_the_mission(language: Language, uav: DaemonProcess, tmp_path: Path) -> None:
    with mission(language, uav, tmp_path) as process:
        status = process.wait(MISSION_LIMIT_S)
    said = (tmp_path / "stdout").read_text()
    assert status == 0, f"{said}\n{(tmp_path / 'stderr').read_text()}\n{uav.stderr}"

    states = [event["new"] for event in uav.events if event["event"] == "state"]
    assert states[-5:] == ["LANDED_ARMED", "TAKING_OFF", "FLYING_AUTO", "LANDING", "LANDED_ARMED"]
    ended = [event["task"] for event in uav.events if event["event"] == "task_done"]
    assert ended == ["take_off", "go_to_waypoint", "land"]
    [refused] = [event for event in uav.events if event["event"] == "refused"]
    assert (refused["command"], refused["reason"]) == ("recover_from_manual", "WRONG_STATE")
    assert "recover is refused: WRONG_STATE (state FLYING_AUTO)" in said
    assert "FLYING_AUTO at 4.0 2." in said  # from its telemetry stream
    # 2 s at 0.5 m/s forward, with the nose to the north: the velocities came through its stream of setpoints.
    position = telemetry(uav).pose.position
    assert position.x == pytest.approx(4.0, abs=0.3)
    assert 2.4 < position.y < 3.5


@pytest.mark.timeout(BUILD_LIMIT_S + MISSION_LIMIT_S + 60.0)
def test_it_flies_by_tls_with_a_token_and_a_lease(
    language: Language, start_daemon: StartDaemon, tmp_path: Path
) -> None:
    if language.folder not in SHOW_WHO_CALLS:
        pytest.skip(f"{language.name} shows it on its page only")
    host = beyond_loopback()
    made = make_files(tmp_path / "team", host)
    pair = certificates.files(made.directory, "uav_1")
    tls = ["--tls-certificate", str(pair.certificate), "--tls-key", str(pair.key)]
    uav = start_daemon("--auto-arm", *tls, "--tokens", str(made.directory / "tokens.json"), listen=f"{host}:0")
    uav.wait_for("listening")
    secret = tmp_path / "token"
    secret.write_text(f"{made.tokens['pilot']}\n")
    shown = ("--tls-ca", str(made.authority), "--token-file", str(secret), "--lease")
    with mission(language, uav, tmp_path, *shown) as process:
        status = process.wait(MISSION_LIMIT_S)
    said = (tmp_path / "stdout").read_text()
    assert status == 0, f"{said}\n{(tmp_path / 'stderr').read_text()}\n{uav.stderr}"
    assert "holds the lease" in said
    begins = uav.wait_for("lease_begins")
    assert begins["identity"] == "pilot"
    assert uav.wait_for("lease_ends")["why"] == "released"
    ended = [event["task"] for event in uav.events if event["event"] == "task_done"]
    assert ended == ["take_off", "go_to_waypoint", "land"]
    with mission(language, uav, tmp_path, "--tls-ca", str(made.authority)) as process:
        assert process.wait(MISSION_LIMIT_S) == 1
    assert "UNAUTHENTICATED" in (tmp_path / "stderr").read_text()


@pytest.mark.timeout(BUILD_LIMIT_S + MISSION_LIMIT_S + 60.0)
def test_go_calls_the_extension_of_the_examples(
    language: Language, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    if language.folder != "go":
        pytest.skip("one other language is enough to show that an extension's service is one of gRPC")
    (tmp_path / "arm_extension").mkdir()
    monkeypatch.setenv("PYTHONPATH", search_path_with(install("arm_extension", tmp_path / "arm_extension")))
    start_daemon: StartDaemon = request.getfixturevalue("start_daemon")  # with this environment
    uav = start_daemon("--extension", "arm")
    uav.wait_for("listening")
    done = subprocess.run(
        ["build/payload", "--address", uav.address], cwd=language.path, capture_output=True, text=True, timeout=LIMIT_S
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["arm at 0.50 -1.00 rad"]


@pytest.mark.timeout(BUILD_LIMIT_S + MISSION_LIMIT_S + 60.0)
def test_ctrl_c_leaves_the_uav_holding(language: Language, uav: DaemonProcess, tmp_path: Path) -> None:
    with mission(language, uav, tmp_path) as process:
        going = uav.wait_for("command", command="go_to_waypoint")
        process.send_signal(signal.SIGINT)
        status = process.wait(LIMIT_S)
        said = (tmp_path / "stderr").read_text()
    assert status in (130, -signal.SIGINT), said
    assert "interrupted: the UAV holds its position" in said
    ended = uav.wait_for("task_ended", after=going)
    assert (ended["task"], ended["reason"]) == ("go_to_waypoint", "TASK_ABORTED")
    held = telemetry(uav)
    assert held.state == ual_pb2.STATE_FLYING_AUTO
    assert not held.HasField("task")


@pytest.mark.timeout(BUILD_LIMIT_S + 60.0)
def test_it_says_when_no_daemon_is_there(language: Language) -> None:
    done = subprocess.run(
        [*language.mission, "--address", "127.0.0.1:1"],
        cwd=language.path,
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
    )
    assert done.returncode == 1
    assert "mission: " in done.stderr
