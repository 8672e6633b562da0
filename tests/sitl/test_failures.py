"""Failures of the vehicle in flight: what falls is told, ends what is flown, and stays down when the motors run again.

By the simulator's truth. `docs/evidence/campaign.md` says how often each was flown.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial

import pytest

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.sitl.doing import FLOWN, HEIGHT_M, Doing, take_off
from tests.sitl.flights import Flight
from tests.sitl.simulators import Simulator
from tests.sitl.transmitter import Transmitter
from tests.sitl.troubles import Change, changed
from tests.sitl.truth import Truth
from tests.sitl.wiretap import Wiretap
from ual.errors import TaskAbortedError, UalError, WrongStateError
from ual.geometry import Pose, Twist, Vector3
from ual.types import State, Telemetry

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

TOLD_S = 1.0
STOPPED_S, WATCHED_S = 5.0, 8.0
LEFT_S, LANDS_S = 3.0, 10.0
"""Seconds after the fall by which its landing of before is left, and until it is commanded to land, at most: by its
estimate PX4 may go on falling. A daemon that is killed before leaves it to PX4, which climbs once it can.
"""
_LANDED, _NAV_LAND = (State.LANDED_ARMED, State.LANDED_DISARMED), "command : 21,"
STAYS_M = 0.6
"""Metres that what lies may rise, by a controller that runs up its motors."""
NOT_FOLLOWED = "not follow"
_NO_THRUST = Change("SIH_T_MAX", 0.3, 5.0)
_STOP_FUNCTION, _HIGH, _LOW = 31.0, 2.0, 0.0
_DO_AUX_FUNCTION = 218
_INJECT_FAILURE, _MOTOR, _OFF, _WORKS = 420, 101.0, 1.0, 0.0


@contextmanager
def stopped_motors(pilot: Transmitter) -> Iterator[None]:
    """Has no motor lift it, until the end of the block."""
    if pilot.autopilot == "PX4":
        with changed(pilot, (_NO_THRUST,)):
            yield
        return
    pilot.order(_DO_AUX_FUNCTION, (_STOP_FUNCTION, _HIGH))
    try:
        yield
    finally:
        pilot.order(_DO_AUX_FUNCTION, (_STOP_FUNCTION, _LOW))


@pytest.mark.parametrize("is_restarted", [False, True], ids=["", "restarted"])
@pytest.mark.parametrize("what", ["take_off", *FLOWN])
@pytest.mark.usefixtures("lands_in_the_end")
def test_a_fall_is_reported_and_nothing_climbs_when_the_motors_run_again(
    tapped_daemon: DaemonProcess,
    start_daemon: StartDaemon,
    wiretap: Wiretap,
    pilot: Transmitter,
    truth: Truth,
    simulator: Simulator,
    what: str,
    *,
    is_restarted: bool,
) -> None:
    daemon, doing = tapped_daemon, Doing()
    with ual.Uav(address=daemon.address) as uav:
        flight = Flight(uav, pilot)
        take_off(flight, doing, what)
        if what == "take_off":
            flight.wait_for(lambda: truth.height_m > HEIGHT_M - 2.0, "its height")
        elif (flown := FLOWN[what](flight)) is not None:
            doing.begin(flown)
            if what not in ("land", "velocity"):
                flight.wait_for_speed(1.0)
        with stopped_motors(pilot):
            flight.wait_for(lambda: truth.fell_s is not None, "the fall", 5.0)
            assert truth.fell_s is not None
            fell_s = truth.fell_s
            with suppress(AssertionError):
                flight.wait_for(lambda: _is_reported(uav.telemetry()), "that it does not follow", 3.0)
            told_s = time.monotonic() - fell_s
            told = uav.telemetry()
            doing.join()
            print(f"{simulator.autopilot} {what}: told {told_s:.2f} s after its fall: {told.state_reason}")
            print(f"its task ended by {doing.error}")
            assert _is_reported(told)
            assert told_s < TOLD_S
            if what != "hover":
                assert isinstance(doing.error, TaskAbortedError | WrongStateError)
                assert doing.ended_s is not None
                assert doing.ended_s - fell_s < 2.0 * TOLD_S
            with pytest.raises(UalError):
                uav.go_to_waypoint(Pose.at(0.0, 0.0, HEIGHT_M), blocking=False)
            _wait_until(fell_s + LEFT_S)  # the landing that it was in has been left
            if is_restarted:
                flight.wait_for(lambda: _is_led_down(uav.state(), wiretap, fell_s), "its landing", LANDS_S)
                daemon.signal(signal.SIGKILL)
                daemon.wait()
            _wait_until(fell_s + STOPPED_S)
        ran_s = time.monotonic()
    if is_restarted:
        daemon = start_daemon("--url", wiretap.url, "--allow-arming", backend="mavlink")
    heights_m, states = _watched(daemon, truth)
    print(f"{WATCHED_S:.0f} s after the motors ran again at most {max(heights_m):.2f} m up: {states}")
    assert max(heights_m) < STAYS_M, states
    assert [each for each in wiretap.orders(ran_s) if "arm" in str(each)] == []


@contextmanager
def dead_motor(pilot: Transmitter) -> Iterator[None]:
    """One motor does not turn, until the end of the block: it tumbles, and lies on its back."""
    if pilot.autopilot != "PX4":
        with changed(pilot, (Change("SIM_ENGINE_MUL", 0.0, 1.0), Change("SIM_ENGINE_FAIL", 1.0, 0.0))):
            yield
        return
    pilot.order(_INJECT_FAILURE, (_MOTOR, _OFF, 1.0))
    try:
        yield
    finally:
        pilot.order(_INJECT_FAILURE, (_MOTOR, _WORKS, 1.0))


@pytest.mark.parametrize("is_restarted", [False, True], ids=["", "restarted"])
@pytest.mark.parametrize("breaks", [stopped_motors, dead_motor])
@pytest.mark.usefixtures("lands_in_the_end")
def test_what_lies_takes_no_motion_however_often_it_is_recovered(
    tapped_daemon: DaemonProcess,
    start_daemon: StartDaemon,
    wiretap: Wiretap,
    pilot: Transmitter,
    truth: Truth,
    breaks: Callable[[Transmitter], AbstractContextManager[None]],
    *,
    is_restarted: bool,
) -> None:
    """PX4 may take it to be in the air. It lifted off by a go-to, 2.8 m/s sideways, once control was asked back."""
    daemon = tapped_daemon
    with ual.Uav(address=daemon.address) as uav:
        flight = Flight(uav, pilot)
        take_off(flight, Doing(), "hover")
        with breaks(pilot):
            flight.wait_for(lambda: truth.fell_s is not None, "the fall", 5.0)
            assert truth.fell_s is not None
            _wait_until(truth.fell_s + STOPPED_S)
            if is_restarted:
                daemon.signal(signal.SIGKILL)
                daemon.wait()
    if is_restarted:
        daemon = start_daemon("--url", wiretap.url, "--allow-arming", backend="mavlink")
    accepted: list[str] = []
    with ual.Uav(address=daemon.address) as uav:
        lies_m, until_s = truth.height_m, time.monotonic() + WATCHED_S
        while time.monotonic() < until_s:
            for motion in (uav.recover_from_manual, partial(uav.set_velocity, Twist(Vector3(1.0, 0.0, 0.5)))):
                told = uav.telemetry()
                with suppress(UalError):
                    motion()
                    accepted.append(f"{told.state.name}: {told.state_reason}")
            assert truth.height_m - lies_m < STAYS_M, accepted
            time.sleep(0.1)  # between two tries
        told = uav.telemetry()
    print(f"{pilot.autopilot}, {breaks.__name__}: accepted {accepted}; {told.state.name}: {told.state_reason}")


def _is_led_down(state: State, wiretap: Wiretap, fell_s: float) -> bool:
    """Returns whether it lies, or was commanded to land since its fall: the command leaves after the state is told."""
    return state in _LANDED or any(_NAV_LAND in each for each in wiretap.orders(fell_s))


def _is_reported(told: Telemetry) -> bool:
    """Returns whether the fall is told, or that nothing is known: PX4 may lose its position in a fall."""
    reason = told.state_reason
    return told.state is State.UNINITIALIZED or NOT_FOLLOWED in reason or "in the air, and the UAV f" in reason


def _wait_until(time_s: float) -> None:
    # Time must pass: only then does it show that nothing moves.
    time.sleep(max(0.0, time_s - time.monotonic()))


def _watched(daemon: DaemonProcess, truth: Truth) -> tuple[Sequence[float], Sequence[str]]:
    """Returns its heights, and each state that is told, with its reason, for some seconds."""
    heights_m: list[float] = []
    states: list[str] = []
    with ual.Uav(address=daemon.address) as uav:
        uav.telemetry()  # a busy computer takes seconds to connect
        until_s = time.monotonic() + WATCHED_S
        while time.monotonic() < until_s:
            heights_m.append(truth.height_m)
            told = uav.telemetry()
            text = f"{told.state.name}: {told.state_reason}"
            if not states or states[-1] != text:
                states.append(text)
            time.sleep(0.1)  # between two looks
    return heights_m, states
