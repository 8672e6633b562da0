"""A real ArduCopter in simulation that boots elsewhere, and a daemon that is killed: the frames stay where they are.

The test starts the simulator itself, at several places: `START_VARIABLE` is the command, with ``{home}`` where
ArduPilot takes the place. It must serve the ports of `UAL_TEST_ARDUPILOT_URL` and `UAL_TEST_ARDUPILOT_PILOT`.
"""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.sitl.flights import Flight
from tests.sitl.simulators import ARDUPILOT
from ual.geometry import Pose, PoseStamped, Vector3
from ual.types import State
from ual_daemon.geodesy import FlatProjection

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]

START_VARIABLE = "UAL_TEST_ARDUPILOT_START"
BOOT_S = 150.0
"""It takes 40 s until it has its position, and longer on a busy computer."""
PLACE = FlatProjection(47.397742, 8.545594, 489.4)
NEAR_M = 0.7

Boot = Callable[[float], None]


@pytest.fixture
def boot(tmp_path: Path) -> Iterator[Boot]:
    """Boots it so many metres east of the first place; swaps its battery if it runs."""
    command = os.environ.get(START_VARIABLE)
    if not command:
        pytest.skip(f"set {START_VARIABLE}='arducopter --model + --serial0 tcp:0 --home {{home}} ...'")
    running: list[subprocess.Popen[bytes]] = []

    def end() -> None:
        for process in running:
            process.terminate()
            process.wait()
        running.clear()

    def begin(east_m: float) -> None:
        end()
        point = PLACE.to_geo(Vector3(east_m, 0.0, 0.0))
        home = f"{point.latitude_deg:.7f},{point.longitude_deg:.7f},{point.altitude_amsl_m:.2f},0"
        arguments = [part.replace("{home}", home) for part in shlex.split(command)]
        running.append(subprocess.Popen(arguments, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))

    yield begin
    end()


@contextmanager
def executed(uav: ual.Uav) -> Iterator[Flight]:
    """A flight with its safety pilot: take-off, what is in the block, landing."""
    parts = urlsplit(ARDUPILOT.pilot_url())
    assert parts.hostname is not None
    assert parts.port is not None
    pilot = ARDUPILOT.make_pilot(parts.hostname, parts.port)
    try:
        pilot.begin()
        flight = Flight(uav, pilot)
        flight.take_off()
        yield flight
        uav.land()
        flight.wait_for_state(State.LANDED_DISARMED)
    finally:
        pilot.close()


def current_position(uav: ual.Uav) -> Vector3:
    """Returns the autopilot's own position on Earth, from the first one: east, north, up."""
    point = uav.telemetry().position_geo
    assert point is not None
    assert point.altitude_amsl_m is not None
    return PLACE.to_local(point.latitude_deg, point.longitude_deg, point.altitude_amsl_m)


def wait_until_placed(uav: ual.Uav, after_boot: bool = True) -> Vector3:
    """Waits until the UAV is ready and its pose known; returns the pose's position."""
    flight = Flight(uav, None)  # type: ignore[arg-type]
    if after_boot:
        flight.wait_for(lambda: uav.telemetry().pose is None, "the loss of its pose", BOOT_S)
    flight.wait_for(lambda: uav.state() is State.LANDED_DISARMED, "LANDED_DISARMED", BOOT_S)
    flight.wait_for(lambda: uav.telemetry().pose is not None, "its pose", BOOT_S)
    return uav.pose().pose.position


def near(x: float, y: float, z: float) -> object:
    return pytest.approx((x, y, z), abs=NEAR_M)


def test_home_and_map_stay_where_they_are_on_earth(boot: Boot, start_daemon: StartDaemon, tmp_path: Path) -> None:
    config = tmp_path / "uav.yaml"
    config.write_text(
        f"map_origin_geo: [{PLACE.latitude_deg}, {PLACE.longitude_deg}, {PLACE.altitude_amsl_m}]\n"
        "geofence: {frame_id: map, polygon: [[-8, -15], [15, -15], [15, 15], [-8, 15]]}\n"
    )

    def start() -> DaemonProcess:
        return start_daemon("--url", ARDUPILOT.url(), "--config", str(config), backend="mavlink")

    boot(0.0)
    daemon = start()
    with ual.Uav(address=daemon.address) as uav:
        wait_until_placed(uav, after_boot=False)
        with executed(uav):
            uav.go_to_waypoint(Pose.at(10.0, 0.0, 3.0))
        uav.set_home()
        print("home 10 m from the local origin:", tuple(uav.pose().pose.position), tuple(current_position(uav)))

        boot(10.0)  # the battery is swapped on the spot
        here = wait_until_placed(uav)
        print("after a boot on the spot:", tuple(here), tuple(current_position(uav)))
        assert tuple(here) == near(0, 0, here.z)
        with executed(uav):
            uav.go_to_waypoint(Pose.at(0.0, 0.0, 5.0))
            print("go-to 0 0 5:", tuple(uav.pose().pose.position), tuple(current_position(uav)))
            assert tuple(current_position(uav)) == near(10, 0, 5)

    daemon.signal(signal.SIGKILL)
    daemon.wait()
    daemon = start()
    with ual.Uav(address=daemon.address) as uav:
        here = wait_until_placed(uav, after_boot=False)
        print("after a restart of the daemon:", tuple(here), daemon.wait_for("home_restored"))
        assert tuple(here) == near(0, 0, here.z)
        with executed(uav):
            uav.go_to_waypoint(PoseStamped(Pose.at(2.0, 0.0, 4.0), "map"))
            print("go-to 2 0 4 in map:", tuple(current_position(uav)))
            assert tuple(current_position(uav)) == near(2, 0, 4)
            uav.go_to_waypoint(Pose.at(0.0, 0.0, 4.0))
            assert tuple(current_position(uav)) == near(10, 0, 4)

        boot(30.0)  # outside the fence
        here = wait_until_placed(uav)
        print("after a boot 20 m further east:", tuple(here), tuple(current_position(uav)))
        assert tuple(here) == near(20, 0, here.z)
        assert uav.transform("map").translation.x == pytest.approx(30.0, abs=NEAR_M)
        with pytest.raises(ual.GeofenceError), executed(uav):
            pass
