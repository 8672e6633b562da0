"""Flights of the class interface with real autopilots in simulation. Minutes long, in real time: `pytest -m sitl`."""

from __future__ import annotations

import math
import time

import pytest

from tests.backend_of import backend_of
from tests.simulators.faults import GOOD, Faults
from tests.sitl.flights import HEIGHT_M, PATIENCE_S, Flight
from tests.sitl.simulators import Simulator
from tests.sitl.wiretap import Wiretap
from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError, UalError, WrongStateError
from ual.geometry import Pose, Twist, Vector3, wrap_angle
from ual.types import Limits, State
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(240)]

TAKEN_S = 0.5
"""By then the task must have ended, after the pilot flipped the switch."""
LOST_S = 2.0
"""Within this a silence is a lost link, and a link that is back shows how the UAV is."""
WATCHED_S = 2.0
"""Seconds of watching: only time shows that nothing is sent. PX4 would go back into OFFBOARD by itself within the first
second.
"""


def test_a_whole_flight(flight: Flight, simulator: Simulator) -> None:
    """Take-off, go-to with a turn, velocity with a turn, abort, landing."""
    uav = flight.uav
    assert uav.info().autopilot == simulator.autopilot
    flight.wait_for(lambda: uav.info().is_simulation, "its version")
    flight.wait_for(lambda: uav.info().limits.horizontal_speed_m_s > Limits().horizontal_speed_m_s, "its limits")
    ground = flight.position()

    flight.take_off()
    assert uav.state() is State.FLYING_AUTO
    assert flight.position().z - ground.z == pytest.approx(HEIGHT_M, abs=0.4)

    here = uav.pose().pose
    goal = Pose.at(here.position.x + 8.0, here.position.y + 6.0, here.position.z + 2.0, here.yaw_rad + math.pi / 2)
    uav.go_to_waypoint(goal)
    assert (flight.position() - goal.position).norm() < simulator.wanders_m
    assert abs(wrap_angle(uav.pose().pose.yaw_rad - goal.yaw_rad)) < 0.2

    velocity = Twist(Vector3(1.0, -0.5, 0.0), Vector3(0.0, 0.0, 0.3))
    seen: list[Twist] = []
    until_s = time.monotonic() + 6.0
    while time.monotonic() < until_s:
        uav.set_velocity(velocity)
        time.sleep(0.05)
        seen.append(uav.velocity().twist)
    steady = seen[len(seen) // 2 :]
    mean = sum((twist.linear for twist in steady), Vector3()) / len(steady)
    assert (mean - velocity.linear).norm() < simulator.estimate_m_s
    turning_rad_s = sum(twist.angular.z for twist in steady) / len(steady)
    assert turning_rad_s == pytest.approx(0.3, abs=0.05)

    uav.abort()
    flight.wait_for(lambda: uav.velocity().twist.linear.norm() < 0.5, "its stop", 5.0)
    uav.land()
    assert uav.state() in (State.LANDED_ARMED, State.LANDED_DISARMED)
    flight.wait_for_state(State.LANDED_DISARMED)


@pytest.mark.timeout(400)
def test_a_flight_over_a_bad_link_is_completed(flight: Flight, wiretap: Wiretap) -> None:
    uav = flight.uav
    wiretap.faults = Faults(loss=0.3, jitter_s=0.2, corruption=0.1)
    try:
        flight.be_armed()
        uav.take_off(HEIGHT_M)
        goal = flight.offset(8.0, 6.0)
        uav.go_to_waypoint(goal)
        assert (flight.position() - goal.position).norm() < 2.0
        uav.land()
        flight.wait_for_state(State.LANDED_DISARMED)
    finally:
        wiretap.faults = GOOD


def test_silence_is_a_lost_link_within_two_seconds_and_all_is_well_when_it_ends(
    flight: Flight, wiretap: Wiretap
) -> None:
    uav = flight.uav
    flight.take_off()
    task = uav.go_to_waypoint(flight.offset(30.0), blocking=False)
    flight.wait_for_speed(1.0)
    wiretap.faults = Faults(is_silent=True)
    began_s = time.monotonic()
    try:
        with pytest.raises(UalError):  # that it was aborted, or that the link was lost
            task.wait(PATIENCE_S)
        flight.wait_for_state(State.UNINITIALIZED)
        assert time.monotonic() - began_s < LOST_S
        with pytest.raises(LinkLostError):
            uav.set_velocity(Twist())
        time.sleep(WATCHED_S)  # meanwhile its failsafe sets in
    finally:
        wiretap.faults = GOOD
    flight.wait_for(lambda: uav.state() is not State.UNINITIALIZED, "a state", LOST_S)
    assert uav.state() in (State.FLYING_MANUAL, State.FLYING_AUTO)


@pytest.mark.timeout(900)
def test_the_pilot_takes_over_in_the_middle_of_a_go_to_twenty_times(
    flight: Flight, simulator: Simulator, wiretap: Wiretap
) -> None:
    """The task ends at once and says so; until control is recovered nothing more is sent that moves the UAV."""
    uav, pilot = flight.uav, flight.pilot
    flight.take_off()
    begin = flight.position()
    for number in range(20):
        side = -1.0 if number % 2 else 1.0
        task = uav.go_to_waypoint(Pose.at(begin.x + side * 10.0, begin.y, begin.z), blocking=False)
        flight.wait_for_speed(0.5 * (1 + number % 5))
        pilot.take_over()
        taken_s = time.monotonic()
        with pytest.raises(TaskAbortedError, match=f"the safety pilot took over .*{simulator.pilots_mode}"):
            task.wait(timeout_s=5.0)
        ended_s = time.monotonic()
        assert ended_s - taken_s < TAKEN_S
        assert uav.state() is State.FLYING_MANUAL
        with pytest.raises(WrongStateError):
            uav.set_velocity(Twist(Vector3(1.0, 0.0, 0.0)))
        time.sleep(WATCHED_S)
        assert uav.telemetry().flight_mode == simulator.pilots_mode
        sent = wiretap.setpoints(taken_s, ended_s), wiretap.setpoints(ended_s)
        orders = wiretap.orders(taken_s)
        recovering_s = time.monotonic()
        uav.recover_from_manual()
        recovered_s = time.monotonic()
        assert uav.state() is State.FLYING_AUTO
        print(
            f"{simulator.autopilot} take-over {number + 1}: task ended after {ended_s - taken_s:.3f} s, setpoints "
            f"before that {sent[0]}, after it {sent[1]}, orders {len(orders)}; "
            f"recovered in {recovered_s - recovering_s:.3f} s"
        )
        assert sent[1] == 0
        assert orders == []
        pilot.stand_by()
        assert uav.state() is State.FLYING_AUTO


def test_it_arms_and_disarms_where_that_is_allowed(flight: Flight) -> None:
    flight.pilot.wait_until_ready()
    flight.uav.arm()
    assert flight.uav.state() is State.LANDED_ARMED
    flight.uav.disarm()
    assert flight.uav.state() is State.LANDED_DISARMED


def test_disarming_in_the_air_is_refused_by_the_autopilot(flight: Flight, uav: UAL, simulator: Simulator) -> None:
    flight.take_off()
    error = backend_of(uav).disarm().exception(10.0)
    assert isinstance(error, RejectedByAutopilotError)
    assert simulator.disarm_refusal in str(error)
    assert uav.state() is State.FLYING_AUTO


def test_a_daemon_that_ends_in_the_air_leaves_the_autopilot_holding_and_the_next_takes_over(
    flight: Flight, uav: UAL, wiretap: Wiretap, simulator: Simulator
) -> None:
    flight.take_off()
    uav.close()
    with UAL("mavlink", "uav_1", url=wiretap.url) as second:
        flight.uav = second
        assert flight.wait_for(second.is_ready, "a state") < 3.0
        assert second.state() is State.FLYING_MANUAL
        assert second.telemetry().flight_mode == simulator.own_hold
        second.recover_from_manual()
        second.go_to_waypoint(flight.offset(3.0))
        assert second.state() is State.FLYING_AUTO
        flight.end()
