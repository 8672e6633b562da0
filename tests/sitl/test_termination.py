"""A flight termination, and motors without thrust: what is told, and that nothing climbs unasked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic

import pytest
from pymavlink.dialects.v20 import all as mavlink

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.sitl.doing import Doing, take_off
from tests.sitl.flights import Flight
from tests.sitl.transmitter import Transmitter
from tests.sitl.troubles import Change, changed
from tests.sitl.truth import Truth
from tests.sitl.wiretap import Wiretap
from ual.errors import UalError, UalTimeoutError
from ual.geometry import Twist, Vector3
from ual.types import State, Telemetry
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300), pytest.mark.usefixtures("lands_in_the_end")]

TOLD_S = 1.0
LIES_S = 15.0
STAYS_M = 0.6
WATCHED_S = 6.0
_WEAK = {
    "PX4": (Change("SIH_T_MAX", 1.0, 5.0),),
    "ArduCopter": (Change("MOT_SPIN_MAX", 0.2, 0.95),),
}
_DO_AUX_FUNCTION, _STOP_FUNCTION, _HIGH, _LOW = 218, 31.0, 2.0, 0.0
REFUSED_ADVICE = ("recover_from_manual takes control back", "lands it by hand", "recover_from_manual is called")
"""Advice that a terminated autopilot refuses, or that nobody can follow."""


def _advises_what_is_refused(told: Telemetry) -> bool:
    return any(each in told.state_reason for each in REFUSED_ADVICE)


def test_a_termination_is_reported_and_its_advice_can_be_followed(
    tapped_daemon: DaemonProcess, start_daemon: StartDaemon, wiretap: Wiretap, pilot: Transmitter, truth: Truth
) -> None:
    """Also by a daemon that is started while it lies there."""
    with ual.Uav(address=tapped_daemon.address) as uav:
        flight = Flight(uav, pilot)
        take_off(flight, Doing(), "hover")
        pilot.order(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, (1.0,))
        flight.wait_for(lambda: truth.fell_s is not None, "its fall", 5.0)
        assert truth.fell_s is not None
        flight.wait_for(lambda: _is_reported(uav.telemetry()), "that it is told", 5.0)
        told_s, reason = monotonic() - truth.fell_s, uav.telemetry().state_reason
        print(f"{pilot.autopilot}: told {told_s:.2f} s after the fall began: {reason}")
        assert told_s < TOLD_S
        flight.wait_for(lambda: _lies(uav.telemetry()) and truth.is_down, "that it lies", LIES_S)
        print(f"{pilot.autopilot}: {uav.state().name}: {uav.telemetry().state_reason}")
        assert not _advises_what_is_refused(uav.telemetry())
        if uav.state() is not State.LANDED_DISARMED:
            with pytest.raises(UalError):
                uav.take_off(3.0)
    tapped_daemon.close()
    second = start_daemon("--url", wiretap.url, "--allow-arming", backend="mavlink")
    with ual.Uav(address=second.address) as uav:
        flight = Flight(uav, pilot)
        flight.wait_for(lambda: uav.state() is not State.UNINITIALIZED, "a state")
        flight.wait_for(lambda: _lies(uav.telemetry()) and truth.is_down, "that it lies, by the next daemon", LIES_S)
        print(f"{pilot.autopilot}, next daemon: {uav.state().name}: {uav.telemetry().state_reason}")
        assert not _advises_what_is_refused(uav.telemetry())


def test_a_daemon_that_is_new_accepts_no_motion_while_the_motors_are_stopped(
    tapped_daemon: DaemonProcess, start_daemon: StartDaemon, wiretap: Wiretap, pilot: Transmitter
) -> None:
    """From the autopilot's word on: PX4 has said it with the first state, ArduCopter by two reports of its outputs."""
    with ual.Uav(address=tapped_daemon.address) as uav:
        take_off(Flight(uav, pilot), Doing(), "hover")
    tapped_daemon.close()
    with stopped_motors(pilot):
        second = start_daemon("--url", wiretap.url, "--allow-arming", backend="mavlink")
        with ual.Uav(address=second.address) as uav:
            flight = Flight(uav, pilot)
            flight.wait_for(lambda: uav.state() is not State.UNINITIALIZED, "a state")
            answers: list[str] = []
            begun_s, accepted_s = monotonic(), 0.0
            while monotonic() < begun_s + WATCHED_S:
                answer = _answer_to_motion(uav)
                accepted_s = accepted_s if answer else monotonic() - begun_s
                if not answers or answers[-1] != answer:
                    print(f"{pilot.autopilot}, next daemon, {monotonic() - begun_s:.2f} s: {answer or 'accepted'}")
                    answers.append(answer)
    if pilot.autopilot == "PX4":
        assert "has stopped the motors" in answers[0]
    assert accepted_s < (0.01 if pilot.autopilot == "PX4" else TOLD_S), answers


def _answer_to_motion(uav: ual.Uav) -> str:
    """Returns why a velocity is refused; empty where it is not."""
    try:
        uav.set_velocity(Twist(Vector3(0.5, 0.0, 0.0)))
    except UalError as error:
        return f"{uav.state().name}: {error}"
    return ""


@contextmanager
def stopped_motors(pilot: Transmitter) -> Iterator[None]:
    """Stops the motors in the air: a termination (PX4), or the emergency stop until the end of the block."""
    if pilot.autopilot == "PX4":
        pilot.order(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, (1.0,))
        yield
        return
    pilot.order(_DO_AUX_FUNCTION, (_STOP_FUNCTION, _HIGH))
    try:
        yield
    finally:
        pilot.order(_DO_AUX_FUNCTION, (_STOP_FUNCTION, _LOW))


def _is_reported(told: Telemetry) -> bool:
    words = ("stopped its motors", "disarmed in the air", "not follow")
    return told.state is State.UNINITIALIZED or any(each in told.state_reason for each in words)


def _lies(told: Telemetry) -> bool:
    return told.state in (State.LANDED_ARMED, State.LANDED_DISARMED)


@contextmanager
def held_down(pilot: Transmitter) -> Iterator[None]:
    """Leaves it less thrust than it weighs, until the end of the block."""
    with changed(pilot, _WEAK[pilot.autopilot]):
        yield


def test_a_take_off_without_thrust_ends_and_does_not_climb_when_it_is_back(
    flight: Flight, uav: UAL, pilot: Transmitter, truth: Truth
) -> None:
    flight.be_armed()
    with held_down(pilot):
        began_s = monotonic()
        with pytest.raises(UalTimeoutError) as caught:
            uav.take_off(5.0)
        print(f"{pilot.autopilot}: {monotonic() - began_s:.1f} s: {caught.value}")
        assert "no way" in (caught.value.metadata.get("by", ""), str(caught.value)) or "made no way" in str(
            caught.value
        )
    heights_m, until_s = [truth.height_m], monotonic() + WATCHED_S

    def poll() -> bool:
        heights_m.append(truth.height_m)
        return monotonic() > until_s

    flight.wait_for(poll, "time to climb")
    rose_m = max(heights_m) - heights_m[0]
    print(f"{pilot.autopilot}: rose {rose_m:.2f} m after its thrust was back: {uav.state().name}")
    assert rose_m < STAYS_M
