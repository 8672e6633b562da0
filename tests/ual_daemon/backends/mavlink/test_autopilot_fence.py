"""The autopilots' own fences, with simulated autopilots: nothing is flown into them, and a breach is named."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from tests.conftest import LIMIT_S
from tests.simulators import ArduPilot
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import HEIGHT_M, Flight
from ual.errors import GeofenceError, TaskAbortedError
from ual.geometry import Pose, Twist, Vector3
from ual.types import State

RADIUS_M, HIGHEST_M = 30.0, 20.0
NAMES = {"px4": ("GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"), "ardupilot": ("FENCE_RADIUS", "FENCE_ALT_MAX")}


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    flight = Flight(str(request.param))
    radius, highest = NAMES[request.param]
    flight.autopilot.parameters[radius] = RADIUS_M
    flight.autopilot.parameters[highest] = HIGHEST_M
    if "FENCE_ENABLE" in flight.autopilot.parameters:
        flight.autopilot.parameters["FENCE_ENABLE"] = 1
    flight.kill()
    flight.start()  # a new daemon, which has read no parameter yet
    flight.wait_for(lambda: flight.backend.snapshot().own_fence is not None, "its fence")
    yield flight
    flight.uav.close()


def names(flight: Flight) -> tuple[str, str]:
    return NAMES["ardupilot" if isinstance(flight.autopilot, ArduPilot) else "px4"]


def from_home_m(flight: Flight) -> float:
    home, position = flight.autopilot.home, flight.autopilot.body.position
    assert home is not None
    return math.dist(home[:2], position[:2])


def test_goals_paths_and_take_offs_beyond_it_are_refused_with_the_parameters_name(flight: Flight) -> None:
    uav, (radius, highest) = flight.uav, names(flight)
    flight.wait_for_state(State.LANDED_DISARMED)
    assert flight.autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    flight.wait_for(lambda: flight.backend.snapshot().home is not None, "its home")
    with pytest.raises(GeofenceError, match=f"own fence \\({highest}: 20 m"):
        uav.take_off(25.0)
    uav.take_off(HEIGHT_M)
    with pytest.raises(GeofenceError, match=f"from its home, beyond the autopilot's own fence \\({radius}: 30 m") as e:
        uav.go_to_waypoint(flight.goal(60.0, 0.0))
    assert e.value.metadata["parameter"] == radius
    with pytest.raises(GeofenceError, match=highest):
        uav.go_to_waypoint(Pose.at(1.0, 1.0, 25.0))
    with pytest.raises(GeofenceError, match=radius):
        uav.follow_path([flight.goal(5.0, 0.0), flight.goal(35.0, 0.0), flight.goal(5.0, 5.0)])
    with pytest.raises(GeofenceError, match=radius):
        uav.set_pose(flight.goal(60.0, 0.0))
    flight.let_pass(1.0)
    assert from_home_m(flight) < 1.0
    uav.go_to_waypoint(flight.goal(25.0, 0.0))
    assert uav.state() is State.FLYING_AUTO
    assert from_home_m(flight) == pytest.approx(25.0, abs=0.5)
    flight.land()


def test_a_velocity_towards_it_stops_inside(flight: Flight) -> None:
    flight.take_off()
    uav, was_refused = flight.uav, False
    until_s = flight.now_s + 25.0
    while flight.now_s < until_s and not was_refused:
        try:
            uav.set_velocity(Twist(Vector3(4.0, 0.0, 0.0)))
        except GeofenceError as error:
            was_refused = names(flight)[0] in str(error)
        flight.let_pass(0.05)
    flight.let_pass(4.0)
    assert was_refused
    assert uav.state() is State.FLYING_AUTO
    assert 20.0 < from_home_m(flight) < RADIUS_M
    flight.land()


def test_a_breach_all_the_same_is_named_by_the_task(flight: Flight) -> None:
    if not isinstance(flight.autopilot, ArduPilot):
        pytest.skip("the simulated PX4 does not apply its fence")
    flight.take_off()
    flight.uav.go_to_waypoint(flight.goal(25.0, 0.0))
    task = flight.uav.go_to_waypoint(flight.goal(0.0, 15.0 - 4.0), blocking=False)
    with flight.autopilot.lock:  # wind, or a fence that was made smaller
        flight.autopilot.parameters["FENCE_RADIUS"] = 25.0
        flight.autopilot.channels[0].send(flight.autopilot._parameter("FENCE_RADIUS"), flight.now_s)
    with pytest.raises(TaskAbortedError, match=r"beyond the autopilot's own fence \(FENCE_RADIUS: 25 m\)") as caught:
        task.wait(LIMIT_S)
    assert caught.value.metadata["by"] == "fence"
