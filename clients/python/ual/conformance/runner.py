"""Runs checks one after another."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator

from ual.conformance.check import Check, Need, Outcome, Result
from ual.conformance.flight import CannotRunError, CheckFailedError, Flight, RunEndedError
from ual.errors import UalError
from ual.types import State

LONGEST_TELEMETRY_GAP_S = 0.5
"""Samples come 50 times a second. With a longer gap, a check judges what it did not see."""


def why_not(flight: Flight, check: Check, may_move: bool = True) -> str:
    """Returns why a check cannot run with this UAV; empty if it can."""
    has = {
        Need.MOTION: may_move,
        Need.PILOT: flight.has_pilot,
        Need.ARMING: flight.info.is_arming_allowed,
        Need.NO_ARMING: not flight.info.is_arming_allowed,
    }
    for need in sorted(check.needs, key=lambda each: each.name):
        if not has[need]:
            return f"needs {need.value}"
    missing = check.capabilities - flight.info.capabilities
    return f"this UAV cannot {', '.join(sorted(each.name for each in missing))}" if missing else ""


def run_check(flight: Flight, check: Check, may_move: bool = True) -> None:
    """Brings the UAV to the state in which a check starts, and runs the check.

    Raises:
        CheckFailedError: The UAV did not do what it must.
        CannotRunError: The check cannot run with this UAV, or not now.
        UalError: A command of the check failed.
    """
    why = why_not(flight, check, may_move)
    if why:
        raise CannotRunError(why)
    with flight.observing():
        if not may_move and check.starts and flight.uav.state() not in check.starts:
            raise CannotRunError(f"needs the state {' or '.join(state.name for state in check.starts)}")
        flight.bring_to(check.starts)
        check.run(flight)


def run(
    flight: Flight,
    checks: Iterable[Check],
    *,
    may_move: bool = True,
    on_start: Callable[[Check], None] = lambda _: None,
) -> Iterator[Result]:
    """Runs checks and yields how each ended. Lands the UAV at the end if it flies.

    Flies nothing more once the safety pilot of a real UAV has taken over, or the UAV is not ready any more.

    Raises:
        CheckFailedError: The UAV did not land at the end.
        UalError: The landing was refused or failed.
    """
    over = ""
    for check in checks:
        if over:
            yield Result(check, Outcome.SKIPPED, over)
            continue
        on_start(check)
        started_s = time.monotonic()
        outcome, why = Outcome.PASSED, ""
        try:
            run_check(flight, check, may_move)
        except CannotRunError as error:
            outcome, why = Outcome.SKIPPED, str(error)
        except CheckFailedError as error:
            outcome, why = Outcome.FAILED, f"{error}{_unseen(flight)}"
            over = f"nothing is flown after {check.name}" if isinstance(error, RunEndedError) else ""
        except UalError as error:
            outcome, why = Outcome.FAILED, f"{error.reason}: {error.message}{_unseen(flight)}"
        yield Result(check, outcome, why, time.monotonic() - started_s)
    if may_move and not over:
        _land(flight)


def _unseen(flight: Flight) -> str:
    """Returns that the check saw too little to judge by, if it is so; else nothing."""
    silence_s = flight.longest_silence_s
    if silence_s <= LONGEST_TELEMETRY_GAP_S:
        return ""
    return f" (without telemetry or an answer for {silence_s:.1f} s: a busy computer or a bad link)"


def _land(flight: Flight) -> None:
    state = flight.uav.state()
    # If a real safety pilot flies, the pilot lands.
    if state in (State.TAKING_OFF, State.FLYING_AUTO, State.LANDING) or (
        state is State.FLYING_MANUAL and flight.has_pilot
    ):
        with flight.observing():
            flight.land()
