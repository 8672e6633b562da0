"""What every sent reference must keep: limits, and derivatives that are those of what is sent."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import pytest
from hypothesis import strategies as st

from tests.strategies import ANGLES, vectors
from ual.geometry import Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.trajectory import Motion, Trajectory, Waypoint
from ual_daemon.trajectory.envelope import (
    RAMP_S,
    acceleration_share,
    speed_share,
    turn_acceleration_limit,
    turn_jerk_limit,
)

STEP_S = 0.02
SLACK = 1e-6
"""Relative: what roundings may take."""

LIMIT_SETS = st.builds(Limits, *[st.floats(0.3, 15.0)] * 3, *[st.floats(0.3, 5.0)] * 2, st.floats(0.1, 3.0))
RESTS = st.builds(Motion, vectors(30.0), ANGLES)


def sampled(trajectory: Trajectory, step_s: float = STEP_S, most: int = 2000) -> list[Motion]:
    """A trajectory as it is sent, to its end and a little beyond."""
    count = min(most, int(trajectory.duration_s / step_s) + 3)
    return [trajectory.at(index * step_s) for index in range(count)]


def died_out(motion: Motion, limits: Limits) -> Vector3:
    """The velocity after the acceleration has died out as fast as it may."""
    return motion.velocity + motion.acceleration * (acceleration_share(motion.acceleration, limits) * RAMP_S / 2)


def assert_kept(sent: Sequence[Motion], limits: Limits, step_s: float = STEP_S, slack: float = SLACK) -> None:
    """All of it is within the limits, and so are the steps from each to the next; each derivative is that of what is
    sent. A start beyond the limits may come back within them, but never go further beyond.
    """
    jerk_m_s3 = max(limits.horizontal_acceleration_m_s2, limits.vertical_acceleration_m_s2) * 1.5 / RAMP_S
    turn_jerk = turn_jerk_limit(limits)
    most = 1.0 + slack
    speed = max(most, speed_share(sent[0].velocity, limits) + slack)
    acceleration = max(most, acceleration_share(sent[0].acceleration, limits) + slack)
    speed = max(speed, speed_share(died_out(sent[0], limits), limits) + slack)
    turn_rate = abs(sent[0].yaw_rate_rad_s) + sent[0].yaw_acceleration_rad_s2 ** 2 / turn_jerk / 2
    turn_rate = max(limits.yaw_rate_rad_s, turn_rate) * most + 1e-9
    turn_acceleration = max(turn_acceleration_limit(limits), abs(sent[0].yaw_acceleration_rad_s2)) * most + 1e-9
    for motion in sent:
        assert speed_share(motion.velocity, limits) <= speed
        assert acceleration_share(motion.acceleration, limits) <= acceleration
        assert abs(motion.yaw_rate_rad_s) <= turn_rate
        assert abs(motion.yaw_acceleration_rad_s2) <= turn_acceleration
    for one, two in itertools.pairwise(sent):
        jerk = (two.acceleration - one.acceleration) / step_s
        rounding = 1e-9 / step_s
        assert acceleration_share(jerk, limits) * RAMP_S <= most + rounding
        assert abs(two.yaw_acceleration_rad_s2 - one.yaw_acceleration_rad_s2) <= turn_jerk * step_s * most + 1e-9
        # The mean of a derivative at both ends is that in between but for a twelfth of the jerk (for positions) or a
        # quarter of its largest step (for velocities).
        velocity, acceleration_ = (one.velocity + two.velocity) / 2, (one.acceleration + two.acceleration) / 2
        far = 1e-10 * (1.0 + two.position.norm()) / step_s
        assert (
            (two.position - one.position) / step_s - velocity
        ).norm() <= jerk_m_s3 * step_s**2 / 4 + acceleration * (jerk_m_s3 * step_s**2 / 4) + far
        assert ((two.velocity - one.velocity) / step_s - acceleration_).norm() <= jerk_m_s3 * step_s / 2 + rounding
        turned = wrap_angle(two.yaw_rad - one.yaw_rad) / step_s
        rate = (one.yaw_rate_rad_s + two.yaw_rate_rad_s) / 2
        assert abs(turned - rate) <= turn_jerk * step_s**2 / 2 + 1e-8
        changed = (two.yaw_rate_rad_s - one.yaw_rate_rad_s) / step_s
        mean = (one.yaw_acceleration_rad_s2 + two.yaw_acceleration_rad_s2) / 2
        assert abs(changed - mean) <= turn_jerk * step_s / 2 + 1e-7


def moments(trajectory: Trajectory, count: int = 200) -> Iterator[tuple[float, Motion]]:
    """The same number of moments for each trajectory, its start and its end among them."""
    for i in range(count):
        time_s = trajectory.duration_s * i / count
        yield time_s, trajectory.at(time_s)
    yield trajectory.duration_s, trajectory.end()


def assert_rests_at(motion: Motion, position: Vector3, yaw_rad: float) -> None:
    """It stands exactly there."""
    assert motion.position == position
    assert wrap_angle(motion.yaw_rad - yaw_rad) == pytest.approx(0.0, abs=1e-6)
    assert motion.velocity.norm() == motion.acceleration.norm() == motion.yaw_rate_rad_s == 0.0


def distance_from_line(point: Vector3, begin: Vector3, end: Vector3) -> float:
    """How far a point is from a piece of a line."""
    way, offset = end - begin, point - begin
    if way.norm() < 1e-9:
        return offset.norm()
    along = max(0.0, min(1.0, offset.dot(way) / way.dot(way)))
    return (offset - way * along).norm()


def distance_from_path(point: Vector3, points: Sequence[Vector3]) -> float:
    """How far a point is from a polyline."""
    return min(distance_from_line(point, a, b) for a, b in itertools.pairwise(points))


def assert_straight_between_bends(trajectory: Trajectory) -> None:
    """Between what it says are its bends, it is on the line from the end of one to the beginning of the next."""
    spans = [(0.0, 0.0), *trajectory.bends_s(), (trajectory.duration_s, trajectory.duration_s)]
    times_s = [time_s for span in spans for time_s in span]
    assert times_s == sorted(times_s)
    for (_, begin_s), (end_s, _) in itertools.pairwise(spans):
        begin, end = trajectory.at(begin_s).position, trajectory.at(end_s).position
        for share in range(1, 20):
            place = trajectory.at(begin_s + (end_s - begin_s) * share / 20).position
            assert distance_from_line(place, begin, end) <= 1e-6 * (1.0 + (end - begin).norm())


def waypoints(*places: tuple[float, float, float]) -> list[Waypoint]:
    """Waypoints without headings."""
    return [Waypoint(Vector3(*place)) for place in places]
