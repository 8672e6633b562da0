"""The conformance checks over the class in the process, and over the client to a real daemon on each transport."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import ual
from tests.conftest import DaemonProcess, daemon_environment
from tests.patient_checks import run_check
from tests.ual_daemon.stepped import SteppedWorld
from ual import conformance
from ual.conformance import Check, Flight, Tolerances
from ual.conformance.flight import CannotRunError
from ual.interface import Uav
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend

# Fast, but so that a busy computer does not lose what the checks look for.
SPEED_FACTOR = 3.0


def over_class(stack: ExitStack, directory: Path) -> Uav:
    assert directory.is_dir()
    return stack.enter_context(UAL(LightBackend(BackendOptions("uav_1"), SteppedWorld(SPEED_FACTOR))))


def over_tcp(stack: ExitStack, directory: Path) -> Uav:
    return stack.enter_context(ual.Uav("uav_1", address=started(stack, directory, "127.0.0.1:0", "core")))


def over_tcp_by_grpc_aio(stack: ExitStack, directory: Path) -> Uav:
    return stack.enter_context(ual.Uav("uav_1", address=started(stack, directory, "127.0.0.1:0", "aio")))


def over_unix_socket(stack: ExitStack, directory: Path) -> Uav:
    return stack.enter_context(ual.Uav(address=started(stack, directory, f"unix:{directory}/uav.sock", "core")))


def started(stack: ExitStack, directory: Path, listen: str, transport: str) -> str:
    speed = f"light.speed_factor={SPEED_FACTOR}"
    flags = ("--backend", "light", "--listen", listen, "--transport", transport, "--set", speed)
    daemon = DaemonProcess(flags, "uav_1", daemon_environment(directory))
    stack.callback(daemon.close)
    return daemon.address


WAYS = [
    # All checks of a way run on one worker: one daemon, and one flight from check to check.
    pytest.param(way, id=way.__name__, marks=pytest.mark.xdist_group(f"conformance {way.__name__}"))
    for way in (over_class, over_tcp, over_tcp_by_grpc_aio)
]


@pytest.fixture(scope="module", params=WAYS)
def flight(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flight]:
    with ExitStack() as stack:
        uav: Uav = request.param(stack, tmp_path_factory.mktemp("ual"))
        yield Flight(uav, Tolerances.of_simulation())


@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.name)
def test_conformance(flight: Flight, check: Check) -> None:
    try:
        run_check(flight, check)
    except CannotRunError as error:
        pytest.skip(str(error))


def test_what_differs_over_a_unix_socket(tmp_path: Path) -> None:
    """Calls of each kind: behind the socket all is as over TCP."""
    names = "says_who_it_is telemetry_flows bad_frames_are_refused takes_off holds_a_pose_reference lands"
    with ExitStack() as stack:
        flight = Flight(over_unix_socket(stack, tmp_path), Tolerances.of_simulation())
        for name in names.split():
            run_check(flight, next(check for check in conformance.CHECKS if check.name == name))
