"""Jumps of the estimate, as opposed to noise, a late link or a wrong value."""

from __future__ import annotations

import random
from collections.abc import Iterable

import pytest

from tests.snapshots import changed
from ual.geometry import Pose, Twist, Vector3
from ual_daemon.backends.values import Estimator, LinkState, MotionState, Sample, Snapshot
from ual_daemon.flight.policy.jumps import JumpDetector

STEP_S = 0.02


def observed(
    x: float,
    speed_m_s: float,
    received_s: float,
    stamp_s: float = 0.0,
    boots_count: int = 0,
    *,
    is_good: bool = True,
) -> Snapshot:
    return Snapshot(
        received_s,
        motion=MotionState(
            stamp_s=stamp_s,
            estimator=Sample(Estimator(is_good), received_s),
            pose=Sample(Pose.at(x, 0.0, 3.0), received_s),
            velocity=Sample(Twist(Vector3(speed_m_s, 0.0, 0.0)), received_s),
        ),
        link=LinkState(boots_count=boots_count),
    )


def jumps(snapshots: Iterable[Snapshot]) -> list[float]:
    detector = JumpDetector()
    found = (detector.observe(snapshot) for snapshot in snapshots)
    return [jump.offset.x for jump in found if jump is not None]


def test_a_jump_is_found_with_its_second_position() -> None:
    detector = JumpDetector()
    for step in range(50):
        assert detector.observe(observed(0.0, 0.0, step * STEP_S)) is None
    assert detector.observe(observed(5.0, 0.0, 1.0)) is None
    assert detector.is_suspected(1.0)
    assert not detector.is_suspected(1.3)  # nothing has confirmed it for long
    jump = detector.observe(observed(5.0, 0.0, 1.02))
    assert jump is not None
    assert tuple(jump.offset) == (5.0, 0.0, 0.0)
    assert jump.text == "position jumped by 5.0 m"
    assert not detector.is_suspected(1.02)
    assert detector.observe(observed(5.0, 0.0, 1.04)) is None


def test_the_same_position_again_confirms_nothing() -> None:
    detector = JumpDetector()
    detector.observe(observed(0.0, 0.0, 0.0))
    detector.observe(observed(5.0, 0.0, 0.02))
    assert detector.observe(observed(5.0, 0.0, 0.02).at(0.05)) is None


def test_a_jump_in_flight_is_what_the_velocity_does_not_explain() -> None:
    way = [
        observed(10.0 * i * STEP_S + (4.0 if i > 20 else 0.0), 10.0, i * STEP_S, 100.0 + i * STEP_S) for i in range(40)
    ]
    assert jumps(way) == [pytest.approx(4.0, abs=0.3)]


def test_a_single_wrong_position_is_no_jump() -> None:
    assert jumps(observed(7.0 if i == 20 else 0.0, 0.0, i * STEP_S) for i in range(40)) == []


@pytest.mark.parametrize("sigma_m", [0.1, 0.3, 1.0])
def test_noise_is_no_jump(sigma_m: float) -> None:
    noise = random.Random(1)
    settled = [observed(noise.gauss(0.0, sigma_m * min(1.0, i / 200)), 0.0, i * STEP_S) for i in range(2000)]
    assert jumps(settled) == []


def test_small_steps_are_no_jumps() -> None:
    assert jumps(observed(0.9 * (i // 10), 0.0, i * STEP_S) for i in range(100)) == []


@pytest.mark.parametrize(("announced_s", "found"), [(0.9, [0.5]), (-5.0, [])])
def test_a_small_step_is_a_jump_if_it_was_announced(announced_s: float, found: list[float]) -> None:
    detector = JumpDetector()
    detector.announce(announced_s)
    seen_jumps = [detector.observe(observed(0.5 * (step > 50), 0.0, step * STEP_S)) for step in range(100)]
    assert [jump.offset.x for jump in seen_jumps if jump is not None] == found


@pytest.mark.parametrize("has_stamps", [False, True])
def test_a_link_that_holds_positions_back_and_delivers_them_together_makes_no_jump(*, has_stamps: bool) -> None:
    speed_m_s = 12.0
    way = []
    for i in range(100):
        sent_s = i * STEP_S
        received_s = 1.2 + i * 1e-4 if 0.6 < sent_s < 1.2 else sent_s
        way.append(observed(speed_m_s * sent_s, speed_m_s, received_s, 100.0 + sent_s if has_stamps else 0.0))
    assert jumps(way) == []


def test_hard_turns_and_lost_positions_are_no_jumps() -> None:
    brake_m_s2, x, speed_m_s, way = 8.0, 0.0, 12.0, []
    for i in range(150):
        speed_m_s = max(0.0, speed_m_s - brake_m_s2 * STEP_S)
        x += speed_m_s * STEP_S
        if i % 25 == 0:
            way.append(observed(x, speed_m_s, i * STEP_S))
    assert jumps(way) == []


def test_a_new_boot_or_a_long_gap_is_no_jump() -> None:
    assert (
        jumps([observed(0.0, 0.0, 0.0), observed(9.0, 0.0, 0.1, boots_count=1), observed(9.0, 0.0, 0.2, boots_count=1)])
        == []
    )
    assert jumps([observed(0.0, 0.0, 0.0), observed(9.0, 0.0, 2.5), observed(9.0, 0.0, 2.6)]) == []


def test_a_position_that_is_found_for_the_first_time_is_no_jump() -> None:
    for boots_count in (0, 1):
        found = [observed(0.0, 0.0, step / 10, boots_count=boots_count, is_good=False) for step in range(1, 5)]
        found += [observed(9.0, 0.0, step / 10, boots_count=boots_count) for step in range(5, 10)]
        assert jumps([observed(0.0, 0.0, 0.0), *found] if boots_count else found) == []


def test_an_estimate_that_is_lost_and_comes_back_elsewhere_has_jumped() -> None:
    lost = [observed(0.0, 0.0, step / 10, is_good=False) for step in range(1, 20)]
    assert jumps([observed(0.0, 0.0, 0.0), *lost, observed(9.0, 0.0, 2.0), observed(9.0, 0.0, 2.1)]) == [9.0]


def test_a_delay_of_the_link_that_ends_makes_no_jump() -> None:
    """The UTC of the positions is estimated from when they come, and is corrected at once; their own clock is not."""
    speed_m_s, delay_s, way = 6.0, 0.4, []
    for i in range(100):
        is_late = 20 <= i < 60
        if is_late and i + delay_s / STEP_S >= 60:
            continue  # overtaken
        received_s = i * STEP_S + (delay_s if is_late else 0.0)
        position = observed(speed_m_s * i * STEP_S, speed_m_s, received_s, 100.0 + received_s)
        way.append(changed(position, measured_s=7.0 + i * STEP_S))
    assert jumps(way) == []
    assert jumps(changed(position, measured_s=0.0) for position in way) != []  # what the estimate alone would say
