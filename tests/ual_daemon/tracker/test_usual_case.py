"""Short ways for the usual case of an update: they must lead to what the long ones do."""

from __future__ import annotations

import math
from collections import deque

from hypothesis import given
from hypothesis import strategies as st

from tests.strategies import vectors
from ual.geometry import Pose, Quaternion, Twist, Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.backends.values import MotionState, Sample, Snapshot
from ual_daemon.flight.manoeuvres.arrival import Arrival
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.time_scaling import TimeScaling, scaled
from ual_daemon.trajectory import Motion, StraightTrajectory
from ual_daemon.trajectory.leg import Leg

LIMITS = Limits(2.0, 1.0, 1.0, 1.5, 1.0, 1.0)


class _WithoutUsualCase(TimeScaling):
    def advance(self, passed_s: float, limit_s: float, wanted_scale: float) -> None:
        self._wait_s -= passed_s
        if self._is_at_rest():
            self._change, self._scale, self._scale_rate = None, wanted_scale, 0.0
            if self.time_s == min(limit_s, self._trajectory.duration_s):
                return
        elif self._change is None and self._wait_s <= 0.0 and self._needs_change(wanted_scale):
            self._change, self._changing_s = self._next_try(wanted_scale), 0.0
        self._pass(passed_s)
        self.time_s = min(self.time_s, limit_s, self._trajectory.duration_s)
        self.motion = scaled(self._trajectory.at(self.time_s), self._scale, self._scale_rate)


@given(
    vectors(20.0),
    st.lists(
        st.tuples(st.sampled_from([0.0, 0.02, 0.2]), st.sampled_from([1.0, 1.0, 1.0, 0.5, 0.0]), st.integers(1, 40)),
        max_size=12,
    ),
    st.sampled_from([math.inf, 3.0]),
)
def test_the_scaled_time_is_that_of_the_general_case(
    goal: Vector3, course: list[tuple[float, float, int]], limit_s: float
) -> None:
    trajectory = StraightTrajectory(Motion(Vector3(), 0.0), goal, 1.0, LIMITS)
    short, long = TimeScaling(trajectory), _WithoutUsualCase(trajectory)
    for passed_s, wanted_scale, count in course:
        for _ in range(count):
            for each in (short, long):
                each.advance(passed_s, limit_s, wanted_scale)
            assert short.time_s == long.time_s
            assert short.motion == long.motion


@given(vectors(30.0), st.floats(0.1, 3.0), st.floats(0.0, 1.0))
def test_a_leg_that_cruises_is_where_its_length_says(path: Vector3, peak_m_s: float, share: float) -> None:
    length_m = path.norm()
    if length_m < 0.5:
        return
    direction = path / length_m
    leg = Leg.along(Vector3(1.0, 2.0, 3.0), direction, length_m, (0.0, min(peak_m_s, length_m / 9.0), 0.0), 2.0)
    time_s = leg.up_s + share * leg.cruise_s
    position, velocity, acceleration = leg.at(time_s)
    assert (position - (leg.begin + direction * leg.along_m(time_s))).norm() <= 1e-9
    assert (velocity - direction * leg.peak_m_s).norm() <= 1e-9
    assert acceleration.norm() <= 1e-6


@given(
    st.lists(st.tuples(st.sampled_from([0.02, 0.3]), vectors(1.0), st.floats(-4.0, 4.0), vectors(0.3)), min_size=1),
    st.floats(-3.0, 3.0),
)
def test_an_arrival_is_assessed_by_the_mean_of_the_errors(
    course: list[tuple[float, Vector3, float, Vector3]], goal_yaw_rad: float
) -> None:
    tolerance, goal, now_s = ToleranceSettings(), Vector3(0.2, 0.1, 0.0), 0.0
    arrival, kept = Arrival(goal, goal_yaw_rad, tolerance), deque[tuple[float, Vector3, float, Vector3]]()
    for passed_s, position, yaw_rad, velocity in course:
        now_s += passed_s
        pose = Pose(position, Quaternion.from_yaw(yaw_rad))
        motion = MotionState(pose=Sample(pose, now_s), velocity=Sample(Twist(velocity), now_s))
        snapshot = Snapshot(now_s, motion=motion)
        arrival.observe(snapshot)
        kept.append((now_s, position - goal, wrap_angle(pose.yaw_rad - goal_yaw_rad), velocity))
        while len(kept) > 1 and now_s - kept[1][0] >= tolerance.dwell_s:
            kept.popleft()
        off = sum((each[1] for each in kept), Vector3()) / len(kept)
        speed = sum((each[3] for each in kept), Vector3()) / len(kept)
        turn_rad = math.atan2(sum(math.sin(each[2]) for each in kept), sum(math.cos(each[2]) for each in kept))
        is_there = off.norm() <= tolerance.position_m and speed.norm() <= tolerance.speed_m_s
        is_long = now_s - kept[0][0] >= tolerance.dwell_s
        assert arrival.has_arrived(snapshot) == (is_long and is_there and abs(turn_rad) <= tolerance.heading_rad)
