"""Pure pursuit, by configuration and for autopilots that take bare positions; and velocities alone. In stepped time."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.ual_daemon.stepped import Stepped, at, stepped
from ual.errors import NotSupportedError, UalTimeoutError
from ual.geometry import Twist, TwistStamped, Vector3
from ual.simulation import MotorsWeak
from ual.types import State
from ual_daemon.frames.fence import Fence
from ual_daemon.settings import GeofenceSettings, Tracker, VehicleSettings

WAYS = {
    "by configuration": (VehicleSettings(tracker=Tracker.PURSUIT), {}),
    "positions only": (VehicleSettings(), {"takes": "positions"}),
    "velocities only": (VehicleSettings(), {"takes": "velocities"}),
}


@pytest.fixture(params=list(WAYS.values()), ids=list(WAYS))
def flying(request: pytest.FixtureRequest) -> Iterator[Stepped]:
    settings, light = request.param
    with stepped(settings, light=light) as uav:
        uav.fly()
        uav.keep_samples()
        yield uav


def path_distance(p: Vector3, a: Vector3, b: Vector3) -> float:
    line = b - a
    along = max(0.0, min(1.0, (p - a).dot(line) / line.dot(line)))
    return (p - a - line * along).norm()


def test_a_waypoint_is_reached_straight_and_without_overshoot(flying: Stepped) -> None:
    begin, goal = flying.pose.position, Vector3(9.0, 6.0, 6.0)
    flying.end(flying.prepare.go_to_waypoint(at(goal.x, goal.y, goal.z, 1.2)).begin().future)
    flying.run(5.0)
    positions = [sample.pose.position for sample in flying.samples if sample.pose]
    assert max(path_distance(p, begin, goal) for p in positions) < 0.15
    assert max((p - begin).dot(goal - begin) for p in positions) < (goal - begin).dot(goal - begin) * 1.01
    assert (flying.pose.position - goal).norm() < 0.05
    assert flying.pose.yaw_rad == pytest.approx(1.2, abs=0.05)


def test_a_path_stops_at_each_corner_or_cuts_it_by_less_than_the_lead(flying: Stepped) -> None:
    corners = [Vector3(6, 0, 3), Vector3(6, 6, 3), Vector3(0, 6, 3)]
    for radius_m, widest in ((0.0, 0.5), (1.0, 2.0)):
        flying.end(flying.prepare.go_to_waypoint(at(0, 0, 3)).begin().future)
        flying.keep_samples()
        task = flying.prepare.follow_path([at(*corner) for corner in corners], corner_radius_m=radius_m).begin()
        flying.end(task.future)
        positions = [sample.pose.position for sample in flying.samples if sample.pose]
        for corner in corners:
            assert min((p - corner).norm() for p in positions) < widest


@pytest.mark.parametrize("max_speed_m_s", [0.2, 1.0])
def test_the_maximum_speed_holds(flying: Stepped, max_speed_m_s: float) -> None:
    flying.prepare.go_to_waypoint(at(5.0, 0.0, 3.0), max_speed_m_s=max_speed_m_s).begin()
    flying.run(8.0)
    speeds = [sample.velocity.linear.norm() for sample in flying.samples if sample.velocity]
    assert 0.75 * max_speed_m_s <= max(speeds) <= 1.1 * max_speed_m_s


def test_each_leg_keeps_its_own_speed_limit(flying: Stepped) -> None:
    path = [at(4.0, 0.0, 3.0), at(4.0, 4.0, 3.0)]
    flying.end(flying.prepare.follow_path(path, leg_speeds_m_s=[0.8, 0.3]).begin().future)
    moved = [(s.pose.position, s.velocity.linear.norm()) for s in flying.samples if s.pose and s.velocity]
    assert 0.6 <= max(speed for position, speed in moved if position.x < 3.0) <= 0.88
    assert 0.25 <= max(speed for position, speed in moved if position.y > 1.0) <= 0.33


def test_a_uav_that_is_pushed_off_the_path_comes_back_to_it(flying: Stepped) -> None:
    task = flying.prepare.go_to_waypoint(at(20.0, 0.0, 3.0)).begin()
    flying.until(lambda: flying.pose.position.x > 5.0)
    flying.sim.set_wind(Vector3(0.0, 3.0, 0.0))
    flying.run(1.5)
    flying.sim.set_wind(Vector3())
    flying.until(lambda: flying.pose.position.x > 15.0)
    assert abs(flying.pose.position.y) < 0.1
    flying.end(task.future)


def test_a_uav_that_cannot_get_there_times_out_and_names_the_distance(flying: Stepped) -> None:
    flying.sim.begin_fault(MotorsWeak(1e-6))
    task = flying.prepare.go_to_waypoint(at(4.0, 0.0, 3.0)).begin()
    flying.until(task.future.done)
    error = task.future.exception()
    assert isinstance(error, UalTimeoutError)
    assert " m " in str(error)


def test_it_holds_brakes_and_lands(flying: Stepped) -> None:
    flying.run(5.0)
    position = flying.pose.position
    flying.run(3.0)
    assert (flying.pose.position - position).norm() < 0.05
    task = flying.prepare.go_to_waypoint(at(20.0, 0.0, 3.0)).begin()
    flying.run(6.0)
    flying.vehicle.commands.cancel(task)
    flying.run(4.0)
    stopped = flying.pose.position
    flying.run(3.0)
    assert (flying.pose.position - stopped).norm() < 0.05
    flying.vehicle.commands.setpoints.set_pose(at(*(stopped + Vector3(1.0, 0.0, 0.0))))
    flying.run(8.0)
    assert (flying.pose.position - stopped - Vector3(1.0, 0.0, 0.0)).norm() < 0.05
    flying.end(flying.prepare.land().begin().future)
    flying.until(lambda: flying.state is State.LANDED_DISARMED)


def test_an_autopilot_that_takes_positions_only_refuses_velocities() -> None:
    with stepped(light={"takes": "positions"}) as uav:
        uav.fly()
        with pytest.raises(NotSupportedError):
            uav.vehicle.commands.setpoints.set_velocity(TwistStamped(Twist(Vector3(1.0))))


# --- At a geofence ----------------------------------------------------------------------------------------------------

# An L, whose corner at 0, 0 points inwards.
L_SHAPE = ((-10.0, -10.0), (10.0, -10.0), (10.0, 0.0), (0.0, 0.0), (0.0, 10.0), (-10.0, 10.0))
FENCE = Fence(L_SHAPE)


@pytest.fixture(params=list(WAYS.values()), ids=list(WAYS))
def fenced(request: pytest.FixtureRequest) -> Iterator[Stepped]:
    settings, light = request.param
    fast = {"horizontal_speed_m_s": 4.0, "horizontal_acceleration_m_s2": 4.0, "start": [-8.0, 6.0, 0.0]}
    settings = VehicleSettings(tracker=settings.tracker, geofence=GeofenceSettings(polygon=L_SHAPE))
    with stepped(settings, light={**light, **fast}) as uav:
        uav.fly()
        uav.keep_samples()
        yield uav


def outside_m(uav: Stepped) -> float:
    return max(FENCE.distance_m(sample.pose.position) for sample in uav.samples if sample.pose)


def test_a_corner_of_the_fence_is_not_cut_and_the_uav_does_not_stall_there(fenced: Stepped) -> None:
    corners = [at(-0.1, 6.0, 3.0), at(-0.1, -0.1, 3.0), at(8.0, -0.1, 3.0)]
    task = fenced.prepare.follow_path(corners, corner_radius_m=0.2).begin()
    fenced.end(task.future, 60.0)
    assert outside_m(fenced) < 0.02
    assert (fenced.pose.position - Vector3(8.0, -0.1, 3.0)).norm() < 0.5


def test_an_estimate_that_wanders_does_not_stall_it_at_a_corner() -> None:
    settings = VehicleSettings(tracker=Tracker.PURSUIT, geofence=GeofenceSettings(polygon=L_SHAPE))
    noisy = {"start": [-0.1, 3.0, 0.0], "position_noise_m": 0.1, "seed": 3}
    with stepped(settings, light=noisy) as uav:
        uav.fly()
        task = uav.prepare.follow_path([at(-0.1, -0.1, 3.0), at(4.0, -0.1, 3.0)], corner_radius_m=0.2).begin()
        uav.until(lambda: uav.pose.position.x > 3.0, 60.0)
        assert not task.future.done() or task.future.exception() is None


def test_an_abort_in_a_bend_stops_inside(fenced: Stepped) -> None:
    path = [at(-0.3, 6.0, 3.0), at(-0.3, -6.0, 3.0)]
    fenced.prepare.follow_path(path, corner_radius_m=3.0).begin()
    fenced.until(lambda: fenced.pose.position.x > -2.0)
    fenced.vehicle.commands.abort()
    fenced.run(6.0)
    assert outside_m(fenced) < 0.02
    position = fenced.pose.position
    fenced.run(2.0)
    assert (fenced.pose.position - position).norm() < 0.05
