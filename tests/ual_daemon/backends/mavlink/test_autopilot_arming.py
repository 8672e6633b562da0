"""Arming in modes in which an autopilot begins a flight by itself: by UAL, by --auto-arm, and by others."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Iterator
from typing import cast

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.conftest import LIMIT_S
from tests.simulators import ArduPilot, Px4
from tests.simulators.ardupilot import LAND as COPTER_LAND
from tests.simulators.px4 import LAND, LOITER, MISSION, OFFBOARD, POSCTL, TAKEOFF
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight, px4_of
from tests.ual_daemon.backends.mavlink.test_autopilot_own_missions import at, box, landing, stand_armed, start
from ual.errors import LeaseHeldError, WrongStateError
from ual.missions import TakeOff
from ual.types import State
from ual_daemon.backends.values import Cause, Snapshot
from ual_daemon.program.auto_arm import auto_arm
from ual_daemon.server.telemetry_stream import Updates

ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
LONG_S = 12.0
"""Longer than an autopilot that was armed needs to be in the air."""


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    flight = Flight(str(request.param))
    yield flight
    flight.uav.close()


@pytest.fixture
def px4() -> Iterator[Flight]:
    flight = Flight("px4")
    yield flight
    flight.uav.close()


def land_a_mission(flight: Flight, *, is_long: bool = False) -> None:
    """Flies a mission that ends by its landing, after which the autopilot stays in the mode of missions."""
    stand_armed(flight)
    short = [TakeOff(3.0), at(flight, 3, 0, 3.0), landing(flight, 3, 0)]
    assert flight.uav.task(start(flight, box(flight) if is_long else short)).wait(LIMIT_S).error is None
    flight.wait_for_state(State.LANDED_DISARMED)
    name = "AUTO.MISSION" if isinstance(flight.autopilot, Px4) else "AUTO"
    flight.wait_for(lambda: flight.uav.telemetry().flight_mode == name, "the mode of missions")


def stand_in_take_off(px4: Flight) -> None:
    """Stands disarmed in the mode of take-offs, as a ground station has chosen it."""
    px4.wait_for_state(State.LANDED_DISARMED)
    assert px4_of(px4).request_mode(TAKEOFF)
    px4.wait_for(lambda: px4.uav.telemetry().flight_mode == "AUTO.TAKEOFF", "the mode")


def arm_by_others(flight: Flight) -> float:
    """Another station arms, with what lets ArduCopter be armed in AUTO. Returns when."""
    if isinstance(flight.autopilot, ArduPilot):
        flight.autopilot.parameters["AUTO_OPTIONS"] = 3
    assert flight.autopilot.pilot_arm()
    return flight.now_s


def stays_on_ground(flight: Flight, since_s: float) -> bool:
    flight.let_pass(LONG_S)
    return {State.TAKING_OFF, State.FLYING_MANUAL, State.FLYING_AUTO}.isdisjoint(flight.states_since(since_s))


def test_arming_after_a_mission_starts_nothing(flight: Flight) -> None:
    land_a_mission(flight)
    since_s = flight.now_s
    flight.uav.arm()
    assert flight.uav.telemetry().flight_mode not in ("AUTO", "AUTO.MISSION")
    assert stays_on_ground(flight, since_s)


def test_arming_in_the_mode_of_take_offs_starts_nothing(px4: Flight) -> None:
    stand_in_take_off(px4)
    since_s = px4.now_s
    px4.uav.arm()
    assert px4_of(px4).mode == LOITER
    assert stays_on_ground(px4, since_s)


def test_arming_waits_until_the_mode_is_observed_to_have_been_left(
    px4: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in_take_off(px4)
    since_s = px4.now_s
    autopilot = px4_of(px4)
    monkeypatch.setattr(autopilot, "request_mode", lambda _: True)  # it says that it obeys, and does not
    with pytest.raises(Exception, match=r"AUTO\.TAKEOFF starts a flight"):
        px4.uav.arm()
    assert ARM not in px4.commands_since(since_s)
    assert not autopilot.is_armed


def test_the_state_and_health_say_what_arming_starts(flight: Flight) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    told = flight.uav.telemetry()
    assert "starts a flight" not in told.state_reason
    land_a_mission(flight)
    told = flight.uav.telemetry()
    does = "whoever arms it in mode AUTO.MISSION starts a flight"
    expected = does if isinstance(flight.autopilot, Px4) else "whoever arms it in mode AUTO may start a flight"
    assert told.state_reason == f"not armed; {expected}"
    assert told.health is not None
    assert expected in told.health.failing_checks


def test_the_automatic_arming_does_not_arm_in_such_a_mode(flight: Flight) -> None:
    land_a_mission(flight)
    since_s = flight.now_s
    vehicle = flight.uav.vehicle
    pilot = vehicle.safety_pilot()
    assert pilot is not None

    class Polled:
        """Updates that come with the vehicle's time, until so much of that has passed."""

        @property
        def state(self) -> State:
            return flight.uav.state()

        async def change(self, timeout_s: float | None = None) -> None:
            if flight.now_s > since_s + LONG_S:
                raise asyncio.CancelledError
            await asyncio.to_thread(flight.let_pass, timeout_s or 0.1)

    with contextlib.suppress(asyncio.CancelledError):
        asyncio.run(auto_arm(pilot, vehicle.clock, cast("Updates", Polled()), vehicle.why_not_auto_arm))
    assert flight.commands_since(since_s) == set()
    assert not flight.autopilot.is_armed


def test_what_anothers_arming_starts_is_reported_as_theirs_and_left_alone(flight: Flight) -> None:
    land_a_mission(flight)
    flight.let_pass(1.0)
    armed_s = arm_by_others(flight)
    flight.wait_for_state(State.FLYING_MANUAL)
    reason = flight.uav.telemetry().state_reason
    assert "the safety pilot or a ground station has armed it in mode AUTO" in reason
    assert "UAL sends nothing" in reason
    for command in (flight.uav.abort, flight.uav.disarm):
        with pytest.raises(WrongStateError):
            command()
    flight.let_pass(2.0)
    autopilot = flight.autopilot
    if isinstance(autopilot, Px4):
        assert autopilot.request_mode(LAND)
    elif isinstance(autopilot, ArduPilot):
        autopilot.pilot_switches_to(COPTER_LAND)
    flight.wait_for_state(State.LANDING)
    assert "the safety pilot or a ground station has armed it in mode AUTO" in flight.uav.telemetry().state_reason
    assert flight.commands_since(armed_s) == set()
    assert [each for each in autopilot.setpoints_s if each > armed_s] == []


def armed_into_a_flight(px4: Flight) -> None:
    """UAL arms in the moment in which another station selects the mission, which UAL cannot see yet."""
    land_a_mission(px4, is_long=True)
    autopilot = px4_of(px4)
    assert autopilot.request_mode(LOITER)
    px4.wait_for(lambda: px4.uav.telemetry().flight_mode == "AUTO.LOITER", "the mode")
    arms = autopilot.arm

    def selected_just_before(*, is_forced: bool) -> int:
        autopilot.request_mode(MISSION)
        return arms(is_forced=is_forced)

    autopilot.arm = selected_just_before  # type: ignore[method-assign]
    px4.uav.arm()
    autopilot.arm = arms  # type: ignore[method-assign]
    px4.wait_for_state(State.TAKING_OFF)


def selected_after_our_arming(px4: Flight) -> None:
    """Another station selects the mission for the UAV that UAL has armed, and that stands."""
    land_a_mission(px4, is_long=True)
    px4.uav.arm()
    px4.let_pass(0.5)
    assert px4_of(px4).request_mode(MISSION)
    px4.wait_for_state(State.TAKING_OFF)


@pytest.mark.parametrize("at", [State.TAKING_OFF, State.FLYING_MANUAL])
@pytest.mark.parametrize("ends_by", ["abort", "land"])
def test_what_others_select_on_the_ground_after_our_arming_is_ours_to_end(px4: Flight, at: State, ends_by: str) -> None:
    selected_after_our_arming(px4)
    px4.wait_for_state(at)
    assert "after UAL has armed it others have selected mode AUTO.MISSION" in px4.uav.telemetry().state_reason
    if ends_by == "abort":
        px4.uav.abort()
        px4.wait_for_state(State.FLYING_AUTO)
        px4.let_pass(4.0)  # it comes to rest
    px4.land()


@pytest.mark.parametrize("at", [State.TAKING_OFF, State.FLYING_MANUAL])
def test_the_flight_that_our_arming_has_started_is_aborted(px4: Flight, at: State) -> None:
    armed_into_a_flight(px4)
    px4.wait_for_state(at)
    assert "UAL has armed it in mode AUTO.MISSION" in px4.uav.telemetry().state_reason
    px4.uav.abort()
    px4.wait_for_state(State.FLYING_AUTO)
    assert px4_of(px4).mode == OFFBOARD
    px4.let_pass(4.0)  # it comes to rest
    place = px4.autopilot.current_position
    px4.let_pass(4.0)
    assert px4.uav.state() is State.FLYING_AUTO
    assert math.dist(px4.autopilot.current_position, place) < 0.3
    px4.land()


@pytest.mark.parametrize("at", [State.TAKING_OFF, State.FLYING_MANUAL])
def test_the_flight_that_our_arming_has_started_is_landed(px4: Flight, at: State) -> None:
    armed_into_a_flight(px4)
    px4.wait_for_state(at)
    px4.land()


def test_only_who_holds_the_lease_ends_the_flight_that_our_arming_has_started(px4: Flight) -> None:
    armed_into_a_flight(px4)
    px4.uav.vehicle.acquire_lease("other", "other", take=True, lasts_s=math.inf)
    for command in (px4.uav.abort, px4.uav.land):
        with pytest.raises(LeaseHeldError):
            command()


def test_what_the_pilot_takes_of_it_is_his(px4: Flight) -> None:
    armed_into_a_flight(px4)
    px4.wait_for_state(State.FLYING_MANUAL)
    px4.autopilot.pilot_take_over()
    px4.wait_for(lambda: px4.backend.snapshot().control.held_by is Cause.SAFETY_PILOT, "the pilot")
    assert px4_of(px4).mode == POSCTL
    with pytest.raises(WrongStateError):
        px4.uav.abort()


def test_an_abort_in_the_moment_in_which_the_pilot_takes_it_is_refused(
    px4: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a snapshot with the pilot's mode that no update had assessed yet, the abort asked for OFFBOARD."""
    armed_into_a_flight(px4)
    px4.wait_for_state(State.FLYING_MANUAL)
    flight, refused = px4.uav.vehicle.commands._flight, list[str]()
    step = flight.step

    def aborted_first(snapshot: Snapshot) -> None:
        if snapshot.control.mode_name == "POSCTL" and not refused:
            with pytest.raises(WrongStateError) as refusal:
                px4.uav.abort()
            refused.append(str(refusal.value))
        step(snapshot)

    monkeypatch.setattr(flight, "step", aborted_first)
    since_s = px4.now_s
    px4.autopilot.pilot_take_over()
    px4.wait_for(lambda: bool(refused), "the refusal")
    px4.let_pass(2.0)
    assert "have just chosen mode POSCTL" in refused[0]
    assert px4.commands_since(since_s) == set()
    assert px4_of(px4).mode == POSCTL


def test_a_mission_of_ours_is_not_reported_as_selected_by_others(flight: Flight) -> None:
    since_s = flight.now_s
    land_a_mission(flight)
    reasons = [telemetry.state_reason for time_s, telemetry in flight.seen if time_s >= since_s]
    assert [each for each in reasons if "others have selected" in each] == []
