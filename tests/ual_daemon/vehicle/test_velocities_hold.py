"""Velocities that are flown as a place that moves: an axis that is commanded 0 holds its place. In stepped time."""

from __future__ import annotations

import math

import pytest

from tests.ual_daemon.stepped import STEP_S, Stepped, at, stepped
from ual.geometry import Quaternion, Twist, TwistStamped, Vector3
from ual.types import State

GUST_M_S = Vector3(6.0, -8.0, 0.0)


def command(uav: Stepped, linear: Vector3, duration_s: float, yaw_rate_rad_s: float = 0.0, frame_id: str = "") -> None:
    twist = TwistStamped(Twist(linear, Vector3(0.0, 0.0, yaw_rate_rad_s)), frame_id)
    for _ in range(round(duration_s / STEP_S)):
        uav.vehicle.commands.setpoints.set_velocity(twist)
        uav.run(STEP_S)


@pytest.mark.parametrize("frame_id", ["", "uav_1/base_link"])
def test_a_uav_that_is_commanded_nothing_comes_back_when_the_wind_has_moved_it(flying: Stepped, frame_id: str) -> None:
    command(flying, Vector3(), 1.0, frame_id=frame_id)
    place = flying.pose.position
    flying.sim.set_wind(GUST_M_S)
    command(flying, Vector3(), 1.0, frame_id=frame_id)
    assert (flying.pose.position - place).norm() > 0.1
    flying.sim.set_wind(Vector3())
    command(flying, Vector3(), 10.0, frame_id=frame_id)
    assert (flying.pose.position - place).norm() < 0.02


def test_a_path_is_held_in_the_body_whichever_path_it_points(uav: Stepped) -> None:
    uav.fly()
    uav.end(uav.prepare.go_to_waypoint(at(0, 0, 3, math.radians(30))).begin().future)
    command(uav, Vector3(1.0, 0.0, 0.0), 3.0, frame_id="uav_1/base_link")
    begin, heading = uav.pose.position, Quaternion.from_yaw(uav.pose.yaw_rad).rotate(Vector3(1.0, 0.0, 0.0))
    uav.sim.set_wind(GUST_M_S)
    command(uav, Vector3(1.0, 0.0, 0.0), 0.5, frame_id="uav_1/base_link")
    uav.sim.set_wind(Vector3())
    command(uav, Vector3(1.0, 0.0, 0.0), 10.0, frame_id="uav_1/base_link")
    way = uav.pose.position - begin
    assert (way - heading * way.dot(heading)).norm() < 0.05


def test_a_uav_that_stops_holds_its_path_and_height_and_does_not_fly_back(flying: Stepped) -> None:
    command(flying, Vector3(1.5, 0.0, 0.0), 5.0)
    begin = flying.pose.position
    flying.keep_samples()
    command(flying, Vector3(), 8.0)
    places = [sample.pose.position for sample in flying.samples if sample.pose is not None]
    assert max(place.x for place in places) - places[-1].x < 0.03
    assert max(abs(place.y - begin.y) for place in places) < 0.01
    assert max(abs(place.z - begin.z) for place in places) < 0.01


def test_after_the_pilot_had_it_the_position_is_the_new_one(flying: Stepped) -> None:
    command(flying, Vector3(), 2.0)
    flying.sim.pilot_take_over()
    flying.until(lambda: flying.is_in(State.FLYING_MANUAL))
    flying.sim.pilot_move_sticks(forward=0.3)
    flying.run(4.0)
    flying.sim.pilot_move_sticks()
    flying.run(3.0)
    flying.sim.pilot_give_back()
    flying.until(lambda: flying.is_in(State.FLYING_AUTO))
    place = flying.pose.position
    assert place.horizontal_norm() > 1.0
    command(flying, Vector3(), 5.0)
    assert (flying.pose.position - place).norm() < 0.05


def test_a_steady_wind_moves_its_path_by_no_more_than_the_autopilot_lacks() -> None:
    with stepped(light={"wind_m_s": [3.0, 0.0, 0.0]}) as windy:
        windy.fly()
        command(windy, Vector3(0.0, 1.0, 0.0), 4.0)
        begin = windy.pose.position
        command(windy, Vector3(0.0, 1.0, 0.0), 20.0)
        assert abs(windy.pose.position.x - begin.x) < 0.1
