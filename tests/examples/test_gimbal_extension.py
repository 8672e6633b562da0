"""The example of a gimbal, as installed: simulated on light, and by MAVLink to a scripted autopilot."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.conftest import LIMIT_S, DaemonProcess
from tests.examples.installing import EXAMPLES, THREADS_LEFT, install, run, search_path
from tests.ports import free_port
from tests.ual_daemon.backends.mavlink.fakes import ack, heartbeat
from tests.ual_daemon.backends.mavlink.test_backend import Autopilot, Pair, opened
from tests.waiting import until
from ual.errors import RejectedByAutopilotError, WrongStateError
from ual_daemon.backends.mavlink.wire.messages import mavlink

IN_PROCESS = """
import math, threading
import ual
from ual_daemon import UAL

with UAL("light", extensions={"gimbal": {"speed_rad_s": 1000.0}}, backend_settings={"speed_factor": 10}) as uav:
    gimbal = uav.extension("gimbal")
    gimbal.point(-0.5, 0.3)
    print(next(seen for seen in gimbal.watch(50.0) if (seen.pitch_rad, seen.yaw_rad) == (-0.5, 0.3)))
    for angles in ((-2.0, 0.0), (0.0, 4.0), (math.nan, 0.0)):
        try:
            gimbal.point(*angles)
        except ual.UalError as error:
            print(error.reason, error.metadata["field"])
    uav.wait_for(ual.State.LANDED_DISARMED)
    uav.arm()
    uav.take_off(4.0)
    uav.go_to_waypoint(ual.Pose.at(0.0, 0.0, 4.0, yaw_rad=math.pi / 2))
    try:
        gimbal.point_at(ual.PointStamped(ual.Vector3(0.0, 0.0, 0.0), "nowhere"))
    except ual.UalError as error:
        print(error.reason)
    target = ual.Vector3(4.0, 0.0, 0.0)  # to the east: right of the nose, below
    gimbal.point_at(ual.PointStamped(target))

    def sees():
        seen, pose = gimbal.attitude(), uav.pose().pose
        way = target - pose.position
        pitch = math.atan2(way.z, way.horizontal_norm())
        yaw = math.remainder(math.atan2(way.y, way.x) - pose.yaw_rad, 2 * math.pi)
        return abs(seen.pitch_rad - pitch) < 0.1 and abs(math.remainder(seen.yaw_rad - yaw, 2 * math.pi)) < 0.1

    def comes_to_see():
        for _ in range(600):
            if sees():
                return True
            threading.Event().wait(0.05)
        return False

    print(comes_to_see(), gimbal.attitude().yaw_rad < -1.0)
    uav.go_to_waypoint(ual.Pose.at(4.0, 6.0, 4.0, yaw_rad=0.0))
    print(comes_to_see())
    uav.land()
"""

REMOTE = """
import sys
import ual

with ual.Uav(address=sys.argv[1]) as uav:
    gimbal = uav.extension("gimbal")
    gimbal.point(-0.5, 0.3)
    print(next(seen for seen in gimbal.watch(50.0) if (seen.pitch_rad, seen.yaw_rad) == (-0.5, 0.3)))
    try:
        gimbal.point_at(ual.PointStamped(ual.Vector3(0.0, 0.0, 0.0), "nowhere"))
    except ual.UnknownFrameError as error:
        print(error.reason)
    gimbal.point_at(ual.PointStamped(ual.Vector3(5.0, 5.0, -5.0)))
    while gimbal.attitude().yaw_rad < 0.7:
        pass
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the package is installed."""
    return install("gimbal_extension", tmp_path_factory.mktemp("gimbal"))


def test_in_the_process(installed: Path) -> None:
    assert run(IN_PROCESS + THREADS_LEFT, installed, limit_s=2 * LIMIT_S) == [
        "Attitude(pitch_rad=-0.5, yaw_rad=0.3)",
        "INVALID_ARGUMENT pitch_rad",
        "INVALID_ARGUMENT yaw_rad",
        "INVALID_ARGUMENT pitch_rad",
        "UNKNOWN_FRAME",
        "True True",
        "True",
        "['MainThread']",
    ]


def test_through_the_daemon(installed: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    monkeypatch.setenv("PYTHONPATH", search_path(installed))  # before the environment of daemons is made
    start_daemon: Callable[..., DaemonProcess] = request.getfixturevalue("start_daemon")
    daemon = start_daemon("--extension", "gimbal", "--set", "extensions.gimbal.speed_rad_s=1000")
    daemon.wait_for("state", new="LANDED_DISARMED")
    assert run(REMOTE, installed, daemon.address) == ["Attitude(pitch_rad=-0.5, yaw_rad=0.3)", "UNKNOWN_FRAME"]


@pytest.fixture
def pair() -> Iterator[Pair]:
    """A mavlink backend and a scripted autopilot that have met."""
    port = free_port()
    with contextlib.closing(Autopilot(port)) as autopilot, opened(f"udpin://127.0.0.1:{port}") as backend:

        def meets() -> bool:
            autopilot.say(heartbeat())
            return backend.info().autopilot == "PX4"

        until(meets, "the autopilot")
        yield backend, autopilot


def status(flags: int, q: tuple[float, float, float, float]) -> mavlink.MAVLink_message:
    nan = math.nan
    return mavlink.MAVLink_gimbal_device_attitude_status_message(0, 0, 0, flags, q, nan, nan, nan, 0)


def test_by_mavlink(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES / "gimbal_extension"))
    from ual_gimbal.device import MavlinkDevice
    from ual_gimbal.interface import Attitude

    backend, autopilot = pair
    device = MavlinkDevice(backend.payload(), lambda: math.pi / 4.0)  # the nose to the north-east
    device.start()
    autopilot.hear("COMMAND_LONG", command=mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, param1=285)
    with pytest.raises(WrongStateError):
        device.attitude()

    sent = device.point(Attitude(-0.5, 0.25))
    control = autopilot.hear("COMMAND_LONG", command=mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE)
    assert control.param1 == -2.0
    heard = autopilot.hear("COMMAND_LONG", command=mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW)
    assert (heard.param1, heard.param2) == (pytest.approx(math.degrees(-0.5)), pytest.approx(math.degrees(-0.25)))
    assert math.isnan(heard.param3)
    assert heard.param5 == 12.0
    autopilot.say(ack(heard.command, mavlink.MAV_RESULT_ACCEPTED))
    sent.result(LIMIT_S)

    sent = device.point(Attitude(0.0, 0.0))
    autopilot.hear("COMMAND_LONG", command=mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, param1=0.0)
    autopilot.say(ack(heard.command, mavlink.MAV_RESULT_DENIED))
    with pytest.raises(RejectedByAutopilotError):
        sent.result(LIMIT_S)

    half = math.radians(-30.0) / 2.0
    autopilot.say(status(12, (math.cos(half), 0.0, math.sin(half), 0.0)))  # 30 degrees down, ahead
    until(lambda: said(device) is not None, "the attitude")
    assert said(device) == pytest.approx((math.radians(-30.0), 0.0))
    half = math.radians(20.0) / 2.0
    autopilot.say(status(12, (math.cos(half), 0.0, 0.0, math.sin(half))))  # to the right of the nose
    until(lambda: is_near(device, 0.0, -20.0), "the yaw")
    autopilot.say(status(12 | 16, (math.cos(half), 0.0, 0.0, math.sin(half))))  # the same from north: left of the nose
    until(lambda: is_near(device, 0.0, 25.0), "the yaw")
    device.close()
    assert "ual_gimbal.device" in sys.modules


def is_near(device: object, pitch_deg: float, yaw_deg: float) -> bool:
    found = said(device)
    return found is not None and found == pytest.approx((math.radians(pitch_deg), math.radians(yaw_deg)))


def said(device: object) -> tuple[float, float] | None:
    try:
        attitude = device.attitude()  # type: ignore[attr-defined]
    except WrongStateError:
        return None
    return attitude.pitch_rad, attitude.yaw_rad
