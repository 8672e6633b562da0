"""External poses that go to the autopilot."""

from __future__ import annotations

import math

import pytest

from ual.geometry import Pose, Quaternion, Vector3
from ual_daemon.vehicle.pose_gate import FUTURE_S, OLDEST_POSE_S, SETTLED_TIME_S, PoseGate

PERIOD_S = 0.02
FASTEST_M_S = 30.0


def at(x: float, yaw_rad: float = 0.0) -> Pose:
    return Pose(Vector3(x, 0.0, 1.0), Quaternion.from_yaw(yaw_rad))


@pytest.mark.parametrize(
    ("age_s", "why"), [(OLDEST_POSE_S + 0.01, "it is old"), (-FUTURE_S - 0.01, "it is in the future")]
)
def test_old_poses_and_those_of_the_future_are_untimely(age_s: float, why: str) -> None:
    drop = PoseGate("give no stamp").untimely(10.0 - age_s, 10.0)
    assert drop is not None
    assert drop.why == why
    assert drop.detail.endswith("; give no stamp")


@pytest.mark.parametrize("age_s", [OLDEST_POSE_S - 0.001, 0.0, -FUTURE_S + 0.001])
def test_those_of_the_present_are_timely(age_s: float) -> None:
    assert PoseGate().untimely(10.0 - age_s, 10.0) is None


def test_stamps_must_not_run_back_but_the_same_one_may_come_twice() -> None:
    gate = PoseGate()
    assert gate.jump(at(0.0), 10.0, 0.0, FASTEST_M_S) is None
    assert gate.untimely(10.0 - 1e-5, 10.0) is None
    drop = gate.untimely(9.99, 10.0)
    assert drop is not None
    assert drop.why == "it is older than the one before"


def test_executed_motion_passes() -> None:
    gate = PoseGate()
    for number in range(200):
        assert (
            gate.jump(at(25.0 * number * PERIOD_S, 6.0 * number * PERIOD_S), number * PERIOD_S, 0.0, FASTEST_M_S)
            is None
        )
    assert gate.resets_count == 0


@pytest.mark.parametrize("there", [at(2.0), at(0.0, math.pi)], ids=["place", "orientation"])
def test_a_moment_elsewhere_is_dropped(there: Pose) -> None:
    gate = PoseGate()
    for number in range(100):
        drop = gate.jump(there if number == 50 else at(0.0), number * PERIOD_S, 0.0, FASTEST_M_S)
        assert (drop is not None) == (number == 50)
    assert gate.resets_count == 0


def test_inaccurate_poses_may_wander_more() -> None:
    precise, inaccurate = PoseGate(), PoseGate()
    precise.jump(at(0.0), 0.0, 0.0, FASTEST_M_S)
    inaccurate.jump(at(0.0), 0.0, 0.5, FASTEST_M_S)
    assert precise.jump(at(1.5), PERIOD_S, 0.0, FASTEST_M_S) is not None
    assert inaccurate.jump(at(1.5), PERIOD_S, 0.5, FASTEST_M_S) is None


@pytest.mark.parametrize("there_m", [1.0, 3.0, 10.0, 28.0, 60.0])
def test_poses_that_go_on_elsewhere_are_taken_as_a_reset_however_near_that_is(there_m: float) -> None:
    gate = PoseGate()
    gate.jump(at(0.0), 0.0, 0.0, FASTEST_M_S)
    taken_s = next(
        number * PERIOD_S
        for number in range(1, 500)
        if gate.jump(at(there_m + 0.01 * number), number * PERIOD_S, 0.0, FASTEST_M_S) is None
    )
    assert taken_s == pytest.approx(SETTLED_TIME_S, abs=2 * PERIOD_S)
    assert gate.resets_count == 1


def test_a_heading_that_goes_on_elsewhere_is_taken_as_a_reset() -> None:
    gate = PoseGate()
    taken = [
        gate.jump(at(0.0, 1.5 * (number > 0)), number * PERIOD_S, 0.0, FASTEST_M_S) is None for number in range(45)
    ]
    assert taken == [True] + [False] * 44


def test_a_slow_uav_moves_less_between_two_poses() -> None:
    gate = PoseGate()
    gate.jump(at(0.0), 0.0, 0.0, 2.0)
    assert gate.jump(at(0.5), PERIOD_S, 0.0, 2.0) is not None


def test_after_poses_elsewhere_those_of_the_path_executed_meanwhile_pass() -> None:
    gate = PoseGate()
    for number in range(60):
        is_elsewhere = 20 <= number < 40
        x = 0.1 * number + (8.0 if is_elsewhere else 0.0)
        assert (gate.jump(at(x), number * PERIOD_S, 0.0, 10.0) is not None) == is_elsewhere
    assert gate.resets_count == 0


def test_after_a_silence_the_path_executed_meanwhile_passes() -> None:
    gate = PoseGate()
    gate.jump(at(0.0), 0.0, 0.0, 10.0)
    assert gate.jump(at(5.0), 0.6, 0.0, 10.0) is None


def test_poses_that_jump_about_are_never_taken() -> None:
    gate = PoseGate()
    gate.jump(at(0.0), 0.0, 0.0, FASTEST_M_S)
    assert all(
        gate.jump(at(1000.0 * (number % 2) + 500.0), number * PERIOD_S, 0.0, FASTEST_M_S) for number in range(1, 500)
    )
