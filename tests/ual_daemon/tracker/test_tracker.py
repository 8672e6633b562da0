"""The tracker on the light simulation: how straight, how fast, how much overshoot; and all setpoints that are sent."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from random import Random
from typing import Any

import pytest

from tests.ual_daemon.stepped import STEP_S, UPDATE_S, Stepped, at, stepped
from tests.ual_daemon.trajectory.test_straight import time_optimal_s
from tests.ual_daemon.trajectory.trajectories import assert_kept, distance_from_path, path_distance
from ual.errors import UalTimeoutError
from ual.geometry import PoseStamped, Vector3
from ual.types import Limits, State, Telemetry
from ual_daemon.backends.values import PositionSetpoint, Setpoint
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.trajectory import Motion, PathWaypoint, acceleration_limit, path, speed_limit
from ual_daemon.trajectory.envelope import RAMP_S

FAST = {
    "horizontal_speed_m_s": 3.0,
    "vertical_speed_m_s": 2.0,
    "horizontal_acceleration_m_s2": 2.5,
    "vertical_acceleration_m_s2": 2.0,
}


@contextmanager
def flying(light: Mapping[str, Any] | None = None) -> Iterator[Stepped]:
    with stepped(light=light) as uav:
        uav.fly(5.0)
        uav.run(2.0)
        uav.keep_samples()
        yield uav


def go_to(uav: Stepped, goal: PoseStamped) -> VehicleTask:
    return uav.prepare.go_to_waypoint(goal).begin()


def follow(uav: Stepped, goals: Sequence[PoseStamped], corner_radius_m: float) -> VehicleTask:
    return uav.prepare.follow_path(goals, corner_radius_m=corner_radius_m).begin()


def positions(samples: Sequence[Telemetry]) -> list[Vector3]:
    return [sample.pose.position for sample in samples if sample.pose is not None]


def fly_straight(uav: Stepped, goal: Vector3, yaw_rad: float) -> tuple[float, float, float]:
    """Returns the largest distance from the line, the overshoot, and the duration."""
    begin = uav.pose.position
    begun_s = uav.vehicle.backend.clock.now_s()
    uav.keep_samples()
    uav.end(go_to(uav, at(goal.x, goal.y, goal.z, yaw_rad)).future)
    took_s = uav.vehicle.backend.clock.now_s() - begun_s
    uav.run(3.0)
    flown_positions = positions(uav.samples)
    way = goal - begin
    off = [
        offset - way * (offset.dot(way) / way.dot(way)) for offset in (position - begin for position in flown_positions)
    ]
    over = max((position - goal).dot(way) / way.norm() for position in flown_positions)
    return max(offset.norm() for offset in off), over, took_s


LINES = [
    (Vector3(10.0, 0.0, 5.0), 0.0),
    (Vector3(-6.0, 8.0, 7.0), 1.5),
    (Vector3(4.0, -3.0, 2.0), 0.3),
    (Vector3(0.0, 0.0, 9.0), 0.0),
    (Vector3(18.0, 5.0, 10.0), -0.5),
]


@pytest.mark.parametrize("light", [{}, FAST], ids=["slow", "fast"])
@pytest.mark.parametrize(("goal", "yaw_rad"), LINES)
def test_a_go_to_is_straight_and_time_optimal_and_does_not_overshoot(
    goal: Vector3, yaw_rad: float, light: Mapping[str, Any]
) -> None:
    with flying(light) as uav:
        uav.update_each_step()
        way = goal - uav.pose.position
        limits, direction = uav.vehicle.info().limits, way / way.norm()
        widest_m, over_m, took_s = fly_straight(uav, goal, yaw_rad)
        assert widest_m <= 0.02
        assert over_m <= 0.01
        acceleration = acceleration_limit(direction, limits)
        best_s = time_optimal_s(way.norm(), speed_limit(direction, limits), acceleration, acceleration / RAMP_S)
        assert took_s <= 1.05 * best_s


@pytest.mark.parametrize("wind", [(3.0, 0.0, 0.0), (0.0, 3.0, 0.0), (-2.0, 2.0, 1.0)])
def test_wind_does_not_push_a_go_to_off_its_path(wind: tuple[float, float, float]) -> None:
    with flying({"wind_m_s": wind}) as uav:
        widest_m, over_m, _ = fly_straight(uav, Vector3(10.0, 4.0, 8.0), 1.0)
        assert widest_m <= 0.10
        assert over_m <= 0.10


@pytest.mark.parametrize("radius_m", [1.0])
def test_a_zigzag_of_50_corners_at_3_m_s_stays_near_the_rounded_path(radius_m: float) -> None:
    with flying(FAST) as uav:
        corners = [Vector3(4.0 * i, 3.0 * (i % 2), 5.0) for i in range(1, 52)]
        start = Motion(uav.pose.position, uav.pose.yaw_rad)
        wanted = path(start, [PathWaypoint(corner) for corner in corners], radius_m, uav.vehicle.info().limits)
        line = [wanted.at(0.05 * i).position for i in range(int(wanted.duration_s / 0.05) + 2)]
        future = follow(uav, [at(c.x, c.y, c.z) for c in corners], radius_m).future
        uav.end(future, 400.0)
        flown_positions = positions(uav.samples)
        assert len(flown_positions) > 20.0 / UPDATE_S
        near = 200  # points of the line, around the expected one
        off = [
            distance_from_path(position, line[max(0, i * 4 // 5 - near) : i * 4 // 5 + near])
            for i, position in enumerate(flown_positions)
            if i % 5 == 0
        ]
        assert max(off) <= 0.2
        assert max(sample.velocity.linear.norm() for sample in uav.samples if sample.velocity) > 1.4


@contextmanager
def wiretap(uav: Stepped) -> Iterator[list[tuple[float, PositionSetpoint]]]:
    """Records the setpoints that are sent, and when; of two at the same time, the later one."""
    backend, sent = uav.vehicle.backend, list[tuple[float, PositionSetpoint]]()
    send = backend.send

    def listening(setpoint: Setpoint) -> None:
        assert isinstance(setpoint, PositionSetpoint)
        now_s = backend.clock.now_s()
        if sent and sent[-1][0] == now_s:
            sent.pop()
        sent.append((now_s, setpoint))
        send(setpoint)

    backend.send = listening  # type: ignore[method-assign]
    try:
        yield sent
    finally:
        backend.send = send  # type: ignore[method-assign]


def assert_sent_within(
    sent: Sequence[tuple[float, PositionSetpoint]], limits: Limits, period_s: float = UPDATE_S
) -> None:
    for (before_s, _), (now_s, _) in itertools.pairwise(sent):
        assert now_s - before_s == pytest.approx(period_s)
    rates = [setpoint.yaw_rate_rad_s for _, setpoint in sent]
    motions = [
        Motion(s.position, s.yaw_rad, s.velocity, s.acceleration, s.yaw_rate_rad_s, (after - before) / (2 * period_s))
        for (_, s), before, after in zip(sent[1:-1], rates, rates[2:], strict=False)
    ]
    assert_kept(motions, limits, period_s, slack=1e-4)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("light", [{}, FAST], ids=["slow", "fast"])
def test_goals_changed_every_300_ms_for_a_minute_send_nothing_beyond_the_limits(
    seed: int, light: Mapping[str, Any]
) -> None:
    random = Random(seed)
    with flying({**light, "position_noise_m": 0.05, "velocity_noise_m_s": 0.05, "seed": seed}) as uav:
        uav.update_each_step()  # a command is an update of its own between two
        limits = uav.vehicle.info().limits
        go_to(uav, at(1.0, 0.0, 5.0))
        uav.run(0.1)
        with wiretap(uav) as sent:
            for _ in range(200):
                if random.random() < 0.1:
                    uav.vehicle.commands.abort()
                elif random.random() < 0.1:
                    sides = [(random.uniform(-9, 9), random.uniform(-9, 9), random.uniform(-3, 3)) for _ in range(3)]
                    follow(uav, [at(x, y, 5.0, yaw_rad) for x, y, yaw_rad in sides], 1.0)
                else:
                    x, y, z = random.uniform(-9, 9), random.uniform(-9, 9), random.uniform(3, 9)
                    go_to(uav, at(x, y, z, random.uniform(-3, 3)))
                uav.run(0.3)
        assert len(sent) > 58.0 / STEP_S
        assert_sent_within(sent, limits, STEP_S)


def test_waiting_for_a_uav_that_is_blown_back_sends_nothing_beyond_the_limits() -> None:
    with flying({"position_noise_m": 0.1, "velocity_noise_m_s": 0.1}) as uav:
        limits = uav.vehicle.info().limits
        task = go_to(uav, at(80.0, 10.0, 8.0, 2.0))
        uav.run(0.1)
        with wiretap(uav) as sent:
            for wind in (0.0, 40.0, 0.0, 40.0, 5.0):
                uav.sim.set_wind(Vector3(-wind, 0.0, 0.0))
                uav.run(6.0)
        speeds = [setpoint.velocity.norm() for _, setpoint in sent]
        assert min(speeds) < 0.2  # it has waited
        assert not task.future.done()
        assert_sent_within(sent, limits)
        uav.sim.set_wind(Vector3())
        uav.end(task.future)


def test_a_uav_that_cannot_get_there_times_out_and_names_the_distance() -> None:
    with flying() as uav:
        uav.sim.set_wind(Vector3(-40.0, 0.0, 0.0))
        task = go_to(uav, at(20.0, 0.0, 5.0))
        with pytest.raises(UalTimeoutError, match=r"\d+\.\d\d m and 0\.\d\d rad off"):
            uav.end(task.future, 200.0)
        assert uav.state is State.FLYING_AUTO


def test_a_start_in_motion_bends_smoothly_to_a_new_goal() -> None:
    with flying() as uav:
        go_to(uav, at(10.0, 0.0, 5.0))
        uav.run(3.0)
        turning_point = uav.pose.position
        task = go_to(uav, at(turning_point.x + 5.0, 8.0, 5.0))
        uav.keep_samples()
        uav.end(task.future)
        speeds = [sample.velocity.linear.norm() for sample in uav.samples if sample.velocity is not None]
        assert min(speeds[: len(speeds) // 2]) > 0.8
        flown_positions = positions(uav.samples)
        late = flown_positions[len(flown_positions) // 2 :]
        assert (
            max(path_distance(position, late[0], Vector3(turning_point.x + 5.0, 8.0, 5.0)) for position in late) <= 0.02
        )


def test_an_abort_comes_to_rest_as_fast_as_the_limits_allow() -> None:
    with flying() as uav:
        go_to(uav, at(20.0, 0.0, 5.0))
        uav.run(4.0)
        begun, speed, limits = uav.pose.position, uav.speed, uav.vehicle.info().limits
        uav.vehicle.commands.abort()
        acceleration = limits.horizontal_acceleration_m_s2
        stop_s = speed / acceleration + RAMP_S
        uav.run(stop_s + 0.5)
        assert uav.speed < 0.05
        assert (uav.pose.position - begun).norm() == pytest.approx(speed * stop_s / 2, abs=0.1)
        assert math.isclose(uav.pose.position.y, begun.y, abs_tol=0.02)
