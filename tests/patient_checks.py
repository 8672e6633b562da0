"""The conformance checks as tests, which a busy computer must not fail: what was not seen is looked at again."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Collection

import pytest
from _pytest.mark import ParameterSet

import ual
from tests.waiting import until
from ual import conformance
from ual.conformance import Check, CheckFailedError, Flight
from ual.conformance.flight import CannotRunError
from ual.conformance.runner import LONGEST_TELEMETRY_GAP_S
from ual.interface import Uav

_ATTEMPTS = 5
_OF_SILENCE = (
    CheckFailedError,
    ual.WrongStateError,
    ual.LinkLostError,
    ual.TaskAbortedError,
    ual.RejectedByAutopilotError,
)


def _of_services() -> dict[str, set[str]]:
    """Returns the names of the checks of each service beside flying."""
    rooms = {each.name for each in pkgutil.iter_modules(conformance.__path__) if each.name.startswith("own_")}
    found = {each.removeprefix("own_"): importlib.import_module(f"ual.conformance.{each}") for each in rooms}
    return {
        service: {check.name for checks in ("ON_GROUND", "IN_FLIGHT") for check in getattr(room, checks, ())}
        for service, room in found.items()
    }


_OF_SERVICES = _of_services()


def without(*offered: str) -> set[str]:
    """Returns the names of the checks that cannot run where no other services than these are offered."""
    assert set(offered) <= set(_OF_SERVICES)
    return {name for service, names in _OF_SERVICES.items() if service not in offered for name in names}


def run_check(flight: Flight, check: Check) -> None:
    """Runs a check; runs it again if it failed while this computer was too busy to receive what the vehicle sent.

    The daemon may have been too busy, too: it then says that it hears nothing.
    """
    for _ in range(_ATTEMPTS - 1):
        try:
            return conformance.run_check(flight, check)
        except _OF_SILENCE as error:
            # A command that came too late is refused in its new state, and what flew is given up.
            if not (flight.longest_silence_s > LONGEST_TELEMETRY_GAP_S or _is_silence(error)):
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


def wait_until_ready(uav: Uav, is_known: Callable[[Uav], bool] = lambda _: True) -> None:
    """Waits until the UAV is ready, and what the checks need is known of it."""
    until(lambda: uav.is_ready() and is_known(uav), seen=uav.telemetry)


def _is_silence(error: BaseException) -> bool:
    return isinstance(error, ual.LinkLostError) or isinstance(error.__cause__, ual.LinkLostError)
