"""The height of a take-off, with simulated autopilots whose home is not known, lies elsewhere, or does not count."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.conftest import LIMIT_S
from tests.simulators import ArduPilot, Px4
from tests.simulators.autopilot import Sticks
from tests.simulators.px4 import LOITER, MANUAL, POSCTL, STABILIZED, Mode
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight, px4_of
from ual.errors import TaskAbortedError, WrongStateError
from ual.types import State, Telemetry

HEIGHT_M = 5.0
HOME = mavlink.MAVLINK_MSG_ID_HOME_POSITION


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    flight = Flight(str(request.param))
    yield flight
    flight.uav.close()


@pytest.fixture
def copter_flight() -> Iterator[Flight]:
    flight = Flight("ardupilot")
    yield flight
    flight.uav.close()


def copter_of(flight: Flight) -> ArduPilot:
    assert isinstance(flight.autopilot, ArduPilot)
    return flight.autopilot


def be_armed(flight: Flight) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    assert flight.autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)


def highest_m(flight: Flight) -> float:
    """Returns the largest true height above the ground."""
    down = [telemetry.pose.position.z for _, telemetry in list(flight.seen) if telemetry.pose is not None]
    return max(down) - down[0]


def test_a_home_position_lost_at_arming_does_not_make_ardupilot_climb_by_the_old_one(copter_flight: Flight) -> None:
    flight, autopilot = copter_flight, copter_of(copter_flight)
    flight.wait_for_state(State.LANDED_DISARMED)
    with autopilot.lock:  # home was set 8.8 m below; the arming moves it to where the copter stands
        autopilot.home = (0.0, 0.0, 8.8)
    flight.wait_for(
        lambda: abs((flight.backend.snapshot().earth.home_altitude_amsl_m or 0.0) - 479.3) < 0.1, "the old home"
    )
    autopilot.builders[HOME] = lambda: None
    be_armed(flight)
    assert flight.backend.snapshot().earth.home_altitude_amsl_m is None
    flight.uav.take_off(HEIGHT_M)  # by ArduPilot's own height above home
    assert highest_m(flight) == pytest.approx(HEIGHT_M, abs=0.4)
    flight.land()


def test_a_take_off_without_any_height_above_home_is_refused(copter_flight: Flight) -> None:
    flight, autopilot = copter_flight, copter_of(copter_flight)
    for message_id in (HOME, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT):
        autopilot.builders[message_id] = lambda: None
    be_armed(flight)
    flight.let_pass(3.0)  # what came before is too old then
    with pytest.raises(WrongStateError, match="has not sent the position of its home yet"):
        flight.uav.take_off(HEIGHT_M)


def test_a_take_off_right_after_arming_waits_for_the_new_home(copter_flight: Flight) -> None:
    flight, autopilot = copter_flight, copter_of(copter_flight)
    flight.wait_for_state(State.LANDED_DISARMED)
    with autopilot.lock:
        autopilot.home = (0.0, 0.0, 8.8)
    flight.let_pass(1.5)
    be_armed(flight)
    flight.uav.take_off(HEIGHT_M)
    assert highest_m(flight) == pytest.approx(HEIGHT_M, abs=0.4)
    flight.land()


def test_with_a_rangefinder_and_a_home_far_below_ardupilot_is_not_sent_up(copter_flight: Flight) -> None:
    flight, autopilot = copter_flight, copter_of(copter_flight)
    autopilot.has_rangefinder = True
    be_armed(flight)
    with autopilot.lock:  # by hand
        autopilot.home = (0.0, 0.0, 20.0)
    flight.let_pass(1.5)
    with pytest.raises(WrongStateError, match=r"home is 20\.0 m below .* climb to 25\.0 m instead of 5 m"):
        flight.uav.take_off(HEIGHT_M)
    with autopilot.lock:
        autopilot.home = autopilot.position
    flight.let_pass(1.5)
    flight.uav.take_off(HEIGHT_M)
    assert highest_m(flight) == pytest.approx(HEIGHT_M, abs=0.4)


@pytest.mark.parametrize("to", [LOITER, STABILIZED, MANUAL])
def test_px4_does_not_climb_where_the_pilot_moved_the_switch_before_offboard_was_requested(to: Mode) -> None:
    flight = Flight("px4")
    try:
        autopilot = px4_of(flight)
        flight.wait_for_state(State.LANDED_DISARMED)
        autopilot.pilot_moves(Sticks())
        assert autopilot.request_mode(POSCTL)
        be_armed(flight)
        flight.let_pass(1.0)
        seen_s = len(autopilot.setpoints_s)
        refused: list[float] = []

        def refuse(_: Telemetry) -> None:
            if not refused and len(autopilot.setpoints_s) > seen_s:
                refused.append(flight.now_s)
                autopilot.pilot_moves(Sticks())
                autopilot.request_mode(to)

        flight.uav.vehicle.subscribe(refuse)
        task = flight.uav.take_off(HEIGHT_M, blocking=False)
        with pytest.raises(TaskAbortedError):
            task.wait(LIMIT_S)
        flight.let_pass(3.0)
        assert autopilot.mode == to
        assert autopilot.body.is_on_ground
        assert flight.commands_since(refused[0]) == set()
    finally:
        flight.uav.close()


def test_a_climb_beyond_what_was_commanded_is_stopped_and_held(flight: Flight) -> None:
    be_armed(flight)
    autopilot = flight.autopilot
    if isinstance(autopilot, ArduPilot):
        autopilot.takeoff_error_m = 20.0
    task = flight.uav.take_off(HEIGHT_M, blocking=False)
    if isinstance(autopilot, Px4):  # its estimate of height rises, in steps too small for a jump of the estimate
        steps = iter(range(6))

        def rise(telemetry: Telemetry) -> None:
            if telemetry.pose is not None and telemetry.pose.position.z > 4.0 and next(steps, None) is not None:
                autopilot.wander.position[2] -= 0.8

        flight.uav.vehicle.subscribe(rise)
    with pytest.raises(TaskAbortedError, match=r"take_off: stopped at .* as 5 m were asked for") as caught:
        task.wait()
    assert caught.value.metadata["by"] == "height"
    flight.wait_for_state(State.FLYING_MANUAL)
    flight.let_pass(3.0)
    telemetry = flight.uav.telemetry()
    assert telemetry.flight_mode == ("AUTO.LOITER" if isinstance(autopilot, Px4) else "BRAKE")
    assert telemetry.state_reason.endswith("; UAL has had the autopilot hold by itself")  # and not "others took it"
    if isinstance(autopilot, ArduPilot):
        assert highest_m(flight) < 1.2 * HEIGHT_M + 1.0 + 1.0
    flight.uav.recover_from_manual()
    flight.land()
