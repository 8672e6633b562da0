"""The conformance checks as tests, which a busy computer must not fail: what was not seen is looked at again."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from contextlib import ExitStack
from pathlib import Path

import pytest
from _pytest.mark import ParameterSet

import ual
from tests.conftest import LIMIT_S, DaemonProcess
from ual import conformance, discovery
from ual.conformance import Check, CheckFailedError, Flight
from ual.conformance.flight import CannotRunError
from ual.conformance.runner import LONGEST_GAP_S
from ual.interface import Uav

_ATTEMPTS = 5


def run_check(flight: Flight, check: Check) -> None:
    """Runs a check; runs it again if it failed while this computer was too busy to receive what the vehicle sent.

    The daemon may have been too busy, too: it then says that it hears nothing.
    """
    for _ in range(_ATTEMPTS - 1):
        try:
            return conformance.run_check(flight, check)
        except (CheckFailedError, ual.WrongStateError, ual.LinkLostError) as error:
            # A command that came too late is refused in its new state.
            if not (flight.longest_silence_s > LONGEST_GAP_S or _is_silence(error)):
                raise
    return conformance.run_check(flight, check)


def run_check_or_skip(
    flight: Flight, check: Check, not_here: Collection[str], on_refused: Callable[[], None] = lambda: None
) -> None:
    """Runs a check as `run_check`; it may be skipped only where its name is among those that cannot run here.

    `on_refused` makes the next check possible where this one was refused in the middle.
    """
    try:
        run_check(flight, check)
    except CannotRunError:
        assert check.name in not_here
        pytest.skip("not here: see NOT_HERE")
    except ual.NotSupportedError:
        assert check.name in not_here
        on_refused()
        pytest.skip("not here: see NOT_HERE")


def grouped(value: object, name: str, group: str = "") -> ParameterSet:
    """A parameter whose tests all run on one worker: one daemon, and one flight from check to check."""
    return pytest.param(value, id=name, marks=pytest.mark.xdist_group(group or name))


def served(stack: ExitStack, directory: Path, backend: str, *flags: str) -> Uav:
    """A UAV of a daemon that has the backends of `tests.simulators.daemon`, over gRPC."""
    environment = {discovery.RUNTIME_DIR_VARIABLE: str(directory), "XDG_CACHE_HOME": str(directory)}
    flags = ("--backend", backend, "--listen", "127.0.0.1:0", *flags)
    daemon = DaemonProcess(flags, "uav_1", environment, module="tests.simulators.daemon")
    stack.callback(daemon.close)
    return stack.enter_context(ual.Uav(address=daemon.address))


def wait_until_ready(uav: Uav, is_known: Callable[[Uav], bool] = lambda _: True) -> None:
    """Waits until the UAV is ready, and what the checks need is known of it."""
    deadline_s = time.monotonic() + LIMIT_S
    while not uav.is_ready() or not is_known(uav):
        assert time.monotonic() < deadline_s, uav.telemetry()
        time.sleep(0.02)


def _is_silence(error: BaseException) -> bool:
    return isinstance(error, ual.LinkLostError) or isinstance(error.__cause__, ual.LinkLostError)
