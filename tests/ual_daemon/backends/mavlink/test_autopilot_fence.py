"""The autopilots' own fences, with simulated autopilots: nothing is flown into them, and a breach is named."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from concurrent.futures import Future

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.conftest import LIMIT_S
from tests.simulators import ArduPilot, Faults
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import HEIGHT_M, Flight
from ual import interface
from ual.errors import GeofenceError, TaskAbortedError, UalTimeoutError
from ual.geometry import Pose, Twist, Vector3
from ual.types import State
from ual_daemon.backends.values import Zone

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
    flight.wait_for(lambda: flight.backend.snapshot().autopilot_fence is not None, "its fence")
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
    flight.wait_for(lambda: flight.backend.snapshot().earth.home is not None, "its home")
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


# --- Polygons and circles ---------------------------------------------------------------------------------------------

BUILDING = (False, [(10.0, -5.0), (10.0, 5.0), (20.0, 5.0), (20.0, -5.0)], None)
FIELD = (True, [(-40.0, -40.0), (60.0, -40.0), (60.0, 40.0), (-40.0, 40.0)], None)
POND = (False, [(0.0, 30.0)], 8.0)
"""In metres north and east of the origin of the local frame, above which it is armed."""


@pytest.fixture(params=["px4", "ardupilot"])
def zoned(request: pytest.FixtureRequest) -> Iterator[Flight]:
    """A flight of an autopilot with a field, a building and a pond, of which the daemon knows."""
    flight = Flight(str(request.param))
    if "FENCE_ENABLE" in flight.autopilot.parameters:
        flight.autopilot.parameters.update({"FENCE_ENABLE": 1, "FENCE_TYPE": 4})
    flight.autopilot.set_fence(FIELD, BUILDING, POND)
    flight.kill()
    flight.start()
    flight.wait_for(lambda: len(zones(flight)) == 3, "its zones")
    yield flight
    flight.uav.close()


def zones(flight: Flight) -> tuple[Zone, ...]:
    own = flight.backend.snapshot().autopilot_fence
    return () if own is None else own.zones


def closest_m(flight: Flight, north_m: float, east_m: float) -> float:
    """Returns the least distance to a place, by its telemetry."""
    flown = [telemetry.pose for _, telemetry in flight.seen if telemetry.state is State.FLYING_AUTO]
    return min(math.dist((pose.position.x, pose.position.y), (east_m, north_m)) for pose in flown if pose is not None)


def test_zones_are_read_and_nothing_leads_into_them(zoned: Flight) -> None:
    flight, uav = zoned, zoned.uav
    assert [zone.name for zone in zones(flight)] == [
        "inclusion polygon 1 of 1",
        "exclusion polygon 1 of 1",
        "exclusion circle 1 of 1",
    ]
    flight.take_off()
    building = r"beyond the autopilot's own fence \(exclusion polygon 1 of 1; UAL stays 1 m inside\)"
    with pytest.raises(GeofenceError, match=f"is {building}") as caught:
        uav.go_to_waypoint(Pose.at(0.0, 15.0, HEIGHT_M))
    assert caught.value.metadata["zone"] == "exclusion polygon 1 of 1"
    with pytest.raises(GeofenceError, match=f"the way to .* leads {building}"):
        uav.go_to_waypoint(Pose.at(0.0, 30.0, HEIGHT_M))
    with pytest.raises(GeofenceError, match=building):
        uav.follow_path([Pose.at(0.0, 5.0, HEIGHT_M), Pose.at(0.0, 25.0, HEIGHT_M)])
    with pytest.raises(GeofenceError, match="exclusion circle 1 of 1"):
        uav.go_to_waypoint(Pose.at(30.0, 0.0, HEIGHT_M))
    with pytest.raises(GeofenceError, match="inclusion polygon 1 of 1"):
        uav.go_to_waypoint(Pose.at(-60.0, 0.0, HEIGHT_M))
    with pytest.raises(GeofenceError, match=building):
        uav.set_pose(Pose.at(0.0, 15.0, HEIGHT_M))
    uav.follow_path([Pose.at(7.5, 10.0, HEIGHT_M), Pose.at(7.5, 22.0, HEIGHT_M), Pose.at(0.0, 25.0, HEIGHT_M)])
    assert uav.state() is State.FLYING_AUTO
    north, east, _ = flight.autopilot.body.position
    assert (north, east) == pytest.approx((25.0, 0.0), abs=0.6)
    assert closest_m(flight, 15.0, 0.0) > 6.0


def test_a_velocity_towards_a_zone_stops_before_it(zoned: Flight) -> None:
    flight, uav, was_refused = zoned, zoned.uav, False
    flight.take_off()
    until_s = flight.now_s + 25.0
    while flight.now_s < until_s and not was_refused:
        try:
            uav.set_velocity(Twist(Vector3(0.0, 3.0, 0.0)))
        except GeofenceError as error:
            was_refused = "exclusion polygon" in str(error)
        flight.let_pass(0.05)
    flight.let_pass(4.0)
    assert was_refused
    assert uav.state() is State.FLYING_AUTO
    assert 5.0 < flight.autopilot.body.position[0] < 9.6
    flight.land()


def test_a_zone_that_comes_into_the_path_stops_the_flight(zoned: Flight) -> None:
    flight = zoned
    task = beyond_a_new_zone(flight)
    with pytest.raises(GeofenceError, match=r"the way to .* leads beyond the autopilot's own fence"):
        task.wait(LIMIT_S)
    assert flight.uav.state() is State.FLYING_AUTO


def beyond_a_new_zone(flight: Flight) -> interface.Task:
    """The autopilot gets a zone in the way of a flight. It tells so, and is asked for its zones."""
    flight.take_off()
    flight.when(
        lambda told: told.pose is not None and told.pose.position.x < -0.3,
        lambda: flight.autopilot.set_fence(FIELD, (False, [(0.0, -8.0)], 4.0), POND),
    )
    return flight.uav.go_to_waypoint(Pose.at(-30.0, 0.0, HEIGHT_M), blocking=False)


def test_a_breach_of_a_zone_all_the_same_is_named_by_the_task(zoned: Flight) -> None:
    flight = zoned
    if isinstance(flight.autopilot, ArduPilot):
        pytest.skip("it would drop the positions beyond it")
    flight.autopilot.missions.refusal = mavlink.MAV_MISSION_DENIED
    task = beyond_a_new_zone(flight)
    with pytest.raises(TaskAbortedError) as caught:
        task.wait(LIMIT_S)
    assert caught.value.metadata["by"] == "fence"


def test_a_uav_inside_a_zone_may_come_out_and_land(zoned: Flight) -> None:
    flight, uav = zoned, zoned.uav
    flight.take_off()
    with flight.autopilot.lock:  # the pilot's flight, with the fence switched off meanwhile
        flight.autopilot.missions.refusal = mavlink.MAV_MISSION_DENIED
        flight.autopilot.fence.items = []
        flight.autopilot.body.position = (12.0, 0.0, flight.autopilot.body.position[2])
    flight.let_pass(1.0)
    with pytest.raises(GeofenceError, match="exclusion polygon"):
        uav.go_to_waypoint(Pose.at(0.0, 15.0, HEIGHT_M))
    uav.go_to_waypoint(Pose.at(0.0, 5.0, HEIGHT_M))
    assert flight.autopilot.body.position[0] == pytest.approx(5.0, abs=0.6)
    flight.land()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_zones_come_over_a_bad_link(kind: str, seed: int) -> None:
    flight = Flight(kind, seed)
    if "FENCE_ENABLE" in flight.autopilot.parameters:
        flight.autopilot.parameters["FENCE_ENABLE"] = 1
    flight.autopilot.set_fence(FIELD, BUILDING, POND)
    flight.kill()
    flight.link.down = flight.link.up = Faults(loss=0.3, jitter_s=0.1, duplication=0.2)
    flight.start()
    flight.wait_for(lambda: len(zones(flight)) == 3, "its zones")
    assert flight.now_s - flight.started_s < 60.0
    flight.uav.close()


def test_a_fence_that_is_changed_while_disarmed_is_read_again(zoned: Flight) -> None:
    flight = zoned
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.autopilot.set_fence(POND)
    changed_s = flight.now_s
    flight.wait_for(lambda: len(zones(flight)) == 1, "the new fence")
    assert flight.now_s - changed_s < 2.0


def test_a_fence_that_is_changed_in_flight_is_read_again(zoned: Flight) -> None:
    flight = zoned
    flight.take_off()
    moved = (False, [(north, east + 20.0) for north, east in BUILDING[1]], None)
    flight.autopilot.set_fence(FIELD, moved, POND)  # with as many items as before
    flight.let_pass(2.0)
    with pytest.raises(GeofenceError, match="exclusion polygon"):
        flight.uav.go_to_waypoint(Pose.at(20.0, 15.0, HEIGHT_M))
    flight.uav.go_to_waypoint(Pose.at(0.0, 15.0, HEIGHT_M))


def test_a_fence_is_read_again_when_it_is_armed_and_after_a_boot(zoned: Flight) -> None:
    flight, fence = zoned, zoned.autopilot.missions
    flight.wait_for_state(State.LANDED_DISARMED)
    before = fence.downloads_count
    assert flight.autopilot.pilot_arm()
    flight.wait_for(lambda: fence.downloads_count > before, "another download")
    assert flight.autopilot.pilot_disarm()
    flight.autopilot.reboot()
    before = fence.downloads_count
    flight.wait_for(lambda: fence.downloads_count > before, "a download after the boot")


def test_zones_that_cannot_be_read_stay_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    flight = Flight("ardupilot")
    flight.autopilot.parameters["FENCE_ENABLE"] = 1
    flight.autopilot.set_fence(FIELD, BUILDING, POND)
    flight.autopilot.missions.refusal = mavlink.MAV_MISSION_UNSUPPORTED
    flight.kill()
    with caplog.at_level(logging.INFO):
        flight.start()
        flight.wait_for(lambda: flight.backend.snapshot().autopilot_fence is not None, "its fence")
        flight.let_pass(3.0)
    own = flight.backend.snapshot().autopilot_fence
    assert own is not None
    assert own.zones == ()
    assert own.unread == "its polygons and circles (FENCE_TOTAL 11)"
    assert own.is_cut_by_unread
    assert [each.levelno for each in caplog.records if vars(each).get("ual_event") == "autopilot_fence"][
        -1
    ] == logging.WARNING
    flight.autopilot.missions.refusal = None
    flight.wait_for(lambda: len(zones(flight)) == 3, "the zones after all")
    flight.uav.close()


def test_a_breach_all_the_same_is_named_by_the_task(flight: Flight) -> None:
    if not isinstance(flight.autopilot, ArduPilot):
        pytest.skip("the simulated PX4 does not apply its distances")
    flight.take_off()
    flight.uav.go_to_waypoint(flight.goal(25.0, 0.0))
    task = flight.uav.go_to_waypoint(flight.goal(0.0, 15.0 - 4.0), blocking=False)
    with flight.autopilot.lock:  # wind, or a fence that was made smaller without a word
        flight.autopilot.parameters["FENCE_RADIUS"] = 25.0
    with pytest.raises(TaskAbortedError) as caught:
        task.wait(LIMIT_S)
    assert caught.value.metadata["by"] == "fence"


def test_a_smaller_fence_that_is_reported_ends_the_task_before_the_breach(flight: Flight) -> None:
    if not isinstance(flight.autopilot, ArduPilot):
        pytest.skip("the simulated PX4 does not apply its distances")
    flight.take_off()
    flight.uav.go_to_waypoint(flight.goal(20.0, 0.0))
    task = flight.uav.go_to_waypoint(flight.goal(0.0, 18.0), blocking=False)
    with flight.autopilot.lock:
        flight.autopilot.parameters["FENCE_RADIUS"] = 25.0
        flight.autopilot.channels[0].send(flight.autopilot._parameter("FENCE_RADIUS"), flight.now_s)
    with pytest.raises(GeofenceError, match=r"beyond the autopilot's own fence \(FENCE_RADIUS: 25 m"):
        task.wait(LIMIT_S)
    assert flight.uav.state() is State.FLYING_AUTO


def taken_back_from_its_return(flight: Flight, new_fence: tuple[bool, list[tuple[float, float]], float | None]) -> None:
    """Sets a fence that it breaches by where it is, and takes it back with force in the update that shows its return.

    A test that only looked at times would be late on a busy computer: it would have come home.
    """
    taken: list[Future[None]] = []

    def take_back() -> None:
        taken.append(flight.uav.vehicle.commands.recover_from_manual(force=True).begin())

    flight.when(lambda telemetry: telemetry.flight_mode == "RTL", take_back)
    flight.autopilot.set_fence(new_fence)
    flight.wait_for(lambda: bool(taken), "its return")
    taken[0].result(LIMIT_S)


def beyond_its_new_fence(flight: Flight) -> Vector3:
    """Flies out by 30 m, gets a smaller fence around where it began, and is taken back with force, some way outside.
    Returns where it began.
    """
    flight.take_off()
    begin = flight.uav.pose().pose.position
    flight.uav.go_to_waypoint(Pose.at(begin.x + 30.0, begin.y, begin.z))
    taken_back_from_its_return(flight, (True, [(begin.y, begin.x)], SMALL_M))
    assert from_m(flight, begin) > SMALL_M + 3.0  # farther than a reference leads a UAV that does not follow
    return begin


def from_m(flight: Flight, place: Vector3) -> float:
    north, east, _ = flight.autopilot.body.position
    return math.dist((north, east), (place.y, place.x))


SMALL_M = 6.0


@pytest.fixture
def copter() -> Iterator[Flight]:
    flight = Flight("ardupilot")
    flight.autopilot.parameters.update({"FENCE_ENABLE": 1, "FENCE_TYPE": 4})
    flight.autopilot.set_fence((True, [(0.0, 0.0)], 60.0))
    flight.kill()
    flight.start()
    flight.wait_for(lambda: len(zones(flight)) == 1, "its zone")
    yield flight
    flight.uav.close()


def test_a_go_to_leads_back_into_a_fence_that_drops_positions_beyond_it(copter: Flight) -> None:
    """It hung without a word: each reference on the way lay outside, until the UAV would have come in."""
    begin = beyond_its_new_fence(copter)
    held = copter.uav.pose().pose.position
    copter.let_pass(3.0)
    assert (copter.uav.pose().pose.position - held).norm() < 1.5  # it holds, by velocities
    goal = Pose.at(begin.x + 4.0, begin.y, begin.z + 2.0)
    copter.uav.go_to_waypoint(goal)
    assert copter.uav.state() is State.FLYING_AUTO
    copter.let_pass(2.0)
    assert (copter.uav.pose().pose.position - goal.position).norm() < 0.3


def test_the_return_path_begins_beyond_a_fence_that_drops_positions_there(copter: Flight) -> None:
    begin = beyond_its_new_fence(copter)
    copter.uav.return_to_launch()
    assert from_m(copter, begin) < 0.6


def test_a_go_to_out_of_a_zone_that_could_not_be_read_ends_within_10_s_with_its_reason() -> None:
    """ArduPilot drops its references without a word, and UAL does not know why."""
    flight = Flight("ardupilot")
    flight.autopilot.parameters.update({"FENCE_ENABLE": 1, "FENCE_TYPE": 4})
    flight.autopilot.missions.refusal = mavlink.MAV_MISSION_UNSUPPORTED
    flight.take_off()
    flight.uav.go_to_waypoint(Pose.at(0.0, 30.0, HEIGHT_M))  # over home the return would land at once
    taken_back_from_its_return(flight, (False, [(0.0, 0.0)], 60.0))
    began_s = flight.now_s
    with pytest.raises(UalTimeoutError, match=r"has made no way for 8 s: \d+\.\d+ m .* off") as caught:
        flight.uav.go_to_waypoint(Pose.at(0.0, 80.0, HEIGHT_M))
    assert flight.now_s - began_s < 12.0  # ArduPilot first coasts on
    assert caught.value.metadata["by"] == "no way"
    assert flight.uav.state() is State.FLYING_AUTO
    flight.land()
    flight.uav.close()
