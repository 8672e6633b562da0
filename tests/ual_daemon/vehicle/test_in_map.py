"""Area in which the UAV may fly, and its route, as they are reported in map. In stepped time."""

from __future__ import annotations

import math

import pytest

from tests.ual_daemon.stepped import Stepped, at, stepped
from ual.errors import WrongStateError
from ual.geometry import Pose, PoseStamped, Transform, Twist, TwistStamped, Vector3
from ual.simulation import PositionLost
from ual.types import Geofence, Route, State
from ual_daemon.settings import FrameSettings, GeofenceSettings, VehicleSettings
from ual_daemon.vehicle.planner import MOST_WAYPOINTS

HOME = (100.0, 50.0, 7.0)


def near(found: Vector3, x: float, y: float, z: float) -> bool:
    return (found - Vector3(x, y, z)).norm() < 0.1


def the_route(uav: Stepped) -> Route:
    found = uav.vehicle.route()
    assert found is not None
    assert found.frame_id == "map"
    return found


# --- The geofence -----------------------------------------------------------------------------------------------------


def test_without_a_fence_there_are_the_floor_and_the_ceiling() -> None:
    with stepped(VehicleSettings(home_pose=HOME)) as uav:
        found = uav.vehicle.geofence()
    assert found.corners == ()
    assert found.circle is None
    assert found.min_z_m == pytest.approx(7.5, abs=0.01)
    assert found.max_z_m == pytest.approx(127.0, abs=0.01)


def test_nothing_may_limit_the_height() -> None:
    with stepped(VehicleSettings(floor_m=None, ceiling_m=None)) as uav:
        assert uav.vehicle.geofence() == Geofence()


def test_a_fence_in_another_frame_is_reported_in_map() -> None:
    yard = FrameSettings(frame_id="yard", parent_frame_id="map", translation=(10.0, 20.0, 1.0), yaw_rad=math.pi / 2)
    fence = GeofenceSettings(
        polygon=((-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)),
        min_height_m=2.0,
        max_height_m=30.0,
        frame_id="yard",
    )
    with stepped(VehicleSettings(frames=(yard,), geofence=fence)) as uav:
        found = uav.vehicle.geofence()
    assert near(found.corners[0], 19.0, 11.0, 0.0)
    assert near(found.corners[1], 19.0, 29.0, 0.0)
    assert found.min_z_m == pytest.approx(3.0)
    assert found.max_z_m == pytest.approx(31.0)


def test_the_lowest_of_the_tops_holds() -> None:
    fence = GeofenceSettings(max_height_m=300.0)
    with stepped(VehicleSettings(geofence=fence)) as uav:
        assert uav.vehicle.geofence().max_z_m == pytest.approx(120.0, abs=0.01)


def test_a_fence_in_a_tilted_map_is_not_reported() -> None:
    slope = FrameSettings(frame_id="slope", parent_frame_id="map", roll_rad=0.2)
    with (
        stepped(VehicleSettings(frames=(slope,), home_pose_parent_frame="slope")) as uav,
        pytest.raises(WrongStateError, match="not level"),
    ):
        uav.vehicle.geofence()


# --- The way ----------------------------------------------------------------------------------------------------------


def test_on_the_ground_nothing_is_executed(uav: Stepped) -> None:
    assert uav.vehicle.route() is None
    uav.arm()
    assert uav.vehicle.route() is None


def test_the_path_of_a_take_off_is_straight_up(uav: Stepped) -> None:
    uav.arm()
    task = uav.prepare.take_off(3.0).begin()
    uav.run(0.5)
    route = the_route(uav)
    assert route.task_id == task.id
    assert near(route.points[0], 0.0, 0.0, 0.0)
    assert near(route.points[-1], 0.0, 0.0, 3.0)


def test_the_path_of_a_go_to_is_a_path_in_map() -> None:
    with stepped(VehicleSettings(home_pose=HOME)) as uav:
        uav.fly()
        start = uav.pose.position
        task = uav.prepare.go_to_waypoint(at(5.0, 2.0, 4.0)).begin()
        uav.run(1.0)
        route = the_route(uav)
        begins, ends = route.points
        assert route.task_id == task.id
        assert not route.is_goal_moving
        assert near(begins, start.x + 100.0, start.y + 50.0, start.z + 7.0)
        assert near(ends, 105.0, 52.0, 11.0)
        uav.end(task.future)
        assert uav.vehicle.route() is None


def test_the_path_of_a_path_rounds_its_corners(flying: Stepped) -> None:
    task = flying.prepare.follow_path([at(5.0, 0.0, 3.0), at(5.0, 5.0, 3.0)], corner_radius_m=1.0).begin()
    points = the_route(flying).points
    assert near(points[-1], 5.0, 5.0, 3.0)
    assert len(points) > 4
    assert all(not near(point, 5.0, 0.0, 3.0) for point in points)
    flying.run(3.0)
    assert the_route(flying).points == points  # where it is does not change it
    flying.end(task.future)


def test_the_return_path_ends_on_the_ground(flying: Stepped) -> None:
    flying.end(flying.prepare.go_to_waypoint(at(6.0, 0.0, 3.0)).begin().future)
    flying.prepare.return_to_launch(5.0).begin()
    points = the_route(flying).points
    assert near(points[0], 6.0, 0.0, 3.0)
    assert max(point.z for point in points) == pytest.approx(5.0, abs=0.3)
    assert near(points[-1], 0.0, 0.0, 0.0)
    flying.until(lambda: flying.state is State.LANDING)
    assert flying.vehicle.route() is None


def test_the_path_to_a_goal_that_moves_moves(flying: Stepped) -> None:
    def move(x: float) -> None:
        flying.vehicle.frame_editor.add(Transform(Vector3(x, 0.0, 0.0), child_frame_id="car"))

    move(10.0)
    flying.run(0.1)
    move(10.02)
    task = flying.prepare.go_to_waypoint(PoseStamped(Pose.at(0.0, 0.0, 4.0), "car")).begin()
    flying.run(0.5)
    first = the_route(flying)
    assert first.is_goal_moving
    assert first.task_id == task.id
    for i in range(10):
        flying.run(0.1)
        move(10.02 + 0.1 * i)
    later = the_route(flying)
    assert later.points[-1].x > first.points[-1].x + 0.5
    assert later.points[0].x > first.points[0].x + 0.5


def test_a_pose_in_a_frame_that_moves_has_a_path_and_no_task(flying: Stepped) -> None:
    commands = flying.vehicle.commands
    flying.vehicle.frame_editor.add(Transform(Vector3(5.0, 0.0, 0.0), child_frame_id="car"))
    flying.run(0.1)
    flying.vehicle.frame_editor.add(Transform(Vector3(5.01, 0.0, 0.0), child_frame_id="car"))
    commands.setpoints.set_pose(PoseStamped(Pose.at(0.0, 0.0, 4.0), "car"))
    flying.run(0.2)
    route = the_route(flying)
    assert route.task_id == ""
    assert route.is_goal_moving


def test_a_velocity_and_a_hover_have_no_progress(flying: Stepped) -> None:
    flying.run(0.2)
    assert flying.vehicle.route() is None
    flying.vehicle.commands.setpoints.set_velocity(TwistStamped(Twist(Vector3(0.5, 0.0, 0.0), Vector3())))
    flying.run(0.2)
    assert flying.vehicle.route() is None


def test_the_path_of_the_longest_path_is_bounded_and_kept(flying: Stepped) -> None:
    corners = [at(2.0 * (i % 100), 2.0 * (i // 100) + 1.5 * (i % 2), 3.0 + i % 3) for i in range(MOST_WAYPOINTS)]
    flying.prepare.follow_path(corners, corner_radius_m=0.5).begin()
    points = the_route(flying).points
    assert 1000 < len(points) <= 2001
    assert the_route(flying).points == points


def test_while_the_position_is_lost_nothing_is_executed(flying: Stepped) -> None:
    flying.prepare.go_to_waypoint(at(5.0, 2.0, 4.0)).begin()
    flying.run(0.2)
    flying.sim.begin_fault(PositionLost())
    flying.until(lambda: flying.state is State.UNINITIALIZED)
    assert flying.vehicle.route() is None
