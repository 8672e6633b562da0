"""Authority to fly, on real autopilots in simulation: a ground station's flight, the pilot's ground, failsafes."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.sitl.copter_pilot import GUIDED, CopterPilot
from tests.sitl.flights import HEIGHT_M, PATIENCE_S, Flight
from tests.sitl.transmitter import Sticks, Transmitter
from tests.sitl.wiretap import Wiretap
from ual.errors import GeofenceError, PermissionDeniedError, TaskAbortedError, WrongStateError
from ual.types import Health, State
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

FAR_M = 15.0
POSITION_ONLY = 0b110111111000


@pytest.fixture
def flight(flight: Flight, pilot: Transmitter) -> Iterator[Flight]:
    """It lands at the end of a test in any case."""
    yield flight
    pilot.sticks = Sticks()
    if flight.uav.state() is State.FLYING_MANUAL:
        flight.uav.recover_from_manual(force=True)


@pytest.fixture
def copter(pilot: Transmitter) -> CopterPilot:
    if not isinstance(pilot, CopterPilot):
        pytest.skip("an ArduCopter's ground station")
    return pilot


def health(uav: UAL) -> Health:
    found = uav.telemetry().health
    assert found is not None
    return found


def set_parameter(pilot: Transmitter, name: str, value: float) -> None:
    """The ground station sets a parameter, over a link that loses nothing."""
    kind = mavlink.MAV_PARAM_TYPE_REAL32
    pilot._tell(mavlink.MAVLink_param_set_message(pilot._system_id, 1, name.encode("ascii"), value, kind))
    time.sleep(0.5)


def station_goes(pilot: Transmitter, north: float, east: float, down: float) -> None:
    """The ground station's "fly to here": one target."""
    frame, zeros = mavlink.MAV_FRAME_LOCAL_NED, (0.0,) * 8
    target = mavlink.MAVLink_set_position_target_local_ned_message(
        0, pilot._system_id, 1, frame, POSITION_ONLY, north, east, down, *zeros
    )
    pilot._tell(target)


def test_a_ground_stations_flight_goes_on_while_daemons_start_and_end(
    flight: Flight, uav: UAL, wiretap: Wiretap, copter: CopterPilot
) -> None:
    """The recipe: starting a daemon stopped a ground station's flight with 310 setpoints; its end put it into BRAKE."""
    flight.be_armed()
    copter._order(
        mavlink.MAV_CMD_NAV_TAKEOFF, (0.0,) * 6 + (HEIGHT_M,), lambda: uav.state() is State.TAKING_OFF, "taking off"
    )
    flight.wait_for_state(State.FLYING_AUTO)
    began_s = time.monotonic()
    start = flight.position()
    station_goes(copter, start.y + FAR_M, start.x, -HEIGHT_M)
    flight.wait_for_speed(1.0)
    uav.close()
    with UAL("mavlink", "uav_1", url=wiretap.url) as second:
        flight.uav = second
        flight.wait_for(second.is_ready, "a state")
        flight.wait_for(lambda: abs(flight.position().y - start.y - FAR_M) < 1.0, "the ground station's goal")
        assert second.state() is State.FLYING_AUTO
        assert (
            "UAL has not been commanded in this flight since it was started, and sends nothing"
            in second.telemetry().state_reason
        )
        station_goes(copter, start.y, start.x, -HEIGHT_M)
        flight.wait_for(
            lambda: "another program sends setpoints" in second.telemetry().state_reason, "the other's name", 5.0
        )
    with UAL("mavlink", "uav_1", url=wiretap.url, watch_only=True) as third:
        flight.uav = third
        flight.wait_for(third.is_ready, "a state")
        with pytest.raises(PermissionDeniedError, match="--watch-only"):
            third.abort()
        flight.wait_for(lambda: abs(flight.position().y - start.y) < 1.0, "the ground station's next goal")
        assert third.telemetry().flight_mode == "GUIDED"
        assert wiretap.setpoints(began_s) == 0
        assert wiretap.orders(began_s) == []
    with UAL("mavlink", "uav_1", url=wiretap.url) as fourth:
        flight.uav = fourth
        flight.wait_for(fourth.is_ready, "a state")
        fourth.go_to_waypoint(flight.offset(3.0))  # its first command takes the flight
        fourth.land()
        flight.wait_for_state(State.LANDED_DISARMED)


def test_two_daemons_on_two_links_and_the_idle_one_leaves_the_others_go_to_alone(
    flight: Flight, uav: UAL, copter: CopterPilot, url: str
) -> None:
    """The recipe: a second, idle daemon froze the first one's go-to, and put it in BRAKE when it ended."""
    third_port = int(url.rsplit(":", 1)[1]) + 3
    flight.take_off()
    goal = flight.offset(20.0)
    task = uav.go_to_waypoint(goal, blocking=False)
    flight.wait_for_speed(0.5)
    second_url = f"tcp://127.0.0.1:{third_port}"
    settings = {"component_id": 192}
    with UAL("mavlink", "uav_1", url=second_url, backend_settings=settings) as second:
        flight.wait_for(second.is_ready, "a state of the second")
        assert second.state() is State.FLYING_AUTO
        time.sleep(2.0)
    task.wait(PATIENCE_S)
    assert (flight.position() - goal.position).norm() < 1.0
    assert uav.state() is State.FLYING_AUTO
    assert copter.mode == GUIDED
    uav.land()


def test_after_the_pilot_landed_by_hand_a_looping_take_off_does_not_lift_it(
    flight: Flight, uav: UAL, wiretap: Wiretap
) -> None:
    """The recipe: 0.1 s after the touch a client's `take_off` was accepted, and PX4 climbed again."""
    flight.take_off()
    flight.pilot.take_over()
    flight.wait_for_state(State.FLYING_MANUAL)
    taken_s = time.monotonic()
    flight.pilot.sticks = Sticks(up=-0.7)
    states = set()
    deadline_s = taken_s + 90.0
    while (state := uav.state()) is not State.LANDED_DISARMED:
        assert time.monotonic() < deadline_s
        states.add(state)
        with pytest.raises(WrongStateError):
            uav.take_off(HEIGHT_M)
        time.sleep(0.05)
    assert State.LANDED_ARMED in states
    assert wiretap.setpoints(taken_s) == 0
    assert wiretap.orders(taken_s) == []
    flight.pilot.sticks = Sticks()
    flight.pilot.stand_by()
    flight.wait_for(lambda: not flight.pilot.is_armed, "the pilot's heartbeat")
    flight.take_off()  # it was disarmed once
    uav.land()


def test_a_lost_transmitter_is_named_and_its_return_is_ended_by_force_only(
    flight: Flight, uav: UAL, copter: CopterPilot
) -> None:
    flight.take_off()
    task = uav.go_to_waypoint(flight.offset(40.0), blocking=False)
    flight.wait_for_speed(1.0)
    set_parameter(copter, "SIM_RC_FAIL", 1.0)
    try:
        with pytest.raises(TaskAbortedError, match="rc failsafe") as caught:
            task.wait(PATIENCE_S)
        assert caught.value.metadata["by"] == "rc failsafe"
        assert uav.state() is State.FLYING_MANUAL
        assert health(uav).held_by == "rc failsafe"
        flight.wait_for(lambda: health(uav).failsafe == "rc failsafe", "the sensor's failure", 2.0)
        with pytest.raises(WrongStateError, match="rc failsafe") as refused:
            uav.recover_from_manual()
        assert refused.value.metadata["needed"] == "force"
        assert uav.telemetry().flight_mode == "RTL"
        uav.recover_from_manual(force=True)
        assert uav.state() is State.FLYING_AUTO
    finally:
        set_parameter(copter, "SIM_RC_FAIL", 0.0)
    flight.wait_for(lambda: not health(uav).failsafe, "the transmitter")
    uav.land()


def test_a_breached_fence_is_named(flight: Flight, uav: UAL, copter: CopterPilot) -> None:
    """UAL ends its go-to, but cannot stop before the fence. The failsafe that takes the flight then is named, too."""
    flight.take_off()
    for name, value in (("FENCE_TYPE", 2.0), ("FENCE_RADIUS", 46.0), ("FENCE_ACTION", 1.0), ("AVOID_ENABLE", 0.0)):
        set_parameter(copter, name, value)
    # A fence that is enabled is read, and the goal refused: so it is enabled on the way, too near to stop before it.
    start = uav.pose().pose.position
    task = uav.go_to_waypoint(flight.offset(100.0), blocking=False)
    flight.wait_for(lambda: (uav.pose().pose.position - start).norm() > 40.0, "being near the fence", 60.0)
    set_parameter(copter, "FENCE_ENABLE", 1.0)
    try:
        with pytest.raises(GeofenceError, match="this has changed in flight") as caught:
            task.wait(30.0)
        assert caught.value.metadata["parameter"] == "FENCE_RADIUS"
        flight.wait_for(lambda: health(uav).held_by == "fence", "the fence's failsafe", 5.0)
        assert uav.telemetry().flight_mode == "RTL"
        with pytest.raises(WrongStateError, match="fence"):
            uav.recover_from_manual()
        flight.wait_for(lambda: uav.telemetry().health is not None and not health(uav).failsafe, "being inside again")
        with pytest.raises(WrongStateError, match="fence has taken control"):
            uav.recover_from_manual()
    finally:
        set_parameter(copter, "FENCE_ENABLE", 0.0)
    uav.recover_from_manual(force=True)
    uav.land()


def test_no_take_off_while_the_transmitter_is_lost(flight: Flight, uav: UAL, copter: CopterPilot) -> None:
    """The recipe: with the transmitter off on the ground it took off without a safety pilot."""
    flight.pilot.wait_until_ready()
    set_parameter(copter, "ARMING_CHECK", 0.0)
    set_parameter(copter, "SIM_RC_FAIL", 1.0)  # armed already, it would disarm
    try:
        flight.wait_for(lambda: health(uav).failsafe == "rc failsafe", "its failsafe", 5.0)
        flight.pilot.arm()
        flight.wait_for_state(State.LANDED_ARMED)
        assert "rc receiver" in health(uav).failing_checks
        with pytest.raises(WrongStateError, match="rc failsafe is active") as caught:
            uav.take_off(HEIGHT_M)
        assert caught.value.metadata["by"] == "rc failsafe"
        set_parameter(copter, "SIM_RC_FAIL", 0.0)
        flight.wait_for(lambda: not health(uav).failsafe, "the transmitter", 5.0)
        uav.take_off(HEIGHT_M)
        uav.land()
    finally:
        set_parameter(copter, "SIM_RC_FAIL", 0.0)
        set_parameter(copter, "ARMING_CHECK", 1.0)


def test_the_switch_to_a_mode_of_the_autopilot_is_the_pilots_and_another_the_ground_stations(
    flight: Flight, uav: UAL, copter: CopterPilot
) -> None:
    flight.take_off()
    set_parameter(copter, "FLTMODE5", 17.0)  # BRAKE, by the pilot's switch
    try:
        task = uav.go_to_waypoint(flight.offset(30.0), blocking=False)
        flight.wait_for_speed(1.0)
        flight.pilot.take_over()
        with pytest.raises(TaskAbortedError) as caught:
            task.wait(PATIENCE_S)
        assert (caught.value.metadata["by"], caught.value.metadata["mode"]) == ("safety pilot", "BRAKE")
        flight.pilot.stand_by()
    finally:
        set_parameter(copter, "FLTMODE5", 5.0)
    flight.wait_for_state(State.FLYING_AUTO)
    task = uav.go_to_waypoint(flight.offset(-30.0), blocking=False)
    flight.wait_for_speed(1.0)
    copter.set_mode(17, 17)
    with pytest.raises(TaskAbortedError) as caught:
        task.wait(PATIENCE_S)
    assert caught.value.metadata["by"] == "ground station"
    uav.recover_from_manual()
    uav.land()
