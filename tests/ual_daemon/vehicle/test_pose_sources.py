"""Steps of a source of poses, and two sources."""

from __future__ import annotations

import random

import pytest

from ual.geometry import Vector3
from ual_daemon.vehicle.pose_sources import PoseSources

PERIOD_S = 0.02
FLOWN = Vector3(10.0, 0.0, 0.0)


def at(number: int, beside_m: float = 0.0) -> Vector3:
    return Vector3(10.0 * number * PERIOD_S, beside_m, 2.0)


def steps(places: list[Vector3], velocity: Vector3 | None = FLOWN, std_dev_m: float = 0.0) -> list[float]:
    sources = PoseSources()
    return [
        round(sources.step_m(place, number * PERIOD_S, std_dev_m, velocity), 3) for number, place in enumerate(places)
    ]


def test_a_motion_that_is_executed_has_no_steps() -> None:
    assert not any(steps([at(number) for number in range(200)]))


def test_noise_is_no_step() -> None:
    noise = random.Random(1)
    places = [at(number) + Vector3(*(noise.gauss(0.0, 0.02) for _ in range(3))) for number in range(500)]
    assert not any(steps(places, std_dev_m=0.02))


@pytest.mark.parametrize("beside_m", [0.3, 0.5, -0.5])
def test_a_step_is_reported_once(beside_m: float) -> None:
    places = [at(number, beside_m if number >= 100 else 0.0) for number in range(200)]
    assert {number: step_m for number, step_m in enumerate(steps(places)) if step_m} == {100: abs(beside_m)}


def test_without_a_velocity_only_a_step_that_no_motion_explains_is_reported() -> None:
    places = [at(number, 0.5 if number >= 100 else 0.0) for number in range(200)]
    assert not any(steps(places, velocity=Vector3(8.5, 0.0, 0.0))[:100])
    assert [bool(each) for each in steps(places, velocity=None)].count(True) == 1


@pytest.mark.parametrize("ratio", [2, 3, 5])
def test_two_senders_next_to_each_other_are_two_sources(ratio: int) -> None:
    """The second one sends one pose for so many of both."""
    sources, told = PoseSources(), []
    for number in range(100):
        now_s = number * PERIOD_S
        sources.on_pose("", now_s)
        sources.step_m(at(number, 0.3 if number % ratio == 0 else 0.0), now_s, 0.005, FLOWN)
        told.append(sources.two(now_s))
    assert told[-1] == "poses from outside step to and fro by 0.3 m: they come from two sources"
    assert not told[3]


def test_one_pose_that_is_wrong_is_no_second_source() -> None:
    sources = PoseSources()
    for number in range(500):
        sources.step_m(at(number, 0.3 if number % 60 == 59 else 0.0), number * PERIOD_S, 0.0, FLOWN)
        assert not sources.two(number * PERIOD_S)


def test_callers_that_take_turns_are_named_until_one_ends() -> None:
    sources = PoseSources()
    for number in range(10):
        sources.on_pose("mocap@ipv4:10.0.0.7:1" if number % 2 else "", number * PERIOD_S)
    assert sources.two(0.2) == "poses from outside come from mocap@ipv4:10.0.0.7:1 and this process"
    assert not sources.two(1.3)


def test_a_caller_that_connects_anew_is_one() -> None:
    sources = PoseSources()
    for number in range(100):
        sources.on_pose("ipv4:10.0.0.7:1" if number < 50 else "ipv4:10.0.0.7:2", number * PERIOD_S)
        assert not sources.two(number * PERIOD_S)
