"""A Crazyflie's real firmware in its simulator, which runs already: see docs/reference/backends/crazyflie.md.

The conformance checks through the class and over gRPC, and a daemon that is killed in flight.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import ual
from tests.conftest import DaemonProcess
from tests.waiting import until, until_state
from ual import conformance, discovery
from ual.conformance import Check, Flight
from ual.conformance.flight import CannotRunError
from ual.errors import NotSupportedError
from ual.interface import Uav
from ual.types import State
from ual_daemon import UAL

VARIABLE = "UAL_TEST_CRAZYFLIE_URL"
READY_S = 20.0
HEIGHT_M = 1.0

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]


@pytest.fixture(scope="module")
def url() -> str:
    found = os.environ.get(VARIABLE)
    if not found:
        pytest.skip(f"no Crazyflie: set {VARIABLE}=udp://127.0.0.1:19850")
    return found


def begin_daemon(url: str, directory: Path) -> DaemonProcess:
    flags = ("--backend", "crazyflie", "--url", url, "--listen", "127.0.0.1:0", "--allow-arming")
    return DaemonProcess(flags, "uav_1", {discovery.RUNTIME_DIR_VARIABLE: str(directory)})


def wait_for(uav: Uav, *states: State) -> None:
    until_state(uav, *states, limit_s=READY_S)


# Before the checks, whose daemon would be a second one on the same link.
def test_a_daemon_that_is_killed_in_a_hover_is_followed_by_one_that_lands(url: str, tmp_path: Path) -> None:
    with ExitStack() as stack:
        daemon = begin_daemon(url, tmp_path)
        stack.callback(daemon.close)
        with ual.Uav(address=daemon.address) as uav:
            wait_for(uav, State.LANDED_DISARMED, State.LANDED_ARMED)
            if uav.state() is State.LANDED_DISARMED:
                uav.arm()
            uav.take_off(HEIGHT_M)
            until(lambda: uav.telemetry().flight_mode.startswith("hover"), seen=uav.telemetry, limit_s=READY_S)
        daemon.process.kill()
        again = begin_daemon(url, tmp_path)
        stack.callback(again.close)
        with ual.Uav(address=again.address) as uav:
            wait_for(uav, State.FLYING_AUTO)
            assert abs(uav.telemetry().pose.position.z - HEIGHT_M) < 0.3  # type: ignore[union-attr]
            uav.land()


@pytest.fixture(scope="module", params=["class", "grpc"])
def flight(request: pytest.FixtureRequest, url: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flight]:
    with ExitStack() as stack:
        if request.param == "class":
            uav: Uav = stack.enter_context(UAL("crazyflie", "uav_1", url=url, allow_arming=True))
        else:
            daemon = begin_daemon(url, tmp_path_factory.mktemp("ual"))
            stack.callback(daemon.close)
            uav = stack.enter_context(ual.Uav(address=daemon.address))
        wait_for(uav, State.LANDED_DISARMED, State.LANDED_ARMED, State.FLYING_AUTO)
        yield Flight(uav)


@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.name)
def test_conformance(flight: Flight, check: Check) -> None:
    try:
        conformance.run_check(flight, check)
    except (CannotRunError, NotSupportedError) as error:
        pytest.skip(str(error))
