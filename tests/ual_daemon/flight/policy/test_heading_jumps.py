"""Jumps of the heading, as opposed to a turn, noise, or a lost attitude."""

from __future__ import annotations

import math
import random
from collections.abc import Iterable

import pytest

from ual.geometry import Pose, Quaternion, Twist, Vector3, wrap_angle
from ual_daemon.backends.values import LinkState, MotionState, Sample, Snapshot
from ual_daemon.flight.policy.heading_jumps import HeadingJumpDetector

STEP_S = 0.02
JUMP_RAD = math.radians(30.0)


def observed(yaw_rad: float, rate_rad_s: float, received_s: float, boots_count: int = 0) -> Snapshot:
    return Snapshot(
        received_s,
        motion=MotionState(
            pose=Sample(Pose(Vector3(), Quaternion.from_yaw(yaw_rad)), received_s),
            velocity=Sample(Twist(Vector3(), Vector3(0.0, 0.0, rate_rad_s)), received_s),
        ),
        link=LinkState(boots_count=boots_count),
    )


def jumps(snapshots: Iterable[Snapshot]) -> list[float]:
    detector = HeadingJumpDetector()
    found = (detector.observe(snapshot) for snapshot in snapshots)
    return [jump.yaw_rad for jump in found if jump is not None]


@pytest.mark.parametrize("before_rad", [0.0, math.pi - 0.1])
def test_a_jump_is_found_with_its_second_heading(before_rad: float) -> None:
    detector = HeadingJumpDetector()
    after_rad = wrap_angle(before_rad + JUMP_RAD)
    for step in range(50):
        assert detector.observe(observed(before_rad, 0.0, step * STEP_S)) is None
    assert detector.observe(observed(after_rad, 0.0, 1.0)) is None
    assert detector.is_suspected(1.0)
    assert not detector.is_suspected(1.3)  # nothing has confirmed it for long
    assert detector.observe(observed(after_rad, 0.0, 1.0).at(1.01)) is None  # the same one confirms nothing
    jump = detector.observe(observed(after_rad, 0.0, 1.02))
    assert jump is not None
    assert jump.yaw_rad == pytest.approx(JUMP_RAD)
    assert jump.text == "heading jumped by 30 deg"
    assert not detector.is_suspected(1.02)
    assert detector.observe(observed(after_rad, 0.0, 1.04)) is None


def test_a_jump_in_a_turn_is_found() -> None:
    turn = [observed(0.5 * i * STEP_S + (0.6 if i > 20 else 0.0), 0.5, i * STEP_S) for i in range(40)]
    assert jumps(turn) == [pytest.approx(0.6, abs=0.03)]


def test_a_single_wrong_heading_is_no_jump() -> None:
    assert jumps(observed(1.0 if i == 20 else 0.0, 0.0, i * STEP_S) for i in range(40)) == []


@pytest.mark.parametrize("period_s", [0.02, 0.1, 0.4])
def test_hard_turns_are_no_jumps(period_s: float) -> None:
    yaw_rad, rate_rad_s, turn = 0.0, 0.0, []
    for i in range(1000):
        time_s = i * 0.01
        change_rad_s = 5.0 * 0.01 * (1.0 if math.sin(4.0 * time_s) > 0.0 else -1.0)
        rate_rad_s += change_rad_s
        yaw_rad += rate_rad_s * 0.01
        if i % round(period_s / 0.01) == 0:
            turn.append(observed(wrap_angle(yaw_rad), rate_rad_s, time_s))
    assert jumps(turn) == []


def test_attitudes_that_are_lost_while_positions_come_make_no_jump() -> None:
    """A pose has the newest attitude that came, which may be that of some time before."""
    noise, rate_rad_s, known_rad, turn = random.Random(1), 1.0, 0.0, []
    for i in range(2000):
        if noise.random() > 0.5 and i % 50 > 10:
            known_rad = rate_rad_s * i * STEP_S
        turn.append(observed(wrap_angle(known_rad), rate_rad_s, i * STEP_S))
    assert jumps(turn) == []


def test_a_new_boot_or_a_long_gap_is_no_jump() -> None:
    assert jumps([observed(0.0, 0.0, 0.0), *(observed(1.0, 0.0, 0.1 * i, boots_count=1) for i in range(1, 4))]) == []
    assert jumps([observed(0.0, 0.0, 0.0), observed(2.0, 0.0, 0.7), observed(2.0, 0.0, 0.8)]) == []
