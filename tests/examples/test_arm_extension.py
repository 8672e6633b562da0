"""The example of an extension, as installed: an arm that a package adds to the daemon."""

from __future__ import annotations

import contextlib
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import grpc
import pytest
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha import reflection_pb2, reflection_pb2_grpc

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.examples.installing import THREADS_LEFT, install, run, search_path
from tests.waiting import until

IN_PROCESS = """
import threading
from ual import LeaseHeldError, UalError, Vector3
from ual_daemon import UAL

with UAL("light", extensions={"arm": {"speed_rad_s": 50.0}}) as uav:
    arm = uav.extension("arm")
    print(arm.joints())
    print(arm.move(0.5, -1.0))
    try:
        arm.move(3.0, 0.0)
    except UalError as error:
        print(error.reason, error)
    try:
        uav.extension("gimbal")
    except UalError as error:
        print(error.reason, error)
    other = UAL.over(uav.vehicle, {})
    with other.lease("survey"):
        try:
            arm.move(0.0, 0.0)
        except LeaseHeldError as error:
            print(error.reason, error.metadata["holder"])
    with uav.lease():
        print(arm.move(0.5, -1.0))
    other.release()
    there = threading.Event()
    with uav.subscribe(lambda _: there.set() if "uav_1/arm/tool" in {f.frame_id for f in uav.frames()} else None):
        assert there.wait(30.0)
"""

REMOTE = """
import sys, threading
import ual

with ual.Uav(address=sys.argv[1]) as uav:
    arm = uav.extension("arm")
    print(arm.move(0.5, -1.0))
    print(next(arm.watch(50.0)))
    for angles in ((9.0, 0.0), (float("nan"), 0.0)):
        try:
            arm.move(*angles)
        except ual.UalError as error:
            print(error.reason, error.metadata["field"])
    ended = []
    def long():
        try:
            arm.move(1.5, 1.5)
        except ual.UalError as error:
            ended.append(error.reason)
    slow = threading.Thread(target=long)
    slow.start()
    while not arm.joints().is_moving:
        pass
    arm.move(0.5, -1.0)
    slow.join()
    print(ended)
    with ual.Uav(address=sys.argv[1]) as other, other.lease("survey"):
        try:
            arm.move(0.0, 0.0)
        except ual.LeaseHeldError as error:
            print(error.reason, error.metadata["holder"])
        print(other.extension("arm").move(0.1, 0.2))
    try:
        uav.extension("gimbal")
    except ual.NotSupportedError as error:
        print(error)
"""

ASYNC = """
import asyncio, sys
import ual

async def main():
    async with ual.aio.Uav(address=sys.argv[1]) as uav:
        arm = uav.extension("arm")
        print(await arm.move(0.5, -1.0))
        async for joints in arm.watch(50.0):
            print(joints)
            break
        try:
            await arm.move(9.0, 0.0)
        except ual.InvalidArgumentError as error:
            print(error.metadata["field"])

asyncio.run(main())
"""

REACHED = "Joints(shoulder_rad=0.5, elbow_rad=-1.0, is_moving=False)"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder in which the package is installed."""
    return install("arm_extension", tmp_path_factory.mktemp("arm"))


@pytest.fixture
def start(installed: Path, monkeypatch: pytest.MonkeyPatch, start_daemon: StartDaemon) -> StartDaemon:
    monkeypatch.setenv("PYTHONPATH", search_path(installed))
    return start_daemon


@pytest.fixture
def daemon(installed: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> DaemonProcess:
    monkeypatch.setenv("PYTHONPATH", search_path(installed))  # before the environment of daemons is made
    start_daemon: Callable[..., DaemonProcess] = request.getfixturevalue("start_daemon")
    started = start_daemon("--extension", "arm", "--set", "extensions.arm.speed_rad_s=5")
    started.wait_for("listening")
    return started


def test_in_the_process(installed: Path) -> None:
    first, moved, refused, not_loaded, held, moved_by_lease, threads = run(IN_PROCESS + THREADS_LEFT, installed)
    assert first == "Joints(shoulder_rad=0.0, elbow_rad=0.0, is_moving=False)"
    assert moved == REACHED
    assert refused.startswith("INVALID_ARGUMENT shoulder_rad: 3 is not within 1.5708 rad")
    assert not_loaded == "NOT_SUPPORTED the extension gimbal is not loaded (loaded are: arm)"
    assert held == "LEASE_HELD survey"
    assert moved_by_lease == REACHED
    assert threads == "['MainThread']"


def test_through_the_daemon(installed: Path, daemon: DaemonProcess) -> None:
    assert run(REMOTE, installed, daemon.address) == [
        REACHED,
        REACHED,
        "INVALID_ARGUMENT shoulder_rad",
        "INVALID_ARGUMENT shoulder_rad",
        "['TASK_ABORTED']",
        "LEASE_HELD survey",
        "Joints(shoulder_rad=0.1, elbow_rad=0.2, is_moving=False)",
        "no package with a client of the extension gimbal is installed (installed are: arm)",
    ]


def test_for_asyncio(installed: Path, daemon: DaemonProcess) -> None:
    assert run(ASYNC, installed, daemon.address) == [REACHED, REACHED, "shoulder_rad"]


def test_its_frames_are_in_the_tree_and_go_with_the_joints(installed: Path, daemon: DaemonProcess) -> None:
    run("import sys, ual; ual.Uav(address=sys.argv[1]).extension('arm').move(1.5, 0.0)", installed, daemon.address)
    with ual.Uav(address=daemon.address) as uav:

        def tool() -> ual.Vector3 | None:
            with contextlib.suppress(ual.UalError):
                return uav.transform("uav_1/base_link", "uav_1/arm/tool").translation
            return None

        def is_down() -> bool:
            here = tool()
            return here is not None and abs(here.z - (-0.1 - 0.55 * math.sin(1.5))) < 1e-6

        until(is_down, "the tool 0.55 m below the shoulder, nearly", seen=tool)
        here = tool()
        assert here is not None
        assert here.x == pytest.approx(0.1 + 0.55 * math.cos(1.5))


def test_it_is_in_reflection_and_health(daemon: DaemonProcess) -> None:
    stub = reflection_pb2_grpc.ServerReflectionStub(daemon.channel())
    request = reflection_pb2.ServerReflectionRequest(list_services="")
    [answer] = stub.ServerReflectionInfo(iter([request]), timeout=LIMIT_S)  # type: ignore[operator]
    assert "ual_arm.v1.ArmService" in [service.name for service in answer.list_services_response.service]
    file = reflection_pb2.ServerReflectionRequest(file_containing_symbol="ual_arm.v1.ArmService")
    [described] = stub.ServerReflectionInfo(iter([file]), timeout=LIMIT_S)  # type: ignore[operator]
    assert described.file_descriptor_response.file_descriptor_proto
    health: Any = health_pb2_grpc.HealthStub(daemon.channel())
    for event in health.Watch(health_pb2.HealthCheckRequest(service="ual_arm.v1.ArmService"), timeout=LIMIT_S):
        if event.status == health_pb2.HealthCheckResponse.SERVING:
            break


@pytest.mark.parametrize(
    ("flags", "why"),
    [
        (["--extension", "gripper"], "extensions.gripper: there is no extension of this name; installed are: arm"),
        (["--set", "extensions.arm.speed=1"], "extensions.arm.speed: there is no such setting"),
        (["--set", "extensions.arm=fast"], "expected the settings of the extension, got 'fast'"),
        (["--set", "extensions=arm"], "expected a section for each extension, got 'arm'"),
    ],
)
def test_what_is_wrong_in_the_configuration_is_reported(installed: Path, flags: list[str], why: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "ual_daemon", "--print-config", *flags],
        env={"PATH": "/usr/bin:/bin", "PYTHONPATH": search_path(installed)},
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
    )
    assert done.returncode == 2
    assert why in done.stderr


def test_without_it_the_daemon_does_not_have_its_service(start: StartDaemon) -> None:
    started = start()
    call: grpc.UnaryUnaryMultiCallable[bytes, bytes] = started.channel().unary_unary("/ual_arm.v1.ArmService/GetJoints")
    with pytest.raises(grpc.RpcError) as caught:
        call(b"", timeout=LIMIT_S)
    assert caught.value.code() is grpc.StatusCode.UNIMPLEMENTED
