"""Simulated autopilots that others fly, too: a ground station, a second daemon, the safety pilot on the ground."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.conftest import LIMIT_S
from tests.simulators import ArduPilot, Px4, px4
from tests.simulators.ardupilot import GUIDED, RTL, STABILIZE
from tests.simulators.autopilot import Sticks
from tests.simulators.codec import AutopilotCodec
from tests.simulators.faults import GOOD
from tests.simulators.px4 import ALTCTL
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import HEIGHT_M, SILENT, Flight, px4_of
from tests.waiting import until
from ual.errors import TaskAbortedError, WrongStateError
from ual.types import State
from ual_daemon.flight.policy.authority import LONGEST_LINK_GAP_S

OURS, GROUND_STATION = (1, 191), (255, 190)
POSITION_ONLY = 0b110111111000


class GroundStation:
    """Another program on the link: a ground station, or a companion's script."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._codec = AutopilotCodec(GROUND_STATION[1])
        self._codec.join(GROUND_STATION[0])

    def send(self, message: object) -> None:
        """Sends a message to the autopilot."""
        with self._flight.autopilot.lock:
            self._flight.port.arriving.append(self._codec.encode(message))

    def go(self, north: float, east: float, down: float) -> None:
        """Sends one position target."""
        self.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, POSITION_ONLY, north, east, down, 0, 0, 0, 0, 0, 0, 0, 0
            )
        )

    def stream(self, north: float, east: float, down: float, duration_s: float) -> None:
        """Sends position targets, 20 a second."""
        for _ in range(round(duration_s * 20.0)):
            self.go(north, east, down)
            self._flight.let_pass(0.05)


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    flight = Flight(str(request.param))
    yield flight
    flight.uav.close()


def ours(flight: Flight) -> int:
    return flight.autopilot.setpoint_senders.count(OURS)


def test_a_daemon_that_starts_and_ends_in_a_ground_stations_flight_does_not_touch_it(flight: Flight) -> None:
    flight.take_off()
    station = GroundStation(flight)
    down = flight.autopilot.position[2]
    station.stream(0.0, 0.0, down, 1.0)
    flight.kill()
    flight.start()
    flight.autopilot.setpoint_senders.clear()
    # PX4 flies on for a second without targets: the station does not stop while the daemon gets to know the UAV.
    until(lambda: flight.uav.state() is State.FLYING_AUTO, between=lambda: station.stream(0.0, 0.0, down, 0.05))
    station.stream(15.0, 0.0, down, 8.0)
    assert ours(flight) == 0
    assert abs(flight.autopilot.position[0] - 15.0) < 1.0
    reason = flight.uav.telemetry().state_reason
    assert "UAL has not been commanded in this flight since it was started, and sends nothing" in reason
    assert "another program sends setpoints" in reason
    assert flight.commands_since(flight.started_s) == set()
    left_s = flight.now_s
    flight.uav.close()  # ends the clock, too
    assert ours(flight) == 0
    assert flight.commands_since(left_s) == set()


def test_the_first_command_takes_the_flight(flight: Flight) -> None:
    flight.take_off()
    station = GroundStation(flight)
    down = flight.autopilot.position[2]
    flight.kill()
    flight.start()
    flight.wait_for_state(State.FLYING_AUTO)
    station.stream(0.0, 0.0, down, 1.0)
    flight.autopilot.setpoint_senders.clear()
    flight.uav.abort()
    flight.let_pass(1.0)
    assert ours(flight) >= 0.8 * flight.pose_rate_hz
    assert "sends nothing" not in flight.uav.telemetry().state_reason
    flight.uav.go_to_waypoint(flight.goal(2.0, 0.0))
    flight.land()


def test_another_sender_next_to_ours_is_noticed_and_named() -> None:
    flight = Flight("ardupilot")
    try:
        flight.take_off()
        flight.let_pass(5.0)  # holds, and sends
        down = flight.autopilot.position[2]
        assert "another program" not in flight.uav.telemetry().state_reason
        station = GroundStation(flight)
        until_s = flight.now_s + 30.0
        while "another program sends setpoints" not in flight.uav.telemetry().state_reason:
            assert flight.now_s < until_s
            station.stream(20.0, 20.0, down, 0.5)
        flight.let_pass(8.0)
        assert "another program" not in flight.uav.telemetry().state_reason
        flight.land()
    finally:
        flight.uav.close()


def test_our_own_flight_is_never_taken_for_anothers(flight: Flight, caplog: pytest.LogCaptureFixture) -> None:
    flight.take_off()
    for x, y in ((12.0, 0.0), (0.0, -9.0), (-12.0, 9.0)):
        flight.uav.go_to_waypoint(flight.goal(x, y))
        flight.let_pass(3.0)
    flight.uav.go_to_waypoint(flight.goal(30.0, 0.0), blocking=False)
    flight.let_pass(4.0)
    flight.uav.abort()
    flight.let_pass(6.0)
    flight.land()
    assert "another_sender" not in caplog.text


def test_a_px4_that_a_pilot_flies_is_not_taken_for_anothers() -> None:
    flight = Flight("px4")
    try:
        flight.take_off()
        px4_of(flight).pilot_take_over()
        flight.let_pass(6.0)
        assert "another program" not in flight.uav.telemetry().state_reason
        assert abs(-px4_of(flight).position[2] + px4_of(flight).body.ground_z_m - HEIGHT_M) < 1.0
    finally:
        flight.uav.close()


def test_a_looping_take_off_does_not_lift_what_the_pilot_has_landed_by_hand(flight: Flight) -> None:
    """The recipe: PX4 was touched down by hand, and 0.1 s later a client's `take_off` made it climb again."""
    autopilot, uav = flight.autopilot, flight.uav
    flight.take_off()
    with autopilot.lock:
        autopilot.pilot_take_over()
    flight.wait_for_state(State.FLYING_MANUAL)
    autopilot.pilot_moves(Sticks(up=-0.4))
    attempts = 0
    while uav.state() is not State.LANDED_DISARMED and attempts < 2000:
        with pytest.raises(WrongStateError):
            uav.take_off(HEIGHT_M)
        attempts += uav.state() is State.LANDED_ARMED
        if attempts == 10 and isinstance(autopilot, ArduPilot):
            autopilot.pilot_disarm()  # PX4 does so by itself
        flight.let_pass(0.05)
    assert attempts >= 10
    assert autopilot.body.is_on_ground
    flight.take_off()
    flight.land()


def land_by_hand(flight: Flight) -> None:
    """The pilot takes over and lands. PX4 does not disarm by itself for a minute."""
    autopilot = flight.autopilot
    autopilot.parameters["COM_DISARM_LAND"] = 60.0
    with autopilot.lock:
        if isinstance(autopilot, ArduPilot):
            autopilot.set_mode(STABILIZE)
        else:
            px4_of(flight).request_mode(ALTCTL)

    def is_down() -> bool:
        autopilot.pilot_moves(Sticks(up=-0.7))
        return bool(autopilot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND)

    flight.wait_for(is_down, "on the ground")
    autopilot.pilot_moves(Sticks())


def test_a_landing_by_hand_without_gps_leaves_the_ground_to_the_pilot(flight: Flight) -> None:
    flight.take_off()
    with flight.autopilot.lock:
        flight.autopilot.lose_gps()
    flight.wait_for_state(State.UNINITIALIZED)
    land_by_hand(flight)
    with flight.autopilot.lock:
        flight.autopilot.find_gps()
    flight.wait_for_state(State.LANDED_ARMED)
    with pytest.raises(WrongStateError, match="others"):
        flight.uav.take_off(HEIGHT_M)


def test_a_landing_by_hand_that_nobody_listened_leaves_the_ground_to_the_pilot(flight: Flight) -> None:
    flight.take_off()
    flight.link.down = flight.link.up = SILENT
    land_by_hand(flight)
    flight.link.down = flight.link.up = GOOD
    flight.wait_for_state(State.LANDED_ARMED)
    with pytest.raises(WrongStateError, match="others"):
        flight.uav.take_off(HEIGHT_M)


def climb_unheard(flight: Flight) -> None:
    """A take-off of UAL is under way, 1.5 s after the link fell silent."""
    flight.wait_for_state(State.LANDED_DISARMED)
    assert flight.autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    flight.uav.take_off(8.0, blocking=False)
    flight.wait_for(lambda: -flight.autopilot.position[2] > 1.0, "climbing")
    flight.link.down = flight.link.up = SILENT
    flight.let_pass(1.5)


def test_a_climb_that_the_pilot_ended_while_nobody_listened_leaves_the_ground_to_the_pilot(flight: Flight) -> None:
    climb_unheard(flight)
    land_by_hand(flight)
    flight.link.down = flight.link.up = GOOD
    flight.wait_for_state(State.LANDED_ARMED)
    with pytest.raises(WrongStateError, match="others"):
        flight.uav.take_off(HEIGHT_M)


def test_a_climb_of_ual_that_goes_on_after_a_silence_was_taken_by_nobody() -> None:
    """ArduCopter's own take-off went on without UAL, and "others took it" was told at its end."""
    flight = Flight("ardupilot")
    try:
        climb_unheard(flight)
        flight.link.down = flight.link.up = GOOD
        flight.wait_for_state(State.FLYING_AUTO)
        reason = flight.uav.telemetry().state_reason
        assert reason.endswith(
            "it is not known who flies it (mode GUIDED): UAL sends nothing until it is commanded anew"
        )
        flight.uav.go_to_waypoint(flight.goal(2.0, 0.0))
    finally:
        flight.uav.close()


def test_after_a_long_silence_the_flight_may_be_anothers_and_nothing_is_sent(
    flight: Flight, caplog: pytest.LogCaptureFixture
) -> None:
    flight.take_off()
    flight.link.down = flight.link.up = SILENT
    flight.let_pass(LONGEST_LINK_GAP_S + 2.0)
    flight.autopilot.setpoint_senders.clear()
    flight.link.down = flight.link.up = GOOD
    flight.wait_for_state(*(state for state in State if state is not State.UNINITIALIZED))
    flight.let_pass(3.0)
    assert ours(flight) == 0
    assert "flight_given_up" in caplog.text
    if flight.uav.state() is State.FLYING_AUTO:  # PX4 has left OFFBOARD
        assert "nothing was heard for 1" in flight.uav.telemetry().state_reason


def test_after_a_long_go_to_the_flight_is_still_ours(flight: Flight) -> None:
    flight.take_off()
    task = flight.uav.go_to_waypoint(flight.goal(200.0, 0.0), blocking=False, max_speed_m_s=2.0)
    flight.let_pass(LONGEST_LINK_GAP_S + 2.0)
    task.cancel()
    flight.let_pass(2.0)
    flight.autopilot.setpoint_senders.clear()
    flight.let_pass(1.0)
    assert ours(flight) > 0


def test_recover_on_the_ground_allows_the_next_take_off(flight: Flight) -> None:
    autopilot, uav = flight.autopilot, flight.uav
    disarm_s = autopilot.parameters.get("COM_DISARM_LAND", 0.0)
    autopilot.parameters["COM_DISARM_LAND"] = 60.0
    flight.take_off()
    with autopilot.lock:
        autopilot.pilot_take_over()
    flight.wait_for_state(State.FLYING_MANUAL)
    autopilot.pilot_moves(Sticks(up=-0.4))
    flight.wait_for_state(State.LANDED_ARMED)
    autopilot.pilot_moves(Sticks())
    before_s = flight.now_s
    uav.recover_from_manual()
    assert flight.commands_since(before_s) == set()
    uav.take_off(HEIGHT_M)
    autopilot.parameters["COM_DISARM_LAND"] = disarm_s
    flight.land()


def trigger(flight: Flight, kind: str) -> None:
    autopilot = flight.autopilot
    assert isinstance(autopilot, (ArduPilot, Px4))
    autopilot.trigger_failsafe(kind)


BY = {"rc": "rc failsafe", "battery": "battery failsafe", "fence": "fence"}


@pytest.mark.parametrize("kind", BY)
def test_a_failsafe_that_ends_a_go_to_is_named_and_is_left_only_by_force(flight: Flight, kind: str) -> None:
    uav, by = flight.uav, BY[kind]
    flight.take_off()
    task = uav.go_to_waypoint(flight.goal(90.0, 0.0), blocking=False)
    flight.let_pass(12.0)  # so far that the way home takes longer than what follows, on a busy computer, too
    trigger(flight, kind)
    taken_s = flight.now_s
    with pytest.raises(TaskAbortedError, match=f"taken by the autopilot: {by}") as caught:
        task.wait(LIMIT_S)
    assert caught.value.metadata["by"] == by
    assert flight.now_s - taken_s < 1.0
    for _ in range(5):
        with pytest.raises(WrongStateError) as refused:
            uav.recover_from_manual()
        flight.let_pass(0.5)
    assert refused.value.metadata.get("by", by) == by
    assert flight.commands_since(taken_s) == set()
    flight.wait_for_state(State.FLYING_MANUAL, State.LANDING)
    assert by in uav.telemetry().state_reason
    if uav.state() is State.FLYING_MANUAL:
        uav.recover_from_manual(force=True)
        assert uav.state() is State.FLYING_AUTO


def test_no_take_off_after_the_transmitter_was_lost_on_the_ground(flight: Flight) -> None:
    """The recipe: with the transmitter off it took off without a safety pilot."""
    uav, autopilot = flight.uav, flight.autopilot
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.let_pass(1.0)  # the transmitter was there
    autopilot.failing_sensors = mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
    assert autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    flight.let_pass(1.0)
    with pytest.raises(WrongStateError, match="rc failsafe is active") as caught:
        uav.take_off(HEIGHT_M)
    assert (caught.value.metadata["by"], caught.value.metadata["needed"]) == ("rc failsafe", "force")
    health = uav.telemetry().health
    assert health is not None
    assert "rc receiver" in health.failing_checks
    autopilot.failing_sensors = 0
    flight.let_pass(1.0)
    uav.take_off(HEIGHT_M)
    flight.land()


@pytest.mark.parametrize("dead_s", [0.0, 1.8])
def test_after_setpoints_were_lost_control_comes_back_without_force(dead_s: float) -> None:
    flight = Flight("px4")
    try:
        flight.take_off()
        flight.kill()
        px4_of(flight).sticks_s = px4_of(flight).now_s + 1e6  # with a transmitter: POSCTL
        flight.autopilot.run(dead_s)
        flight.start()
        flight.wait_for_state(State.FLYING_MANUAL)
        flight.let_pass(1.0)
        health = flight.uav.telemetry().health
        assert health is not None
        assert health.held_by == "setpoint failsafe"
        flight.uav.recover_from_manual()
        assert flight.uav.state() is State.FLYING_AUTO
    finally:
        flight.uav.close()


def test_a_mode_of_the_autopilot_is_the_pilots_by_the_switch_and_else_the_ground_stations() -> None:
    flight = Flight("ardupilot")
    try:
        autopilot = flight.autopilot
        assert isinstance(autopilot, ArduPilot)
        flight.take_off()
        flight.let_pass(1.0)
        for by_switch, by in ((False, "ground station"), (True, "safety pilot")):
            task = flight.uav.go_to_waypoint(flight.goal(20.0, 0.0), blocking=False)
            flight.let_pass(2.0)
            with autopilot.lock:
                if by_switch:
                    autopilot.pilot_switches_to(RTL)
                else:
                    autopilot.set_mode(RTL)
            with pytest.raises(TaskAbortedError) as caught:
                task.wait(LIMIT_S)
            assert caught.value.metadata["by"] == by
            flight.uav.recover_from_manual()
    finally:
        flight.uav.close()


def test_a_ground_station_that_ends_a_landing_by_guided_is_reported_as_others_and_the_state_as_it_is() -> None:
    """It was told as FLYING_MANUAL with the advice to recover, which is refused, and as a flight without commands."""
    flight = Flight("ardupilot")
    try:
        autopilot, uav = flight.autopilot, flight.uav
        assert isinstance(autopilot, ArduPilot)
        flight.take_off()
        task = uav.land(blocking=False)
        flight.wait_for(lambda: uav.telemetry().flight_mode == "LAND", "its landing")
        flight.let_pass(1.0)
        with autopilot.lock:
            autopilot.set_mode(GUIDED)
        with pytest.raises(TaskAbortedError, match="a ground station took over") as caught:
            task.wait(LIMIT_S)
        assert caught.value.metadata["state"] == State.FLYING_AUTO.name
        assert "recover_from_manual" not in caught.value.message
        others = "; others took it (mode GUIDED): UAL sends nothing until it is commanded anew"
        flight.wait_for(lambda: uav.telemetry().state_reason.endswith(others), "that it is theirs")
        assert uav.state() is State.FLYING_AUTO
        uav.go_to_waypoint(flight.goal(2.0, 0.0))
    finally:
        flight.uav.close()


def test_a_ground_stations_return_that_lands_at_once_is_reported_as_a_landing() -> None:
    """Above its home, PX4's AUTO.RTL lands at once. The error advised to recover, which is refused in a landing."""
    flight = Flight("px4")
    try:
        flight.take_off()
        task = flight.uav.go_to_waypoint(flight.goal(20.0, 0.0), blocking=False, max_speed_m_s=0.2)
        flight.let_pass(1.0)
        with flight.autopilot.lock:
            assert px4_of(flight).request_mode(px4.RTL)
        with pytest.raises(TaskAbortedError, match="the ground station took over") as caught:
            task.wait(LIMIT_S)
        assert caught.value.metadata["state"] == State.LANDING.name
        assert "recover_from_manual" not in caught.value.message
        assert flight.uav.state() is State.LANDING
    finally:
        flight.uav.close()


def test_land_ends_a_failsafes_hold_or_return(flight: Flight) -> None:
    flight.take_off()
    flight.uav.go_to_waypoint(flight.goal(40.0, 0.0))  # far from home, where ArduPilot would land at once
    trigger(flight, "battery")
    flight.wait_for_state(State.FLYING_MANUAL)
    flight.autopilot.setpoint_senders.clear()
    flight.let_pass(1.0)
    flight.uav.land()
    assert flight.autopilot.body.is_on_ground
    assert flight.autopilot.setpoint_senders == []


@pytest.mark.parametrize("after_s", [0.05, 0.3])
def test_a_mode_that_is_selected_again_just_after_a_landing_out_of_it_is_a_take_over(after_s: float) -> None:
    """No step was made in the landing, as its cause was open: "accepted to land, but has not after 5 s"."""
    flight = Flight("px4")
    try:
        flight.take_off()
        autopilot = px4_of(flight)

        def hold() -> None:
            with autopilot.lock:
                assert autopilot.request_mode(px4.LOITER)

        hold()
        flight.wait_for_state(State.FLYING_MANUAL)
        flight.let_pass(1.0)
        taken_s: list[float] = []

        def hold_again() -> None:
            taken_s.append(flight.now_s + after_s)
            autopilot.at(after_s, hold)

        flight.when(lambda told: told.flight_mode == "AUTO.LAND", hold_again)
        task = flight.uav.land(blocking=False)
        with pytest.raises(TaskAbortedError, match="the ground station took over"):
            task.wait(LIMIT_S)
        assert flight.first_s(lambda told: told.task is None, taken_s[0]) - taken_s[0] < 1.0
    finally:
        flight.uav.close()
