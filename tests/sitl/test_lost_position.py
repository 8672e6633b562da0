"""A position that is lost or wrong: told within a second, while the autopilot flies on by inertia."""

from __future__ import annotations

from contextlib import suppress
from time import monotonic

import pytest

from tests.sitl.doing import Doing, take_off, waited
from tests.sitl.flights import Flight
from tests.sitl.simulators import Simulator
from tests.sitl.transmitter import Transmitter
from tests.sitl.troubles import Change, changed, trouble
from ual.errors import RejectedByAutopilotError, TaskAbortedError, UalTimeoutError
from ual.types import GpsFix, State
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

TOLD_S = 1.0
_GLITCHES = {"PX4": (), "ArduPilot": (Change("SIM_GPS_GLITCH_X", 6e-4, 0.0),)}
"""67 m."""
_AGES_S = 40.0
_DOES = ("the autopilot lands", "in mode ALTCTL: position failsafe")
"""Reasons that say what the autopilot does. PX4 gives control to its pilot, with the sticks in hand."""


def _checks(uav: UAL) -> str:
    health = uav.telemetry().health
    return "" if health is None else "; ".join(health.failing_checks)


def _has_fix(uav: UAL) -> bool:
    gps = uav.telemetry().gps
    return gps is not None and gps.fix >= GpsFix.FIX_3D


def test_satellites_that_are_lost_are_reported_within_a_second(
    flight: Flight, uav: UAL, simulator: Simulator, pilot: Transmitter
) -> None:
    doing = Doing()
    take_off(flight, doing, "go_to")
    doing.begin(waited(lambda: uav.go_to_waypoint(flight.offset(60.0), max_speed_m_s=2.0, blocking=False)))
    flight.wait_for_speed(1.0)
    with trouble(pilot, simulator.autopilot, "position failsafe"):
        flight.wait_for(lambda: not _has_fix(uav), "the loss of its fix")
        lost_s = monotonic()
        flight.wait_for(lambda: "no satellite fix" in uav.telemetry().state_reason, "that it is told", 5.0)
        told_s, reason = monotonic() - lost_s, uav.telemetry().state_reason
        print(f"{simulator.autopilot}: told {told_s:.2f} s after its fix was lost: {reason}")
        assert told_s < TOLD_S
        assert "position: no satellite fix" in _checks(uav)
        flight.wait_for(lambda: doing.ended_s is not None or uav.velocity().twist.linear.norm() < 0.5, "its stop", 8.0)
        flight.wait_for(lambda: uav.state() is State.UNINITIALIZED, "that its position is lost", 20.0)
        flight.wait_for(lambda: any(each in uav.telemetry().state_reason for each in _DOES), "what it does", 10.0)
        print(f"{simulator.autopilot}: {uav.telemetry().state_reason}; its task: {doing.error}")
    flight.wait_for(uav.is_ready, "its position", 60.0)
    flight.wait_for(lambda: _is_taken_back(uav), "the control")


def _is_taken_back(uav: UAL) -> bool:
    """Takes the control out of PX4's mode, which an autopilot that has just found its position may refuse."""
    if uav.state() is State.FLYING_MANUAL:
        with suppress(RejectedByAutopilotError, TaskAbortedError, UalTimeoutError):
            uav.recover_from_manual(force=True)
    return uav.state() not in (State.FLYING_MANUAL, State.UNINITIALIZED)


def test_a_severe_text_of_the_autopilot_is_reported_within_a_second_and_ages(
    flight: Flight, uav: UAL, simulator: Simulator, pilot: Transmitter
) -> None:
    glitches = _GLITCHES[simulator.autopilot]
    if not glitches:
        pytest.skip("an ArduCopter: PX4's simulator has no glitch")
    take_off(flight, Doing(), "hover")
    count = len(pilot.severe)
    with changed(pilot, glitches):
        flight.wait_for(lambda: len(pilot.severe) > count, "a severe text", 15.0)
        came_s, text = pilot.severe[count]
        flight.wait_for(lambda: f"autopilot: {text}" in _checks(uav), f"{text!r} in its health", 5.0)
        told_s = monotonic() - came_s
        print(f"{simulator.autopilot}: {text!r} was told {told_s:.2f} s after it came: {_checks(uav)}")
        assert told_s < TOLD_S
    flight.wait_for(lambda: "GPS Glitch or" not in _checks(uav), "that it has aged", _AGES_S)
