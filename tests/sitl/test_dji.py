"""The simulated DJI aircraft in real time: dji_osdk_ros behind a real rosbridge, psdk_ros2 behind that of the tests.

UAL_TEST_DJI_URL says where the real rosbridge is, whose ROS must have the messages of dji_osdk_ros. See
docs/reference/backends/dji.md.
"""

from __future__ import annotations

import os
import random
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple, cast
from urllib.parse import urlsplit

import pytest

import ual
from tests.conftest import LIMIT_S, DaemonProcess, daemon_environment
from tests.patient_checks import wait_until_ready, without
from tests.simulators.dji import Aircraft, Front, OsdkSdkNode, OsdkVehicleNode, Psdk
from tests.simulators.lockstep_dji import DjiPilot
from tests.simulators.rosbridge import Bridge
from tests.simulators.rosbridge_node import served
from tests.simulators.rosbridge_server import RosbridgeServer
from tests.waiting import until_state
from ual import conformance
from ual.conformance import Check, Flight, Tolerances
from ual.conformance.flight import CannotRunError
from ual.errors import NotSupportedError, TaskAbortedError
from ual.geometry import Pose
from ual.interface import Uav
from ual.types import State
from ual_daemon import UAL
from ual_daemon.settings import LimitSettings, VehicleSettings

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]
FRONTS = (Psdk, OsdkSdkNode, OsdkVehicleNode)
TIMES = 34
"""For each of the three, so 102 in all."""
TOLD_S = 0.2
LIMIT_M_S = 2.5
"""Slow enough that the checks fly it to its limit."""
NOT_HERE = {
    "arming_belongs_to_the_pilot",
    "the_pilot_flies_and_gives_back",
    "bad_poses_from_outside_are_refused",
    "goes_to_a_geographic_waypoint",
    *without(),
}
"""Checks that may be skipped: it may arm, authority is obtained and never given, and dji_osdk_ros does not know the
geoid.
"""


class Served(NamedTuple):
    """An aircraft, the lock that is held while it is stepped, and its bridge's URL."""

    aircraft: Aircraft
    lock: threading.RLock
    url: str


class WithPilot:
    """A UAV and the aircraft's pilot; a `ual.interface.Uav`."""

    def __init__(self, uav: Uav, served: Served) -> None:
        self._uav = uav
        self.simulation = DjiPilot(served.aircraft, served.lock)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._uav, name)


@pytest.fixture(scope="module", params=FRONTS, ids=lambda front: front.__name__)
def aircraft(request: pytest.FixtureRequest) -> Iterator[Served]:
    url = os.environ.get("UAL_TEST_DJI_URL")
    if not url:
        pytest.skip("no rosbridge: set UAL_TEST_DJI_URL=rosbridge://127.0.0.1:9090")
    aircraft = Aircraft()
    front: Front = request.param(aircraft)
    if isinstance(front, Psdk):
        with RosbridgeServer(Bridge(2, [front])) as server:
            yield Served(aircraft, server.lock, server.url)
    else:
        port = urlsplit(url).port
        assert port is not None
        with served(port, front) as node:
            yield Served(aircraft, node.lock, url)


def over_class(stack: ExitStack, url: str, _: Path) -> Uav:
    settings = VehicleSettings(limits=LimitSettings(horizontal_speed_m_s=LIMIT_M_S))
    return stack.enter_context(UAL("dji", "uav_1", url=url, settings=settings, allow_arming=True))


def over_grpc(stack: ExitStack, url: str, directory: Path) -> Uav:
    limit = ("--set", f"limits.horizontal_speed_m_s={LIMIT_M_S}")
    flags = ("--backend", "dji", "--url", url, "--listen", "127.0.0.1:0", "--allow-arming", *limit)
    daemon = DaemonProcess(flags, "uav_1", daemon_environment(directory))
    stack.callback(daemon.close)
    return stack.enter_context(ual.Uav(address=daemon.address))


@pytest.fixture(scope="module", params=[over_class, over_grpc], ids=lambda way: str(way.__name__))
def flight(
    request: pytest.FixtureRequest, aircraft: Served, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Flight]:
    connect: Callable[[ExitStack, str, Path], Uav] = request.param
    with ExitStack() as stack:
        uav = connect(stack, aircraft.url, tmp_path_factory.mktemp("ual"))
        wait_until_ready(uav)
        flight = Flight(cast("Uav", WithPilot(uav, aircraft)), Tolerances())
        yield flight
        with flight.observing():
            flight.bring_to([State.LANDED_DISARMED])


@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.name)
def test_conformance(flight: Flight, check: Check) -> None:
    try:
        conformance.run_check(flight, check)
    except (CannotRunError, NotSupportedError) as error:
        assert check.name in NOT_HERE
        pytest.skip(str(error))


def test_the_pilot_takes_over_at_random_moments_and_nothing_is_sent_after(aircraft: Served) -> None:
    noise = random.Random(7)
    with UAL("dji", "uav_1", url=aircraft.url, allow_arming=True) as uav:
        wait_until_ready(uav)
        uav.arm()
        uav.take_off(3.0)
        for _ in range(TIMES):
            goal = Pose.at(noise.uniform(-20.0, 20.0), noise.uniform(-20.0, 20.0), noise.uniform(3.0, 8.0))
            task = uav.go_to_waypoint(goal, blocking=False)
            time.sleep(noise.uniform(0.05, 1.0))
            with aircraft.lock:
                aircraft.aircraft.pilot_takes_over()
                taken_s = aircraft.aircraft.now_s
            assert wait_for(uav, State.FLYING_MANUAL) <= TOLD_S
            with pytest.raises(TaskAbortedError, match="safety pilot"):
                task.wait(LIMIT_S)
            time.sleep(0.5)
            with aircraft.lock:
                assert [time_s for time_s, _, _ in aircraft.aircraft.setpoints if time_s > taken_s + TOLD_S] == []
            uav.recover_from_manual()
        uav.land()


def wait_for(uav: Uav, state: State) -> float:
    """Waits for a state. Returns how long it took, in s."""
    begun_s = time.monotonic()
    until_state(uav, state, limit_s=LIMIT_S)
    return time.monotonic() - begun_s
