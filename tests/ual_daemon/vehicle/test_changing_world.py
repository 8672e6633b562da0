"""A world that changes in flight: limits, fences, home and frames; what flies is fitted, stops before it, or ends."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.snapshots import changed
from tests.ual_daemon.stepped import STEP_S, UPDATE_S, Stepped, at, stepped
from tests.waiting import until
from ual.errors import GeofenceError, TaskAbortedError, UnknownFrameError
from ual.geometry import IDENTITY, Pose, Transform, Twist, TwistStamped, Vector3
from ual.types import GeoPoint, PathHeading, State, TaskInfo, TaskStatus
from ual_daemon.backends.values import AutopilotFence, FenceLimit, LandedState, Sample, Snapshot
from ual_daemon.settings import Tracker, VehicleSettings
from ual_daemon.vehicle import courses

FAST = {"horizontal_speed_m_s": 8.0, "vertical_speed_m_s": 3.0, "horizontal_acceleration_m_s2": 3.0}
SPEED_M_S = 8.0
SLOW_M_S = 1.5
EXCESS_M_S = 0.05


class World:
    """World of a light UAV that a test changes: its limits, its own fence and its home."""

    def __init__(self, uav: Stepped, monkeypatch: pytest.MonkeyPatch) -> None:
        self.uav = uav
        self._backend = uav.vehicle.backend
        self._info = self._backend.info()
        self._changes: dict[str, Any] = {}
        snapshot, step = self._backend.snapshot, uav.vehicle._flight.step
        monkeypatch.setattr(self._backend, "snapshot", lambda: self._changed(snapshot()))
        monkeypatch.setattr(uav.vehicle._flight, "step", lambda found: step(self._changed(found)))
        monkeypatch.setattr(self._backend, "info", lambda: self._info)

    def _changed(self, snapshot: Snapshot) -> Snapshot:
        return changed(snapshot, **self._changes)

    def limit(self, **limits: float) -> None:
        """The autopilot has other limits from now on."""
        self._info = replace(self._info, limits=replace(self._info.limits, **limits))

    def fence(self, radius_m: float | None = None, highest_m: float | None = None) -> None:
        """The autopilot has a fence of its own from now on, around where its local frame begins."""
        radius = None if radius_m is None else FenceLimit(radius_m, "GF_MAX_HOR_DIST")
        highest = None if highest_m is None else FenceLimit(highest_m, "GF_MAX_VER_DIST")
        self._changes["autopilot_fence"] = AutopilotFence(radius, highest)
        if "home_geo" not in self._changes:
            self.home(Vector3())

    def home(self, place: Vector3) -> None:
        """Its home is there from now on, in the local frame."""
        projection = self._backend.snapshot().earth.projection
        assert projection is not None
        geo = projection.to_geo(place)
        self._changes["home_geo"] = GeoPoint(geo.latitude_deg, geo.longitude_deg)
        self._changes["home_altitude_amsl_m"] = geo.altitude_amsl_m

    def say(self, **values: Any) -> None:
        """The autopilot says something else from now on."""
        now_s = self._backend.snapshot().time_s
        self._changes.update((name, Sample(value, now_s)) for name, value in values.items())

    @property
    def speed_m_s(self) -> float:
        return self.uav.speed


@pytest.fixture(params=[Tracker.REFERENCE, Tracker.PURSUIT], ids=["reference", "pursuit"])
def tracker(request: pytest.FixtureRequest) -> Tracker:
    found: Tracker = request.param
    return found


@pytest.fixture
def world(tracker: Tracker, monkeypatch: pytest.MonkeyPatch) -> Iterator[World]:
    with stepped(VehicleSettings(tracker=tracker), light=FAST) as uav:
        uav.fly()
        yield World(uav, monkeypatch)


def speeds_after(world: World, passed_s: float, duration_s: float) -> list[float]:
    """The speeds for some time, from so long after now."""
    if passed_s:
        world.uav.run(passed_s)
    found = []
    for _ in range(round(duration_s / STEP_S)):
        world.uav.run(STEP_S)
        found.append(world.speed_m_s)
    return found


BEGIN: dict[str, Callable[[Stepped], TaskInfo | Any]] = {
    "go_to_waypoint": lambda uav: uav.prepare.go_to_waypoint(at(150.0, 0.0, 3.0)).begin(),
    "follow_path": lambda uav: uav.prepare.follow_path(
        [at(70.0, 0.0, 3.0), at(75.0, 60.0, 3.0), at(150.0, 0.0, 3.0)], corner_radius_m=4.0
    ).begin(),
    "follow_path_with_speeds": lambda uav: uav.prepare.follow_path(
        [at(80.0, 0.0, 3.0), at(150.0, 0.0, 3.0)], leg_speeds_m_s=[7.0, 0.0]
    ).begin(),
    "return_to_launch": lambda uav: uav.prepare.return_to_launch(3.0).begin(),
    "moving goal": lambda uav: uav.prepare.go_to_waypoint(at(0.0, 0.0, 3.0, frame_id="boat")).begin(),
}


def begun(world: World, what: str) -> Any:
    uav = world.uav
    if what == "return_to_launch":
        uav.end(uav.prepare.go_to_waypoint(at(150.0, 0.0, 3.0)).begin().future)
    if what == "moving goal":
        for moved_m in (0.0, 0.01):
            transform = Transform(Vector3(150.0 + moved_m), IDENTITY, "uav_1/odom", "boat")
            uav.vehicle.frame_editor.add(transform)
            uav.run(0.1)
    task = BEGIN[what](uav)
    uav.until(lambda: uav.speed > 6.0)
    return task


@pytest.mark.parametrize("what", list(BEGIN))
def test_a_speed_limit_that_is_lowered_reaches_what_flies_and_it_gets_there(world: World, what: str) -> None:
    """ArduPilot flew at 9.4 m/s to the end, of 1.5 allowed."""
    task = begun(world, what)
    world.limit(horizontal_speed_m_s=SLOW_M_S)
    braking_s = SPEED_M_S / 3.0 + 2.5
    assert max(speeds_after(world, braking_s, 20.0)) < SLOW_M_S + EXCESS_M_S
    assert task.info().status is TaskStatus.RUNNING
    world.uav.end(task.future, 400.0)
    if what != "return_to_launch":
        assert world.uav.pose.position.x == pytest.approx(150.0, abs=0.3)


@pytest.mark.parametrize("what", ["go_to_waypoint", "follow_path", "return_to_launch"])
def test_a_speed_limit_that_is_raised_again_is_used(world: World, what: str) -> None:
    task = begun(world, what)
    world.limit(horizontal_speed_m_s=SLOW_M_S)
    world.uav.run(6.0)
    world.limit(horizontal_speed_m_s=SPEED_M_S)
    assert max(speeds_after(world, 0.0, 10.0)) > 6.0
    world.uav.end(task.future)


def test_no_step_is_sent_when_the_limits_change(world: World, tracker: Tracker) -> None:
    """Pursuit looks ahead by as much as the UAV flies within a second: less far, where it is to fly slower."""
    sent: list[Any] = []
    task = begun(world, "follow_path")
    world.uav.vehicle.observe_setpoints(sent.append)
    for speed_m_s in (4.0, 1.5, 8.0, 3.0):
        world.limit(horizontal_speed_m_s=speed_m_s)
        world.uav.run(2.0)
    steps = [(b.position - a.position).norm() for a, b in itertools.pairwise(sent)]
    assert max(steps) < (1.2 * SPEED_M_S * UPDATE_S if tracker is Tracker.REFERENCE else 2.0)
    world.uav.end(task.future, 400.0)


def test_a_velocity_is_scaled_down_at_once(world: World) -> None:
    sent: list[Any] = []
    world.uav.vehicle.commands.setpoints.set_velocity(TwistStamped(Twist(Vector3(3.0, 4.0)), "uav_1/odom"))
    world.uav.vehicle.observe_setpoints(sent.append)
    world.uav.run(0.1)
    world.limit(horizontal_speed_m_s=1.0)
    world.uav.run(0.1)
    assert sent[0].velocity.norm() == pytest.approx(5.0, abs=0.3)
    assert sent[-1].velocity.norm() == pytest.approx(1.0, abs=0.3)


def test_a_climb_of_a_take_off_is_slowed_down(monkeypatch: pytest.MonkeyPatch) -> None:
    with stepped(light=FAST) as uav:
        world = World(uav, monkeypatch)
        uav.arm()
        task = uav.prepare.take_off(30.0).begin()
        uav.until(lambda: uav.speed > 2.5)
        world.limit(climb_speed_m_s=0.5)
        assert max(speeds_after(world, 3.0, 5.0)) < 0.5 + EXCESS_M_S
        uav.end(task.future)
        assert uav.pose.position.z == pytest.approx(30.0, abs=1.5)


# --- A path on its way ------------------------------------------------------------------------------------------------


def path_of(count: int) -> list[Any]:
    return [at(3.0 * n, 4.0 * (n % 2), 3.0) for n in range(1, count + 1)]


def crossed(uav: Stepped, waypoints: list[Any]) -> float:
    """Returns the distance from the farthest of the waypoints that it has passed."""
    places = np.array([tuple(sample.pose.position) for sample in uav.samples if sample.pose is not None])
    return max(float(np.linalg.norm(places - tuple(each.pose.position), axis=1).min()) for each in waypoints)


@pytest.mark.parametrize("radius_m", [0.0, 0.8])
@pytest.mark.parametrize("heading", list(PathHeading))
def test_a_path_whose_limits_change_all_the_time_passes_each_of_its_waypoints(
    world: World, tracker: Tracker, radius_m: float, heading: PathHeading
) -> None:
    world.uav.keep_samples()
    waypoints, uav = path_of(8), world.uav
    period_s = 0.37 if tracker is Tracker.REFERENCE else 2.37  # pursuit first has to gain its point ahead
    interest = at(100.0, 100.0, 0.0) if heading is PathHeading.POINT_OF_INTEREST else None
    point = None if interest is None else courses_point(interest)
    task = uav.prepare.follow_path(
        waypoints, corner_radius_m=radius_m, heading=heading, point_of_interest=point
    ).begin()
    seen: list[int] = []
    for turn in range(400):
        world.limit(horizontal_speed_m_s=(8.0, 2.0, 5.0, 1.0)[turn % 4])
        uav.run(period_s)
        info = task.info()
        seen.append(info.waypoint_index or 0)
        if task.future.done():
            break
    task.future.result()
    assert seen[:-1] == sorted(seen[:-1])
    assert max(seen) == len(waypoints) - 1
    assert crossed(uav, waypoints) < radius_m + 0.7


def courses_point(pose: Any) -> Any:
    from ual.geometry import PointStamped

    return PointStamped(pose.pose.position, pose.frame_id)


def test_a_hold_lasts_as_long_as_requested_whatever_changes_meanwhile(world: World) -> None:
    uav = world.uav
    task = uav.prepare.follow_path([at(6.0, 0.0, 3.0), at(12.0, 0.0, 3.0)], holds_s=[20.0, 0.0]).begin()
    uav.until(lambda: uav.pose.position.x > 5.7)
    began_s = uav.vehicle.backend.clock.now_s()
    for speed_m_s in (2.0, 6.0, 3.0, 5.0, 4.0):
        world.limit(horizontal_speed_m_s=speed_m_s)
        uav.run(3.0)
    uav.until(lambda: uav.pose.position.x > 6.6)
    assert uav.vehicle.backend.clock.now_s() - began_s == pytest.approx(20.0, abs=4.0)
    uav.end(task.future)


def test_a_paused_task_stays_paused(world: World) -> None:
    task = begun(world, "go_to_waypoint")
    world.uav.vehicle.commands.pause()
    world.uav.run(6.0)
    held = world.uav.pose.position
    world.limit(horizontal_speed_m_s=SLOW_M_S)
    world.uav.run(5.0)
    assert (world.uav.pose.position - held).norm() < 0.3
    world.uav.vehicle.commands.resume()
    assert max(speeds_after(world, 0.0, 5.0)) == pytest.approx(SLOW_M_S, abs=0.1)
    world.uav.vehicle.commands.abort()
    with pytest.raises(TaskAbortedError):
        task.future.result()


def test_a_long_path_first_comes_to_rest_en_route_and_is_planned_next_to_the_updates(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    world.uav.keep_samples()
    monkeypatch.setattr(courses, "LONG_PATH_WAYPOINTS", 20)
    waypoints, uav = path_of(30), world.uav
    task = uav.prepare.follow_path(waypoints, corner_radius_m=0.5).begin()
    uav.run(6.0)
    index = task.info().waypoint_index
    world.limit(horizontal_speed_m_s=1.0)
    uav.until(lambda: uav.speed < 0.5, 20.0)

    def step() -> None:
        uav.run(STEP_S)
        time.sleep(0.001)  # lets the thread that plans run

    until(lambda: uav.speed >= 0.8, seen=lambda: uav.speed, between=step)
    assert (task.info().waypoint_index or 0) >= (index or 0)
    assert max(speeds_after(world, 1.0, 10.0)) < 1.0 + EXCESS_M_S
    uav.end(task.future, 1000.0)
    assert crossed(uav, waypoints) < 1.2


# --- The geofence -----------------------------------------------------------------------------------------------------

RADIUS_M = 40.0


def farthest_m(uav: Stepped) -> float:
    return max(math.hypot(s.pose.position.x, s.pose.position.y) for s in uav.samples if s.pose is not None)


@pytest.mark.parametrize("what", ["go_to_waypoint", "follow_path", "moving goal"])
def test_motors_that_are_stopped_in_the_air_are_not_reported_as_the_floor(world: World, what: str) -> None:
    """ArduPilot says that it stands before it says that it is not armed: its height was then that of the ground."""
    task = begun(world, what)
    world.say(landed=LandedState.ON_GROUND)
    world.uav.run(0.2)
    world.say(armed=False)
    world.uav.until(task.future.done)
    with pytest.raises(TaskAbortedError, match="the motors were disarmed"):
        task.future.result()


def test_a_stand_that_is_reported_for_a_moment_in_the_air_does_not_raise_the_floor(world: World) -> None:
    """Under velocities, poses and holds, that height was taken for the ground: what lay below was refused."""
    world.uav.run(1.0)
    ground_z_m = world.uav.vehicle._flight.geofence.ground.z_m
    world.say(landed=LandedState.ON_GROUND)
    world.uav.run(0.8)
    world.say(landed=LandedState.IN_AIR)
    world.uav.run(0.5)
    assert world.uav.pose.position.z > 2.0
    assert world.uav.vehicle._flight.geofence.ground.z_m == ground_z_m
    for _ in range(3):
        world.say(landed=LandedState.ON_GROUND)
        world.uav.run(0.5)
    assert world.uav.vehicle._flight.geofence.ground.z_m == pytest.approx(world.uav.pose.position.z, abs=0.1)


@pytest.mark.parametrize("what", ["go_to_waypoint", "follow_path", "moving goal"])
def test_a_fence_that_is_new_is_not_crossed(world: World, what: str) -> None:
    """PX4 was flown through a fence of 15 m, which was known for 1.2 s, to 25.7 m at 6 m/s."""
    world.uav.keep_samples()
    task = begun(world, what)
    world.fence(RADIUS_M)
    assert world.uav.pose.position.x < 20.0
    world.uav.until(task.future.done)
    with pytest.raises(GeofenceError, match=r"GF_MAX_HOR_DIST: 40 m") as caught:
        task.future.result()
    if what != "moving goal":
        assert "this has changed in flight: the UAV stops and holds its position" in str(caught.value)
        assert world.speed_m_s > 3.0  # at once, not at the edge
    world.uav.run(8.0)
    assert world.speed_m_s < 0.1
    assert world.uav.state is State.FLYING_AUTO
    assert farthest_m(world.uav) < RADIUS_M


def test_a_pose_that_is_approached_by_the_autopilot_is_stopped_before_a_new_fence(world: World) -> None:
    world.uav.keep_samples()
    world.uav.vehicle.commands.setpoints.set_pose(at(150.0, 0.0, 3.0))
    world.uav.until(lambda: world.speed_m_s > 5.0)
    world.fence(RADIUS_M)
    world.uav.run(10.0)
    assert world.speed_m_s < 0.1
    assert farthest_m(world.uav) < RADIUS_M
    assert "until it is commanded again" in world.uav.vehicle.telemetry().state_reason
    world.uav.vehicle.commands.setpoints.set_pose(at(10.0, 0.0, 3.0))
    world.uav.run(1.0)
    assert "until it is commanded again" not in world.uav.vehicle.telemetry().state_reason


def test_a_velocity_is_stopped_before_a_new_fence(world: World) -> None:
    world.uav.keep_samples()
    twist = TwistStamped(Twist(Vector3(5.0)), "uav_1/odom")
    for step in range(500):
        if step == 100:
            world.fence(RADIUS_M)
        try:
            world.uav.vehicle.commands.setpoints.set_velocity(twist)
        except GeofenceError:
            break
        world.uav.run(0.05)
    world.uav.run(8.0)
    assert farthest_m(world.uav) < RADIUS_M


def test_a_path_that_stays_inside_goes_on_undisturbed(world: World) -> None:
    task = begun(world, "go_to_waypoint")
    sent: list[Any] = []
    world.uav.vehicle.observe_setpoints(sent.append)
    for radius_m in (400.0, 300.0, 200.0):
        world.fence(radius_m)
        world.uav.run(1.0)
    assert min((b.position - a.position).norm() for a, b in itertools.pairwise(sent)) > 0.05
    world.uav.end(task.future)


def test_a_path_that_leads_back_in_goes_on(world: World) -> None:
    world.uav.end(world.uav.prepare.go_to_waypoint(at(60.0, 0.0, 3.0)).begin().future)
    task = world.uav.prepare.go_to_waypoint(at(0.0, 0.0, 3.0)).begin()
    world.uav.run(1.0)
    world.fence(RADIUS_M)
    world.uav.end(task.future)
    assert math.hypot(world.uav.pose.position.x, world.uav.pose.position.y) < 0.3


def test_a_climb_of_a_take_off_ends_below_a_new_ceiling(monkeypatch: pytest.MonkeyPatch) -> None:
    with stepped(light=FAST) as uav:
        world = World(uav, monkeypatch)
        uav.arm()
        task = uav.prepare.take_off(30.0).begin()
        uav.until(lambda: uav.speed > 2.0)
        world.fence(highest_m=15.0)
        uav.until(task.future.done)
        with pytest.raises(GeofenceError, match="GF_MAX_VER_DIST"):
            task.future.result()
        uav.run(5.0)
        assert uav.state is State.FLYING_AUTO
        assert uav.pose.position.z < 14.0
        assert uav.speed < 0.1


def test_a_long_path_faces_a_new_fence_bit_by_bit_and_ends_before_it(world: World) -> None:
    waypoints = path_of(400)
    task = world.uav.prepare.follow_path(waypoints, corner_radius_m=0.5).begin()
    world.uav.run(5.0)
    world.fence(1180.0)  # its last waypoint lies beyond
    world.uav.run(0.1)
    assert not task.future.done()
    world.uav.run(4.0)
    with pytest.raises(GeofenceError, match="GF_MAX_HOR_DIST"):
        task.future.result()


def test_a_long_path_that_leads_back_into_a_new_fence_faces_it_bit_by_bit_too(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    uav, geofence, read_count = world.uav, world.uav.vehicle._flight.geofence, 0
    outline = geofence.outline

    def counted(*arguments: Any) -> Iterator[Vector3]:
        nonlocal read_count
        for point in outline(*arguments):
            read_count += 1
            yield point

    monkeypatch.setattr(geofence, "outline", counted)
    uav.end(uav.prepare.go_to_waypoint(at(RADIUS_M, 0.0, 3.0)).begin().future)
    inside = [at(3.0 * (n % 10), 4.0 * (n % 2), 3.0) for n in range(1, 400)]
    task = uav.prepare.follow_path(inside, corner_radius_m=0.5).begin()
    uav.run(UPDATE_S)
    world.fence(RADIUS_M)  # less its reserve, so that the UAV is just outside
    uav.run(UPDATE_S)
    assert 0 < read_count < 100
    uav.run(1.0)
    assert read_count > 500
    assert task.info().status is TaskStatus.RUNNING


# --- Home and frames --------------------------------------------------------------------------------------------------


def test_a_return_path_leads_to_where_home_is_now(world: World) -> None:
    world.home(Vector3())
    task = begun(world, "return_to_launch")
    world.home(Vector3(100.0, 30.0))
    world.uav.end(task.future)
    assert (world.uav.pose.position - Vector3(100.0, 30.0)).horizontal_norm() < 0.4


def test_no_return_path_leads_beyond_the_distance_limit(world: World) -> None:
    """As where a ground station has set home with latitude and longitude swapped."""
    world.home(Vector3())
    task = begun(world, "return_to_launch")
    world.home(Vector3(12_000.0, 30.0))
    world.uav.run(5.0)
    said = r"return_to_launch: the autopilot's home is 1\d\.\d km from the UAV, beyond its reach of 10\.0 km"
    with pytest.raises(GeofenceError, match=said) as ended:
        task.future.result()
    assert ended.value.metadata["setting"] == "reach_m"
    assert world.speed_m_s < 0.1
    with pytest.raises(GeofenceError, match=said):
        world.uav.prepare.return_to_launch(3.0)
    world.home(Vector3(100.0, 30.0))
    world.uav.prepare.return_to_launch(3.0)


@pytest.mark.parametrize("moved_m", [-1.5, 4.0])
def test_a_height_above_home_is_that_above_the_home_of_now(world: World, moved_m: float) -> None:
    """PX4 ended "9 m above home" at 2.8 m: home had been set lower just before."""
    world.home(Vector3())
    projection = world.uav.vehicle.backend.snapshot().earth.projection
    assert projection is not None
    geo = projection.to_geo(Vector3(40.0, 0.0, 0.0))
    task = world.uav.prepare.go_to_waypoint_geo(geo.latitude_deg, geo.longitude_deg, 9.0).begin()
    world.uav.run(2.0)
    world.home(Vector3(0.0, 0.0, moved_m))
    world.uav.end(task.future)
    assert world.uav.pose.position.z == pytest.approx(9.0 + moved_m, abs=0.2)


def test_a_goal_whose_frame_begins_to_move_is_followed(world: World) -> None:
    """It was flown to where its frame had been, and that was told as a success."""
    uav = world.uav

    def put(x: float) -> None:
        uav.vehicle.frame_editor.add(Transform(Vector3(x, 0.0, 0.0), IDENTITY, "uav_1/odom", "boat"))

    put(30.0)
    task = uav.prepare.go_to_waypoint(at(0.0, 0.0, 4.0, frame_id="boat")).begin()
    place = 30.0
    uav.run(2.0)
    while not task.future.done():
        place += 0.1
        put(place)
        uav.run(0.1)
        assert place < 80.0
    task.future.result()
    assert uav.pose.position.x == pytest.approx(place, abs=0.6)


def test_a_goal_whose_frame_is_removed_ends_with_its_reason(world: World) -> None:
    uav = world.uav
    uav.vehicle.frame_editor.add(Transform(Vector3(60.0), IDENTITY, "uav_1/odom", "boat"))
    task = uav.prepare.go_to_waypoint(at(0.0, 0.0, 4.0, frame_id="boat")).begin()
    uav.run(2.0)
    uav.vehicle.frame_editor.remove("boat")
    uav.run(0.1)
    with pytest.raises(UnknownFrameError, match="boat"):
        task.future.result()
    uav.run(5.0)
    assert uav.speed < 0.1


def test_a_goal_ahead_of_the_uav_stays_where_it_was(world: World) -> None:
    uav = world.uav
    task = uav.prepare.go_to_waypoint(at(20.0, 0.0, 0.0, frame_id="uav_1/base_link")).begin()
    uav.run(1.0)
    world.limit(horizontal_speed_m_s=3.0)
    uav.end(task.future)
    assert uav.pose.position.x == pytest.approx(20.0, abs=0.3)


# --- What it costs ----------------------------------------------------------------------------------------------------


def test_while_nothing_changes_nothing_is_planned_or_checked(
    world: World, tracker: Tracker, monkeypatch: pytest.MonkeyPatch
) -> None:
    task = begun(world, "go_to_waypoint")
    world.fence(400.0)
    world.uav.run(0.5)
    flight = world.uav.vehicle._flight
    manoeuvre = flight._flown.manoeuvre
    assert manoeuvre is not None

    def fail(*_: Any) -> None:
        raise AssertionError

    monkeypatch.setattr(manoeuvre, "fit", fail)
    if tracker is Tracker.REFERENCE:  # pursuit asks for the way ahead
        monkeypatch.setattr(flight.geofence, "fence", fail)
    world.uav.run(3.0)
    monkeypatch.undo()
    assert task.info().status is TaskStatus.RUNNING


def test_the_pose_of_a_hold_is_not_abandoned_for_a_fence_around_it(world: World) -> None:
    world.uav.vehicle.commands.setpoints.set_pose(at(5.0, 0.0, 3.0))
    world.uav.run(8.0)
    world.fence(RADIUS_M)
    world.uav.run(3.0)
    assert (world.uav.pose.position - Pose.at(5.0, 0.0, 3.0).position).norm() < 0.2
