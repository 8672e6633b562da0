"""What others do to simulated autopilots that UAL flies: the twins of `tests/sitl/test_others.py` and its failsafes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.conftest import LIMIT_S
from tests.ual_daemon.backends.mavlink.test_autopilot_authority import GroundStation
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import HEIGHT_M, Flight
from ual.errors import TaskAbortedError, WrongStateError
from ual.types import State
from ual_daemon.backends.mavlink.wire.messages import mavlink

OWN_HOLD = {"px4": (4.0, 3.0), "ardupilot": (17.0, 0.0)}
"""AUTO.LOITER and BRAKE, in the words of DO_SET_MODE."""
NOTICED_S = 0.1


@pytest.fixture(params=["px4", "ardupilot"])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def flight(kind: str) -> Iterator[Flight]:
    flight = Flight(kind)
    yield flight
    flight.uav.close()


def hold_by_station(flight: Flight, kind: str) -> None:
    """A ground station makes the autopilot hold by itself."""
    params = (float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), *OWN_HOLD[kind], 0.0, 0.0, 0.0, 0.0)
    command = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, *params)
    GroundStation(flight).send(command)
    flight.wait_for_state(State.FLYING_MANUAL)


def setpoints_since(flight: Flight, time_s: float) -> list[float]:
    return [each for each in list(flight.autopilot.setpoints_s) if each > time_s + NOTICED_S]


def held_by(flight: Flight) -> str:
    health = flight.uav.telemetry().health
    return "" if health is None else health.held_by


def test_a_ground_station_that_makes_it_hold_is_named_and_land_ends_the_flight(flight: Flight, kind: str) -> None:
    flight.take_off()
    task = flight.uav.go_to_waypoint(flight.goal(40.0, 0.0), blocking=False)
    flight.let_pass(3.0)
    hold_by_station(flight, kind)
    with pytest.raises(TaskAbortedError) as caught:
        task.wait(LIMIT_S)
    assert caught.value.metadata["by"] == "ground station"
    since_s = flight.now_s
    flight.let_pass(2.0)
    assert setpoints_since(flight, since_s) == []
    assert flight.uav.state() is State.FLYING_MANUAL
    flight.uav.land()  # out of the autopilot's own mode
    flight.wait_for_state(State.LANDED_DISARMED)


def test_return_to_launch_ends_a_flight_that_the_autopilot_holds_and_never_one_that_the_pilot_flies(
    flight: Flight, kind: str
) -> None:
    flight.take_off()
    home = flight.uav.pose().pose.position
    flight.uav.go_to_waypoint(flight.goal(8.0, 0.0))
    flight.autopilot.pilot_take_over()
    flight.wait_for_state(State.FLYING_MANUAL)
    mode = flight.uav.telemetry().flight_mode
    for command in (flight.uav.land, flight.uav.return_to_launch):
        with pytest.raises(WrongStateError, match="the safety pilot flies"):
            command()
    assert flight.uav.telemetry().flight_mode == mode
    flight.uav.recover_from_manual()
    hold_by_station(flight, kind)
    flight.uav.return_to_launch(height_m=HEIGHT_M + 1.0)
    assert (flight.uav.pose().pose.position - home).horizontal_norm() < 0.5
    flight.wait_for_state(State.LANDED_DISARMED)


def test_a_lost_position_ends_the_task_is_told_and_only_force_leaves_its_failsafe(flight: Flight) -> None:
    flight.take_off()
    task = flight.uav.go_to_waypoint(flight.goal(80.0, 0.0), max_speed_m_s=2.0, blocking=False)
    flight.let_pass(2.0)
    flight.autopilot.lose_gps()
    with pytest.raises(TaskAbortedError) as caught:
        task.wait(LIMIT_S)
    ended_s = flight.now_s
    assert caught.value.metadata["by"] in ("autopilot", "position failsafe")
    flight.wait_for(lambda: held_by(flight) == "position failsafe", "its failsafe")
    flight.autopilot.find_gps()
    flight.wait_for_state(State.FLYING_MANUAL, State.LANDING)
    with pytest.raises(WrongStateError, match=r"position failsafe|LANDING"):
        flight.uav.recover_from_manual()
    assert setpoints_since(flight, ended_s) == []
    assert flight.commands_since(ended_s) == set()
