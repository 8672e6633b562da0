"""Correction of a commanded velocity, with a point mass whose velocity is estimated wrongly."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import Limits
from ual_daemon.backends.values import MotionState, Sample, Snapshot, VelocityResponse, VelocityResponses
from ual_daemon.tracker.drift import DriftCorrection
from ual_daemon.tracker.velocity_end_point import MOST_CHANGE_M_S2, MOST_CORRECTION_M_S, MOST_LAG_M
from ual_daemon.tracker.velocity_error import VelocityError
from ual_daemon.trajectory.envelope import speed_share

STEP_S = 0.02
LIMITS = Limits(5.0, 3.0, 2.0, 3.0, 2.0, 1.0)
RESPONSE_S = 0.5
"""PX4 follows a velocity about as slowly."""
RESPONSES = VelocityResponses(*(VelocityResponse(RESPONSE_S, delay_s=0.0),) * 2)


@dataclass
class Mass:
    """Follows velocities with a lag. `error` is its estimate of the velocity minus the true one."""

    position: Vector3 = field(default_factory=Vector3)
    velocity: Vector3 = field(default_factory=Vector3)
    yaw_rad: float = 0.0
    error: Vector3 = field(default_factory=Vector3)
    is_stuck: bool = False
    now_s: float = 0.0

    def __post_init__(self) -> None:
        self.drift = DriftCorrection()

    def snapshot(self) -> Snapshot:
        pose, twist = Pose(self.position, Quaternion.from_yaw(self.yaw_rad)), Twist(self.velocity + self.error)
        return Snapshot(
            self.now_s, motion=MotionState(pose=Sample(pose, self.now_s), velocity=Sample(twist, self.now_s))
        )

    def fly(self, commanded: Vector3, duration_s: float) -> list[Vector3]:
        """Returns where it has been."""
        places = []
        for _ in range(round(duration_s / STEP_S)):
            self.drift.step(Twist(commanded), self.snapshot(), LIMITS, RESPONSES)
            wanted = commanded + self.drift.velocity - self.error
            self.velocity += (wanted - self.velocity) * (STEP_S / RESPONSE_S)
            if self.is_stuck:
                self.velocity = Vector3()
            self.position += self.velocity * STEP_S
            self.yaw_rad += self.drift.yaw_rate_rad_s * STEP_S
            self.now_s += STEP_S
            places.append(self.position)
        return places


def width(places: list[Vector3], axis: str) -> float:
    values = [float(getattr(place, axis)) for place in places]
    return max(values) - min(values)


def vectors(largest: float) -> st.SearchStrategy[Vector3]:
    part = st.floats(-largest, largest, allow_nan=False)
    return st.builds(Vector3, part, part, part)


@pytest.mark.parametrize("commanded", [Vector3(), Vector3(1.0, 0.0, 0.0), Vector3(0.0, -2.0, 0.5)])
def test_a_wrong_estimate_of_the_velocity_does_not_carry_it_away(commanded: Vector3) -> None:
    mass = Mass()
    mass.fly(commanded, 8.0)
    mass.error = Vector3(0.2, -0.2, 0.1)
    begin, begin_s = mass.position, mass.now_s
    mass.fly(commanded, 60.0)
    led_to = begin + commanded * (mass.now_s - begin_s)
    assert (mass.position - led_to).norm() < 0.02


def test_without_the_correction_that_error_carries_it_metres_away() -> None:
    mass = Mass(error=Vector3(0.2, 0.0, 0.0))
    mass.drift.step = lambda *_: None  # type: ignore[method-assign]
    assert abs(mass.fly(Vector3(), 60.0)[-1].x) > 10.0


def test_an_error_that_comes_and_goes_moves_it_by_less_than_half_a_metre() -> None:
    mass = Mass()
    places: list[Vector3] = []
    for second in range(120):
        mass.error = Vector3(0.3 * math.sin(second / 3.0), 0.3 * math.cos(second / 7.0), 0.1 * math.sin(second))
        places += mass.fly(Vector3(), 1.0)
    assert max(width(places, axis) for axis in "xyz") < 0.5


def test_it_replaces_it_where_it_comes_to_rest() -> None:
    mass = Mass()
    mass.fly(Vector3(3.0, 0.0, 0.0), 6.0)
    stop = [place.x for place in mass.fly(Vector3(), 10.0)]
    assert stop[-1] > stop[0] + 1.0  # that is how far it brakes
    assert max(stop) - stop[-1] < 0.05  # it does not come back


def test_a_path_and_a_height_are_held_while_it_brakes_and_accelerates() -> None:
    mass = Mass(error=Vector3(0.0, 0.15, 0.1))
    places: list[Vector3] = []
    mass.fly(Vector3(), 20.0)
    for speed_m_s in (2.0, 0.0, -2.0, 0.5, 0.0):
        places += mass.fly(Vector3(speed_m_s, 0.0, 0.0), 4.0)
    assert width(places, "y") < 0.02
    assert width(places, "z") < 0.02


def test_a_path_is_held_while_a_gust_comes_and_it_turns_round() -> None:
    mass = Mass()
    mass.fly(Vector3(1.0, 0.0, 0.0), 5.0)
    for _ in range(10):
        mass.velocity += Vector3(0.0, 0.04, 0.0)
        mass.fly(Vector3(-1.0, 0.0, 0.0), STEP_S)
    assert mass.fly(Vector3(-1.0, 0.0, 0.0), 10.0)[-1].y == pytest.approx(0.0, abs=0.02)


def test_what_stops_it_does_not_wind_anything_up() -> None:
    mass = Mass()
    mass.fly(Vector3(1.0, 0.0, 0.0), 5.0)
    mass.is_stuck = True
    mass.fly(Vector3(1.0, 0.0, 0.0), 20.0)
    assert mass.drift.velocity.norm() < 0.01
    mass.is_stuck = False
    mass.fly(Vector3(1.0, 0.0, 0.0), 3.0)
    assert mass.velocity.x == pytest.approx(1.0, abs=0.05)


def test_a_uav_that_was_blown_away_is_not_pulled_back() -> None:
    mass = Mass()
    mass.fly(Vector3(), 5.0)
    for _ in range(20):  # a gust of 4 m/s, against all that the autopilot does
        mass.velocity = Vector3(0.0, 4.0, 0.0)
        mass.fly(Vector3(), STEP_S)
    released = mass.fly(Vector3(), 10.0)
    assert released[-1].y > released[0].y


def test_a_held_heading_comes_back_and_a_commanded_turn_is_left_alone() -> None:
    mass = Mass()
    mass.fly(Vector3(), 1.0)
    mass.yaw_rad = 0.2
    mass.fly(Vector3(), 10.0)
    assert mass.yaw_rad == pytest.approx(0.0, abs=0.01)
    mass.drift.step(Twist(Vector3(), Vector3(0.0, 0.0, 0.5)), mass.snapshot(), LIMITS, RESPONSES)
    assert mass.drift.yaw_rate_rad_s == 0.0


def test_nothing_is_left_once_it_is_forgotten_or_nothing_is_measured() -> None:
    mass = Mass()
    for forget in (mass.drift.forget, lambda: mass.drift.step(Twist(), Snapshot(0.0), LIMITS, RESPONSES)):
        mass.fly(Vector3(), 5.0)
        mass.position += Vector3(0.5, 0.0, 0.0)
        mass.fly(Vector3(), 0.5)
        assert mass.drift.velocity.x < -0.1
        forget()
        assert (mass.drift.velocity, mass.drift.yaw_rate_rad_s) == (Vector3(), 0.0)


@pytest.mark.parametrize("step_s", [0.02, 0.05, 0.1])
def test_a_steady_velocity_is_no_error_however_seldom_positions_come(step_s: float) -> None:
    error = VelocityError()
    for step in range(100):
        error.step(step * step_s, Vector3(5.0 * step * step_s), Vector3(5.0))
    assert error.value.norm() < 1e-6


def test_an_error_of_the_velocity_is_learned_from_where_the_position_goes() -> None:
    error = VelocityError()
    for step in range(100):
        error.step(step * STEP_S, Vector3(1.0 * step * STEP_S), Vector3(1.4, -0.3, 0.0))
    assert (error.value - Vector3(0.4, -0.3, 0.0)).norm() < 0.01


@settings(max_examples=20, deadline=None)
@given(st.lists(st.tuples(vectors(3.0), vectors(1.0), st.booleans(), st.floats(0.0, 1.0)), max_size=6))
def test_whatever_happens_it_stays_small_and_does_not_jump(
    phases: list[tuple[Vector3, Vector3, bool, float]],
) -> None:
    mass = Mass()
    last = Vector3()
    for commanded, error, is_stuck, duration_s in phases:
        mass.error, mass.is_stuck = error, is_stuck
        is_allowed = speed_share(commanded, LIMITS) <= 1.0
        for _ in range(round(duration_s / STEP_S)):
            mass.fly(commanded, STEP_S)
            now = mass.drift.velocity
            assert max(now.horizontal_norm(), abs(now.z)) <= MOST_CORRECTION_M_S + speed_share(commanded, LIMITS) * 5.0
            if is_allowed:
                assert speed_share(commanded + now, LIMITS) <= 1.0 + 1e-9
            if speed_share(commanded, LIMITS) < 0.7:  # far from the limits it is not cut short
                assert max(now.horizontal_norm(), abs(now.z)) <= MOST_CORRECTION_M_S + 1e-9
            last = now
    assert last.norm() < math.inf


@settings(max_examples=20, deadline=None)
@given(st.lists(st.tuples(vectors(0.7), vectors(MOST_LAG_M * 3), st.floats(0.0, 1.0)), max_size=6))
def test_neither_a_command_nor_a_position_that_jumps_makes_it_jump(
    phases: list[tuple[Vector3, Vector3, float]],
) -> None:
    mass = Mass()
    for commanded, jump, duration_s in phases:
        mass.position += jump
        for _ in range(round(duration_s / STEP_S)):
            before = mass.drift.velocity
            mass.fly(commanded, STEP_S)
            change = mass.drift.velocity - before
            assert change.horizontal_norm() <= MOST_CHANGE_M_S2 * STEP_S + 1e-9
            assert abs(change.z) <= MOST_CHANGE_M_S2 * STEP_S + 1e-9
