"""Others beside the daemon, on real autopilots in simulation: ground stations, a second daemon, a pause of the link."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.faults import GOOD, Faults
from tests.sitl.flights import PATIENCE_S, Flight
from tests.sitl.pilot import SafetyPilot
from tests.sitl.simulators import Simulator
from tests.sitl.transmitter import Transmitter
from tests.sitl.wiretap import Wiretap
from ual.errors import TaskAbortedError, UalError, WrongStateError
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.mavlink.wire.messages import Message

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

IDLE_ID = 192
"""The component that the second daemon is."""
WATCHED_S = 3.0
"""Seconds of watching: only time shows that nothing is sent, or no mode comes back."""
RATE_S = 3.0
HEALED_S = 40.0
"""Rates that a ground station lowered are noticed after some seconds, and asked for again at most every 10 s."""
SPEED_M_S = 4.0
OWN_HOLD = {"PX4": (4 << 16 | 3 << 24, 4.0, 3.0), "ArduPilot": (17, 17.0, 0.0)}
"""The mode in which it holds by itself: its number, and its words in DO_SET_MODE."""


@pytest.fixture
def px4_pilot(pilot: Transmitter) -> SafetyPilot:
    if not isinstance(pilot, SafetyPilot):
        pytest.skip("a PX4")
    return pilot


def hold_by_station(flight: Flight, simulator: Simulator) -> None:
    """A ground station makes the autopilot hold by itself."""
    flight.pilot.set_mode(*OWN_HOLD[simulator.autopilot])
    flight.wait_for_state(State.FLYING_MANUAL)


def test_a_ground_station_that_makes_it_hold_is_named_and_land_ends_the_flight(
    flight: Flight, uav: UAL, wiretap: Wiretap, simulator: Simulator
) -> None:
    flight.take_off()
    task = uav.go_to_waypoint(flight.offset(40.0), blocking=False)
    flight.wait_for_speed(1.0)
    hold_by_station(flight, simulator)
    with pytest.raises(TaskAbortedError) as caught:
        task.wait(PATIENCE_S)
    assert caught.value.metadata["by"] == "ground station"
    since_s = time.monotonic()
    time.sleep(WATCHED_S)
    assert wiretap.setpoints(since_s) == 0
    assert wiretap.orders(since_s) == []
    uav.land()  # out of the autopilot's own mode
    flight.wait_for_state(State.LANDED_DISARMED)


def test_return_to_launch_ends_a_flight_that_the_autopilot_holds_and_never_one_that_the_pilot_flies(
    flight: Flight, uav: UAL, simulator: Simulator
) -> None:
    flight.set_home(0.0)  # another test's home may still count
    flight.take_off()
    ground = flight.position()
    uav.go_to_waypoint(flight.offset(8.0))
    flight.pilot.take_over()
    flight.wait_for_state(State.FLYING_MANUAL)
    for command in (uav.land, uav.return_to_launch):
        with pytest.raises(WrongStateError, match="the safety pilot flies"):
            command()
    assert uav.telemetry().flight_mode == simulator.pilots_mode
    uav.recover_from_manual()
    flight.pilot.stand_by()
    hold_by_station(flight, simulator)
    uav.return_to_launch(height_m=5.0)
    flight.wait_for_state(State.LANDED_DISARMED)
    home = flight.position()
    assert abs(home.x - ground.x) < 1.0 + simulator.wanders_m
    assert abs(home.y - ground.y) < 1.0 + simulator.wanders_m


def test_a_second_idle_daemon_behind_the_same_router_leaves_the_others_go_to_alone(
    flight: Flight, uav: UAL, wiretap: Wiretap, px4_pilot: SafetyPilot
) -> None:
    """The recipe: a second, idle daemon froze the first one's go-to, and took it out of its mode when it ended."""
    flight.take_off()
    goal = flight.offset(20.0)
    task = uav.go_to_waypoint(goal, blocking=False)
    flight.wait_for_speed(0.5)
    since_s = time.monotonic()
    with UAL("mavlink", "uav_1", url=wiretap.url, backend_settings={"component_id": IDLE_ID}) as second:
        flight.wait_for(second.is_ready, "a state of the second")
        assert second.state() is State.FLYING_AUTO
        time.sleep(2.0)
    task.wait(PATIENCE_S)
    assert (flight.position() - goal.position).norm() < 1.5
    assert uav.state() is State.FLYING_AUTO
    assert wiretap.setpoints(since_s, component_id=IDLE_ID) == 0
    assert wiretap.orders(since_s, component_id=IDLE_ID) == []
    assert px4_pilot.mode >> 16 & 0xFF == 6
    uav.land()


def lowered(simulator: Simulator, system_id: int) -> Message:
    """Returns the request of a ground station on the daemon's link: 4 positions a second."""
    if simulator.autopilot == "ArduPilot":
        return mavlink.MAVLink_request_data_stream_message(system_id, 1, mavlink.MAV_DATA_STREAM_ALL, 4, 1)
    interval = (float(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED), 250_000.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return mavlink.MAVLink_command_long_message(system_id, 1, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, *interval)


def rate_hz(wiretap: Wiretap) -> float:
    """Returns the setpoints that it sends a second."""
    since_s = time.monotonic()
    time.sleep(RATE_S)
    return wiretap.setpoints(since_s) / RATE_S


def test_rates_that_a_ground_station_lowers_are_requested_again(
    flight: Flight, uav: UAL, wiretap: Wiretap, simulator: Simulator
) -> None:
    """The recipe: the setpoints fell from 34 to 19 a second, for good."""
    flight.take_off()
    before_hz = rate_hz(wiretap)
    wiretap.inject(lowered(simulator, flight.pilot._system_id))
    lowest_hz, until_s = before_hz, time.monotonic() + HEALED_S
    while (now_hz := rate_hz(wiretap)) < 0.8 * before_hz or lowest_hz == before_hz:
        lowest_hz = min(lowest_hz, now_hz)
        if lowest_hz > 0.9 * before_hz and time.monotonic() > until_s - HEALED_S / 2:
            break  # healed sooner than it could be seen
        assert time.monotonic() < until_s, f"{before_hz:.0f} setpoints/s before, {now_hz:.0f} now"
    print(f"{simulator.autopilot} rates: {before_hz:.0f} setpoints/s, lowest {lowest_hz:.0f}, then {now_hz:.0f}")
    assert uav.state() is State.FLYING_AUTO
    uav.land()


@pytest.fixture
def short_loss(px4_pilot: SafetyPilot) -> Iterator[None]:
    """PX4 leaves OFFBOARD after half a second without setpoints, less than UAL's own pause."""
    px4_pilot.set_parameter("COM_OF_LOSS_T", 0.5)
    yield
    px4_pilot.set_parameter("COM_OF_LOSS_T", 1.0)


@pytest.mark.usefixtures("short_loss")
def test_after_a_pause_that_is_too_long_for_the_autopilot_it_is_not_taken_back_unasked(
    flight: Flight, wiretap: Wiretap
) -> None:
    """The recipe: with COM_OF_LOSS_T below 1 s a pause of 0.6 s ended with PX4 pulled back into OFFBOARD."""
    flight.uav.close()
    with UAL("mavlink", "uav_1", url=wiretap.url) as uav:  # reads the parameter anew
        flight.uav = uav
        flight.take_off()
        task = uav.go_to_waypoint(flight.offset(40.0), blocking=False)
        flight.wait_for_speed(1.0)
        wiretap.faults = Faults(is_silent=True)
        time.sleep(0.75)
        wiretap.faults = GOOD
        with pytest.raises(UalError):
            task.wait(PATIENCE_S)
        since_s = time.monotonic()
        time.sleep(WATCHED_S)
        assert wiretap.setpoints(since_s) == 0
        assert wiretap.orders(since_s) == []
        assert uav.state() is State.FLYING_MANUAL
        assert uav.telemetry().flight_mode != "OFFBOARD"
        uav.recover_from_manual(force=True)
        uav.land()
        flight.wait_for_state(State.LANDED_DISARMED)


def test_an_abort_at_speed_stops_within_the_limits_and_holds(flight: Flight, uav: UAL, simulator: Simulator) -> None:
    """The recipe: an abort from 8 m/s took 20 m. Goals without a speed are flown at the autopilot's cruise now."""
    flight.take_off()
    uav.go_to_waypoint(flight.offset(60.0), max_speed_m_s=SPEED_M_S, blocking=False)
    flight.wait_for_speed(0.95 * SPEED_M_S)
    time.sleep(1.5)  # until it does not accelerate any more
    begin, speed_m_s = flight.position(), uav.velocity().twist.linear.norm()
    uav.abort()
    flight.wait_for(lambda: uav.velocity().twist.linear.norm() < 0.5, "its stop", 15.0)
    stop_m = (flight.position() - begin).norm()
    print(f"{simulator.autopilot} abort: {stop_m:.1f} m from {speed_m_s:.1f} m/s")
    braking_m = SPEED_M_S**2 / (2.0 * uav.info().limits.horizontal_acceleration_m_s2)
    assert stop_m < 1.2 * braking_m + 1.5 * SPEED_M_S + simulator.wanders_m
    uav.land()
