"""The detectors change their last record in place and take short ways: they must find what plain comparisons find."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual_daemon.backends.values import Estimator, LinkState, MotionState, Sample, Snapshot
from ual_daemon.flight.policy.heading_jumps import JUMP_RAD, HeadingJumpDetector
from ual_daemon.flight.policy.jumps import ANNOUNCED_JUMP_M, JUMP_M, JumpDetector

STEPS = st.lists(
    st.tuples(
        st.sampled_from([0.0, 0.02, 0.1, 0.6, 3.0]),  # seconds since the last one
        st.sampled_from([0.0, 0.05, 0.9, 1.5, -2.0]),  # metres to the east
        st.sampled_from([0.0, 0.1, 0.3, -0.5, 2.0]),  # rad to the left
        st.sampled_from([0.0, 1.0, -3.0]),  # m/s
        st.sampled_from([0.0, 0.0, 1.0]),  # rad/s
        st.sampled_from([0, 0, 0, 0, 1]),  # further boots
    ),
    min_size=2,
    max_size=30,
)


def _snapshots(steps: list[tuple[float, float, float, float, float, int]]) -> list[Snapshot]:
    time_s, x, yaw_rad, boots, found = 100.0, 0.0, 0.0, 1, []
    orientation = Quaternion.from_yaw(yaw_rad)
    for passed_s, more_m, turn_rad, speed_m_s, rate_rad_s, boot in steps:
        time_s, x, yaw_rad, boots = time_s + passed_s, x + more_m, yaw_rad + turn_rad, boots + boot
        if turn_rad:
            orientation = Quaternion.from_yaw(yaw_rad)
        pose = Sample(Pose(Vector3(x, 0.0, 0.0), orientation), time_s)
        twist = Sample(Twist(Vector3(speed_m_s, 0.0, 0.0), Vector3(0.0, 0.0, rate_rad_s)), time_s)
        motion = MotionState(Sample(Estimator(True), time_s), pose, twist)
        found.append(Snapshot(time_s, time_s, motion=motion, link=LinkState(boots_count=boots)))
    return found


@given(STEPS)
def test_heading_jumps_are_those_of_a_plain_comparison(
    steps: list[tuple[float, float, float, float, float, int]],
) -> None:
    detector, newest_s, last, is_waiting = HeadingJumpDetector(), -math.inf, None, False
    for snapshot in _snapshots(steps):
        jump = detector.observe(snapshot)
        pose, velocity = snapshot.motion.pose, snapshot.motion.velocity
        assert pose is not None
        assert velocity is not None
        if pose.time_s == newest_s:
            assert jump is None
            continue
        newest_s = pose.time_s
        new = pose.value.yaw_rad, velocity.value.angular.z, pose.time_s, snapshot.link.boots_count
        change_rad = 0.0
        if last is not None and last[3] == new[3] and new[2] - last[2] <= 0.5:
            passed_s = new[2] - last[2]
            change_rad = math.remainder(new[0] - last[0], math.tau)
            fastest = max(abs(last[1]), abs(new[1]))
            if abs(change_rad) <= JUMP_RAD + fastest * (passed_s + 0.25) + 2.5 * passed_s * passed_s:
                change_rad = 0.0
        if change_rad and not is_waiting:
            is_waiting, expected = True, 0.0
        else:
            last, is_waiting, expected = new, False, change_rad
        assert (0.0 if jump is None else jump.yaw_rad) == expected
        assert detector.poses.is_waiting is is_waiting


@given(STEPS)
def test_position_jumps_are_those_of_a_plain_comparison(
    steps: list[tuple[float, float, float, float, float, int]],
) -> None:
    detector, newest_s, last, is_waiting, usual_m = JumpDetector(), -math.inf, None, False, 0.0
    for snapshot in _snapshots(steps):
        jump = detector.observe(snapshot)
        pose, velocity = snapshot.motion.pose, snapshot.motion.velocity
        assert pose is not None
        assert velocity is not None
        if pose.time_s == newest_s:
            assert jump is None
            continue
        newest_s, expected = pose.time_s, 0.0
        new = pose.value.position.x, velocity.value.linear.x, pose.time_s, snapshot.link.boots_count
        if last is None or new[3] != last[3] or new[2] - last[2] > 2.0:
            last, is_waiting = new, False
        else:
            passed_s, change_m = new[2] - last[2], new[0] - last[0]
            off_m = abs(change_m - (last[1] + new[1]) * passed_s / 2)
            free_m = max(JUMP_M, 4.0 * usual_m)
            if not is_waiting and not (off_m > ANNOUNCED_JUMP_M and off_m > free_m):
                usual_m += (off_m - usual_m) * 0.05
                last = new
            else:
                mean = (last[1] + new[1]) / 2
                part_s = max(0.0, min(passed_s, change_m / mean)) if mean else 0.0
                step_m = change_m - mean * part_s
                has_jumped = abs(step_m) > free_m + 2.0 * passed_s * passed_s
                if has_jumped and not is_waiting:
                    is_waiting = True
                else:
                    last, is_waiting, expected = new, False, step_m if has_jumped else 0.0
        assert math.isclose(0.0 if jump is None else jump.offset.x, expected, abs_tol=1e-9)
        assert detector.poses.is_waiting is is_waiting
