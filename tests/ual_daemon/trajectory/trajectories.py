"""Requirements of every sent reference: limits, and derivatives that are those of the sent values."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from operator import attrgetter
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import strategies as st

from tests.strategies import ANGLES, vectors
from ual.geometry import Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.trajectory import Motion, PathWaypoint, Trajectory
from ual_daemon.trajectory.envelope import (
    RAMP_S,
    acceleration_share,
    speed_share,
    turn_acceleration_limit,
    turn_jerk_limit,
)

Array: TypeAlias = npt.NDArray[np.float64]

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


_VALUES = attrgetter(
    *(f"{vector}.{axis}" for vector in ("position", "velocity", "acceleration") for axis in "xyz"),
    *("yaw_rad", "yaw_rate_rad_s", "yaw_acceleration_rad_s2"),
)


class Columns:
    """Sent values, one array for each: all moments are checked at once, which is many times as quick."""

    def __init__(self, sent: Sequence[Motion]) -> None:
        values = np.fromiter(itertools.chain.from_iterable(map(_VALUES, sent)), np.float64).reshape(len(sent), 12)
        self.position, self.velocity, self.acceleration = values[:, 0:3], values[:, 3:6], values[:, 6:9]
        self.yaw_rad, self.yaw_rate_rad_s, self.yaw_acceleration_rad_s2 = values[:, 9:12].T


def speed_shares(velocities: Array, limits: Limits) -> Array:
    """`speed_share` of each row."""
    vertical = np.where(velocities[:, 2] > 0, limits.climb_speed_m_s, limits.descent_speed_m_s)
    horizontal = np.hypot(velocities[:, 0], velocities[:, 1]) / limits.horizontal_speed_m_s
    return np.maximum(horizontal, np.abs(velocities[:, 2]) / vertical)


def acceleration_shares(accelerations: Array, limits: Limits) -> Array:
    """`acceleration_share` of each row."""
    horizontal = np.hypot(accelerations[:, 0], accelerations[:, 1]) / limits.horizontal_acceleration_m_s2
    return np.maximum(horizontal, np.abs(accelerations[:, 2]) / limits.vertical_acceleration_m_s2)


def assert_kept(sent: Sequence[Motion], limits: Limits, step_s: float = STEP_S, slack: float = SLACK) -> None:
    """All of it is within the limits, and so are the steps from each to the next; each derivative is that of what is
    sent. A start beyond the limits may come back within them, but never go further beyond.
    """
    turn_jerk = turn_jerk_limit(limits)
    most = 1.0 + slack
    speed = max(most, speed_share(sent[0].velocity, limits) + slack)
    acceleration = max(most, acceleration_share(sent[0].acceleration, limits) + slack)
    speed = max(speed, speed_share(died_out(sent[0], limits), limits) + slack)
    turn_rate = abs(sent[0].yaw_rate_rad_s) + sent[0].yaw_acceleration_rad_s2 ** 2 / turn_jerk / 2
    turn_rate = max(limits.yaw_rate_rad_s, turn_rate) * most + 1e-9
    turn_acceleration = max(turn_acceleration_limit(limits), abs(sent[0].yaw_acceleration_rad_s2)) * most + 1e-9
    columns = Columns(sent)
    assert np.all(speed_shares(columns.velocity, limits) <= speed)
    assert np.all(acceleration_shares(columns.acceleration, limits) <= acceleration)
    assert np.all(np.abs(columns.yaw_rate_rad_s) <= turn_rate)
    assert np.all(np.abs(columns.yaw_acceleration_rad_s2) <= turn_acceleration)
    _assert_steps_kept(columns, limits, step_s, most, acceleration)


def _assert_steps_kept(columns: Columns, limits: Limits, step_s: float, most: float, acceleration: float) -> None:
    """The mean of a derivative at both ends is that in between but for a twelfth of the jerk (for positions) or a
    quarter of its largest step (for velocities).
    """
    jerk_m_s3 = max(limits.horizontal_acceleration_m_s2, limits.vertical_acceleration_m_s2) * 1.5 / RAMP_S
    turn_jerk = turn_jerk_limit(limits)
    rounding = 1e-9 / step_s
    jerk = np.diff(columns.acceleration, axis=0) / step_s
    assert np.all(acceleration_shares(jerk, limits) * RAMP_S <= most + rounding)
    assert np.all(np.abs(np.diff(columns.yaw_acceleration_rad_s2)) <= turn_jerk * step_s * most + 1e-9)
    moved = np.diff(columns.position, axis=0) / step_s - _means(columns.velocity)
    far = 1e-10 * (1.0 + np.linalg.norm(columns.position[1:], axis=1)) / step_s
    off = jerk_m_s3 * step_s**2 / 4 + acceleration * (jerk_m_s3 * step_s**2 / 4)
    assert np.all(np.linalg.norm(moved, axis=1) <= off + far)
    hastened = np.diff(columns.velocity, axis=0) / step_s - _means(columns.acceleration)
    assert np.all(np.linalg.norm(hastened, axis=1) <= jerk_m_s3 * step_s / 2 + rounding)
    turned = np.diff(columns.yaw_rad)
    rotated = (turned - math.tau * np.round(turned / math.tau)) / step_s
    assert np.all(np.abs(rotated - _means(columns.yaw_rate_rad_s)) <= turn_jerk * step_s**2 / 2 + 1e-8)
    changed = np.diff(columns.yaw_rate_rad_s) / step_s
    assert np.all(np.abs(changed - _means(columns.yaw_acceleration_rad_s2)) <= turn_jerk * step_s / 2 + 1e-7)


def _means(column: Array) -> Array:
    """The mean of each value and the next."""
    return (column[:-1] + column[1:]) / 2


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


def path_distance(point: Vector3, begin: Vector3, end: Vector3) -> float:
    """Returns the distance of a point from a piece of a line."""
    way, offset = end - begin, point - begin
    if way.norm() < 1e-9:
        return offset.norm()
    along = max(0.0, min(1.0, offset.dot(way) / way.dot(way)))
    return (offset - way * along).norm()


def distance_from_path(point: Vector3, points: Sequence[Vector3]) -> float:
    """Returns the distance of a point from a polyline."""
    return min(path_distance(point, a, b) for a, b in itertools.pairwise(points))


def assert_straight_between_bends(trajectory: Trajectory) -> None:
    """Between what it says are its bends, it is on the line from the end of one to the beginning of the next."""
    spans = [(0.0, 0.0), *trajectory.bends_s(), (trajectory.duration_s, trajectory.duration_s)]
    times_s = [time_s for span in spans for time_s in span]
    assert times_s == sorted(times_s)
    for (_, begin_s), (end_s, _) in itertools.pairwise(spans):
        begin, end = trajectory.at(begin_s).position, trajectory.at(end_s).position
        for share in range(1, 20):
            place = trajectory.at(begin_s + (end_s - begin_s) * share / 20).position
            assert path_distance(place, begin, end) <= 1e-6 * (1.0 + (end - begin).norm())


def waypoints(*places: tuple[float, float, float]) -> list[PathWaypoint]:
    """Waypoints without headings."""
    return [PathWaypoint(Vector3(*place)) for place in places]
