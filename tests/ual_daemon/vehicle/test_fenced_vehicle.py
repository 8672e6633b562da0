"""The geofence for a caller: what is refused, and where a UAV that flies towards it stops. In stepped time."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator

import pytest

from tests.ual_daemon.stepped import STEP_S, Stepped, at, stepped
from ual.errors import GeofenceError
from ual.geometry import Twist, TwistStamped, Vector3
from ual.types import State
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.frames.fence import Fence
from ual_daemon.settings import GeofenceSettings, LimitSettings, VehicleSettings

# An L: the square from -10 to 10 without its upper right quarter.
L_SHAPE = ((-10.0, -10.0), (10.0, -10.0), (10.0, 0.0), (0.0, 0.0), (0.0, 10.0), (-10.0, 10.0))
FENCED = VehicleSettings(geofence=GeofenceSettings(polygon=L_SHAPE, min_height_m=1.0, max_height_m=10.0))


@pytest.fixture
def uav() -> Iterator[Stepped]:
    with stepped(FENCED, light={"start": [-5.0, -5.0, 0.0]}) as it:
        yield it


def velocity(x: float, y: float = 0.0, z: float = 0.0, frame_id: str = "") -> TwistStamped:
    return TwistStamped(Twist(Vector3(x, y, z), Vector3()), frame_id)


def test_a_take_off_beyond_the_height_band_is_refused(uav: Stepped) -> None:
    uav.arm()
    for height_m in (10.1, 0.9):
        with pytest.raises(GeofenceError, match="outside the geofence"):
            uav.prepare.take_off(height_m)
    uav.run(1.0)
    assert uav.state is State.LANDED_ARMED


@pytest.mark.parametrize(
    "move",
    [
        lambda uav: uav.prepare.go_to_waypoint(at(5.0, 5.0, 3.0)),
        lambda uav: uav.prepare.go_to_waypoint(at(-5.0, -5.0, 0.5)),
        lambda uav: uav.vehicle.commands.plan(at(-5.0, -10.1, 3.0)),
        lambda uav: uav.prepare.follow_path([at(-5.0, 8.0, 3.0), at(8.0, -5.0, 3.0)]),
        lambda uav: uav.prepare.follow_path([at(8.0, -5.0, 3.0), at(20.0, -5.0, 3.0), at(5.0, -5.0, 3.0)]),
    ],
    ids=["goal outside", "goal too low", "pose outside", "leg outside between corners inside", "waypoint outside"],
)
def test_a_motion_that_would_leave_is_refused_and_nothing_moves(
    flying: Stepped, move: Callable[[Stepped], object]
) -> None:
    before = flying.pose.position
    with pytest.raises(GeofenceError):
        move(flying)
    flying.run(2.0)
    assert (flying.pose.position - before).norm() < 0.05
    assert flying.state is State.FLYING_AUTO


def test_a_refusal_names_the_goal_that_lies_outside(flying: Stepped) -> None:
    with pytest.raises(
        GeofenceError, match=r"go_to_waypoint: 5\.0, 6\.0, 3\.0 in uav_1/odom lies outside the geofence"
    ):
        flying.prepare.go_to_waypoint(at(5.0, 6.0, 3.0))


@pytest.mark.parametrize(
    "move",
    [
        lambda uav: uav.prepare.go_to_waypoint(at(5e6, 0.0, 3.0)),
        lambda uav: uav.prepare.go_to_waypoint(at(5e6, 0.0, 9.9), max_speed_m_s=0.01),
        lambda uav: uav.prepare.follow_path([at(5e6, 0.0, 9.9), at(5e6, 5e6, 9.9)], corner_radius_m=1e6),
        lambda uav: uav.prepare.follow_path([at(5e6, 0.0, 20.0), at(5e6, 5e6, 9.9)]),
        lambda uav: uav.prepare.go_to_waypoint(at(5e6, 0.0, 11.0)),
    ],
    ids=["far", "slow, at the edge", "far path at the edge", "far path outside", "far goal outside"],
)
def test_the_number_of_checked_points_does_not_depend_on_the_length_or_speed_of_the_path(
    move: Callable[[Stepped], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are checked on the thread that serves all callers."""
    checked: list[Vector3] = []
    is_inside = Fence.is_inside

    def count(fence: Fence, point: Vector3) -> bool:
        checked.append(point)
        return is_inside(fence, point)

    with stepped(VehicleSettings(geofence=GeofenceSettings(max_height_m=10.0), reach_m=None)) as uav:
        uav.fly()
        for velocity_m_s in (0.0, 1.0):  # from rest, and in motion
            uav.vehicle.commands.setpoints.set_velocity(velocity(0.0, velocity_m_s))
            uav.run(0.4)
            checked.clear()
            monkeypatch.setattr(Fence, "is_inside", count)
            with contextlib.suppress(GeofenceError):
                move(uav)
            monkeypatch.undo()
            assert 0 < len(checked) < 1000


def test_a_path_around_the_corner_is_executed(flying: Stepped) -> None:
    path = [at(-2.0, -2.0, 3.0), at(-2.0, 8.0, 3.0)]
    flying.end(flying.prepare.follow_path(path, corner_radius_m=1.0).begin().future)
    assert (flying.pose.position - Vector3(-2.0, 8.0, 3.0)).norm() < 0.5


@pytest.mark.parametrize(
    ("heading", "frame_id"), [(0.4, ""), (math.pi / 2, ""), (-2.0, ""), (math.pi, "uav_1/base_link")]
)
def test_a_velocity_against_the_fence_is_stopped_at_its_edge(flying: Stepped, heading: float, frame_id: str) -> None:
    commanded = velocity(1.5 * math.cos(heading), 1.5 * math.sin(heading), 0.0, frame_id)
    refused = False
    for _ in range(round(12.0 / STEP_S)):
        try:
            flying.vehicle.commands.setpoints.set_velocity(commanded)
        except GeofenceError:
            refused = True
        flying.run(STEP_S)
        p = flying.pose.position
        assert -10.0 <= p.x <= 10.0
        assert -10.0 <= p.y <= 10.0
        assert not (p.x > 0.0 and p.y > 0.0)
    assert refused
    edge = min(10.0 - abs(p.x), 10.0 - abs(p.y), *((abs(p.y),) if p.x > 0.0 else (abs(p.x),) if p.y > 0.0 else ()))
    assert edge < 0.7
    flying.end(flying.prepare.go_to_waypoint(at(-5.0, -5.0, 3.0)).begin().future)


def test_a_velocity_that_is_not_renewed_is_stopped_at_the_edge_too(flying: Stepped) -> None:
    """A velocity that was accepted just before the edge must not go on for its half second."""
    flying.end(flying.prepare.go_to_waypoint(at(-5.0, -9.0, 3.0)).begin().future)
    flying.vehicle.commands.setpoints.set_velocity(velocity(0.0, -0.8))
    lowest = 0.0
    for _ in range(round(3.0 / STEP_S)):
        flying.run(STEP_S)
        lowest = min(lowest, flying.pose.position.y)
    assert lowest >= -10.0


@pytest.mark.parametrize("across", [(0.0, 1.0), (-0.2, 1.0), (0.2, -1.0)])
def test_the_uav_does_not_leave_by_its_momentum_when_its_velocity_changes_to_one_along_the_edge(
    across: tuple[float, float],
) -> None:
    fence = GeofenceSettings(polygon=((-60.0, -200.0), (60.0, -200.0), (60.0, 200.0), (-60.0, 200.0)))
    light = {"horizontal_speed_m_s": 10.0, "horizontal_acceleration_m_s2": 3.0}
    with stepped(VehicleSettings(geofence=fence), light=light) as uav:
        uav.fly()
        commanded, furthest, was_refused = velocity(10.0), 0.0, False
        for _ in range(round(20.0 / STEP_S)):
            try:
                uav.vehicle.commands.setpoints.set_velocity(commanded)
            except GeofenceError:
                commanded, was_refused = velocity(10.0 * across[0], 10.0 * across[1]), True
            uav.run(STEP_S)
            furthest = max(furthest, uav.pose.position.x)
        assert was_refused
        assert furthest <= 60.1


def nothing(uav: Stepped) -> None:
    """Nothing follows."""


def abort(uav: Stepped) -> None:
    uav.vehicle.commands.abort()


def turn_estimate(uav: Stepped) -> None:
    uav.vehicle._flight.estimate_jumped(EstimateJump(yaw_rad=0.5), uav.vehicle.backend.snapshot())


def move_estimate(uav: Stepped) -> None:
    uav.vehicle._flight.estimate_jumped(EstimateJump(Vector3(0.0, 0.3, 0.0)), uav.vehicle.backend.snapshot())


def break_manoeuvre(uav: Stepped) -> None:
    """A step of what is flown raises, as by a defect."""
    del uav.vehicle._flight.manoeuvre._watched_s  # type: ignore[union-attr]


def pass_time_limit(uav: Stepped) -> None:
    uav.vehicle._flight.manoeuvre._longest_s = 0.0  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("flown_m", "stop", "again"),
    [
        (44.0, abort, nothing),
        (50.0, abort, nothing),
        (56.0, abort, nothing),
        (50.0, abort, abort),
        (50.0, abort, lambda uav: uav.vehicle.release_lease(uav.vehicle.acquire_lease("another", ""))),
        (50.0, turn_estimate, nothing),
        (50.0, pass_time_limit, nothing),
        (50.0, break_manoeuvre, nothing),
        (50.0, move_estimate, nothing),
    ],
    ids=[
        "early",
        "in the middle",
        "late",
        "aborted twice",
        "then a lease",
        "the heading jumps",
        "the time limit",
        "a defect",
        "the position jumps",
    ],
)
def test_a_stop_before_a_corner_at_the_edge_comes_to_rest_along_the_path(
    flown_m: float, stop: Callable[[Stepped], object], again: Callable[[Stepped], object]
) -> None:
    """A corner of 30 degrees at 10 m/s: straight ahead, it would brake outside."""
    slope = math.tan(math.radians(30.0))
    edge = tuple((x, max(0.0, (x - 60.0) * slope) - 0.5) for x in (-10.0, 60.0, 200.0))
    fence = GeofenceSettings(polygon=(*edge, (200.0, 200.0), (-10.0, 200.0)))
    light = {"horizontal_speed_m_s": 10.0, "horizontal_acceleration_m_s2": 3.0}
    with stepped(VehicleSettings(geofence=fence), light=light) as uav:
        uav.fly()
        path = [at(60.0, 0.0, 3.0), at(100.0, 40.0 * slope, 3.0)]
        uav.prepare.follow_path(path, corner_radius_m=30.0).begin()
        uav.until(lambda: uav.pose.position.x >= flown_m)
        stop(uav)
        uav.run(0.2)
        again(uav)
        for _ in range(round(8.0 / STEP_S)):
            uav.run(STEP_S)
            reference = uav.vehicle.telemetry().reference_pose
            assert reference is not None
            for point in (reference.position, uav.pose.position):
                assert point.y >= max(0.0, (point.x - 60.0) * slope) - 0.55
        assert uav.speed < 0.05
        assert uav.pose.position.x < 90.0  # before the end of the path
        uav.end(uav.prepare.go_to_waypoint(at(0.0, 5.0, 3.0)).begin().future)


def test_what_makes_no_headway_holds_where_it_is_and_is_not_led_on() -> None:
    """By a reference that leads a UAV which something stops, it would be pushed on."""
    with stepped(light={"response_s": 1.0}) as uav:  # the UAV lags
        uav.fly()
        uav.prepare.go_to_waypoint(at(10.0, 0.0, 3.0)).begin()
        uav.until(lambda: uav.pose.position.x > 1.0)
        before = uav.vehicle.telemetry().reference_pose
        break_manoeuvre(uav)
        uav.run(0.1)
        held = uav.vehicle.telemetry().reference_pose
        assert before is not None
        assert held is not None
        assert held.position.x == pytest.approx(uav.pose.position.x, abs=0.15)
        assert held.position.x < before.position.x - 0.05


@pytest.mark.parametrize("stop", [abort, move_estimate], ids=["abort", "the position jumps"])
def test_a_stop_before_a_pose_near_the_edge_stays_inside_where_it_would_brake_outside(
    stop: Callable[[Stepped], object],
) -> None:
    """An autopilot approaches a pose with more deceleration than UAL may use."""
    fence = GeofenceSettings(polygon=((-10.0, -20.0), (60.5, -20.0), (60.5, 20.0), (-10.0, 20.0)))
    settings = VehicleSettings(geofence=fence, limits=LimitSettings(horizontal_acceleration_m_s2=2.0))
    light = {"horizontal_speed_m_s": 8.0, "horizontal_acceleration_m_s2": 8.0}
    with stepped(settings, light=light) as uav:
        uav.fly()
        uav.vehicle.commands.setpoints.set_pose(at(60.0, 0.0, 3.0))
        uav.until(lambda: uav.pose.position.x > 55.0)
        stop(uav)
        furthest = 0.0
        for _ in range(round(8.0 / STEP_S)):
            uav.run(STEP_S)
            furthest = max(furthest, uav.pose.position.x)
        assert furthest < 60.5
        assert uav.speed < 0.05
        # Elsewhere, and to the side, it stops straight ahead.
        uav.vehicle.commands.setpoints.set_pose(at(0.0, 0.0, 3.0))
        uav.until(lambda: uav.speed > 7.5)
        uav.vehicle.commands.abort()
        uav.run(8.0)
        assert uav.pose.position.x > 20.0


def test_climbing_and_descending_stop_at_the_heights(flying: Stepped) -> None:
    for z, limit in ((1.2, 10.0), (-1.2, 1.0)):
        for _ in range(round(12.0 / STEP_S)):
            with contextlib.suppress(GeofenceError):
                flying.vehicle.commands.setpoints.set_velocity(velocity(0.0, 0.0, z))
            flying.run(STEP_S)
        assert abs(flying.pose.position.z - limit) < 0.6
        assert 1.0 <= flying.pose.position.z <= 10.0


def test_the_safety_pilot_is_not_fenced_and_a_uav_left_outside_holds_there_and_comes_back(flying: Stepped) -> None:
    flying.sim.pilot_take_over()
    flying.sim.pilot_move_sticks(forward=1.0)
    flying.until(lambda: flying.pose.position.x > 12.0)
    flying.sim.pilot_move_sticks()
    flying.run(2.0)
    flying.end(flying.vehicle.commands.recover_from_manual().begin())
    outside = flying.pose.position
    flying.run(2.0)
    assert (flying.pose.position - outside).norm() < 0.2
    with pytest.raises(GeofenceError):
        flying.vehicle.commands.setpoints.set_velocity(velocity(1.0))
    with pytest.raises(GeofenceError):
        flying.prepare.go_to_waypoint(at(15.0, -5.0, 3.0))
    flying.end(flying.prepare.go_to_waypoint(at(5.0, -5.0, 3.0)).begin().future)
    assert flying.pose.position.x < 10.0


@pytest.mark.parametrize("legs", [10, 1000])
def test_a_short_exit_in_a_long_path_is_found(flying: Stepped, legs: int) -> None:
    inside = [at(-5.0 if leg % 2 else 5.0, -5.0, 3.0) for leg in range(legs)]
    flying.prepare.follow_path(inside)
    with pytest.raises(GeofenceError):
        flying.prepare.follow_path([*inside, at(-5.0, -5.0, 3.0), at(-5.0, -10.05, 3.0), *inside])
