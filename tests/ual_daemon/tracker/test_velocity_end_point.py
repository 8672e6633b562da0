"""The place to which a velocity leads: what is computed in numbers is what vectors show, one step after the other."""

from __future__ import annotations

import math
from random import Random

from hypothesis import given
from hypothesis import strategies as st

from ual.geometry import Vector3
from ual_daemon.backends.values import VelocityResponse
from ual_daemon.tracker import velocity_end_point
from ual_daemon.tracker.velocity_end_point import ExpectedMotion, MotionEstimate, VelocityEndPoint

PARTS = st.floats(-8.0, 8.0)
VECTORS = st.builds(Vector3, PARTS, PARTS, PARTS)
RESPONSES = st.builds(
    VelocityResponse,
    time_s=st.sampled_from((0.01, 0.3, 0.6)),
    delay_s=st.sampled_from((0.0, 0.1)),
    acceleration_m_s2=st.sampled_from((0.5, 3.0, math.inf)),
    rise_s=st.sampled_from((0.0, 0.2)),
    jerk_m_s3=st.sampled_from((1.0, 20.0, math.inf)),
)
STEP_S = 0.03


def limited(v: Vector3, most: float) -> Vector3:
    return v * min(1.0, most / max(v.norm(), 1e-9))


def share(step_s: float, time_s: float) -> float:
    return 1.0 - math.exp(-step_s / time_s) if time_s else 1.0


class Slowly:
    """The same, a vector at a time."""

    def __init__(self, p: Vector3, v: Vector3, a: Vector3, response: VelocityResponse) -> None:
        self.p, self.v, self.a, self.heard = p, v, a, v + a * response.time_s

    def step(self, c: Vector3, step_s: float, response: VelocityResponse) -> None:
        self.heard += (c - self.heard) * share(step_s, response.delay_s)
        wanted = (self.heard - self.v) / max(response.time_s, step_s)
        change = (limited(wanted, response.acceleration_m_s2) - self.a) * share(step_s, response.rise_s)
        self.a += limited(change, response.jerk_m_s3 * step_s)
        self.p = self.p + self.v * step_s + self.a * (step_s * step_s / 2)
        self.v += self.a * step_s


@given(
    st.tuples(VECTORS, VECTORS, VECTORS),
    RESPONSES,
    st.lists(st.tuples(VECTORS, st.sampled_from((0.0, 0.01, 0.03, 0.033, 0.1, 0.2))), max_size=20),
)
def test_time_passes_as_if_in_steps(
    start: tuple[Vector3, Vector3, Vector3], response: VelocityResponse, flown: list[tuple[Vector3, float]]
) -> None:
    expected, slowly = ExpectedMotion(*start, response), Slowly(*start, response)
    for commanded, passed_s in flown:
        expected.advance(commanded, passed_s, response)
        count = math.ceil(passed_s / STEP_S)
        for _ in range(count):
            slowly.step(commanded, passed_s / count, response)
        assert (expected.position - slowly.p).norm() <= 1e-9
        assert (expected.velocity - slowly.v).norm() <= 1e-9


class SlowEndPoint(VelocityEndPoint):
    """The same, a vector at a time, and with each direction looked for in each step."""

    def step(self, commanded: Vector3, seen: MotionEstimate, passed_s: float, response: VelocityResponse) -> Vector3:
        here, velocity, error = seen
        self._expected.advance(commanded, passed_s, response)
        self._find_free(commanded, here, velocity - error)
        lag = limited(self._held(self._expected.position - here), velocity_end_point.MOST_LAG_M)
        self._expected.position = here + lag
        added = Vector3() if response.holds_place else limited(error, velocity_end_point._MOST_VELOCITY_ERROR_M_S)
        wanted = limited(lag * velocity_end_point._POSITION_GAIN + added, velocity_end_point.MOST_CORRECTION_M_S)
        before = wanted if self.correction is None else self.correction
        self.correction = before + limited(wanted - before, velocity_end_point.MOST_CHANGE_M_S2 * passed_s)
        return self.correction


@given(RESPONSES, st.integers(0, 10**6), st.sampled_from((0.3, 1.0, 3.0)))
def test_what_is_added_is_what_vectors_show(response: VelocityResponse, seed: int, fast: float) -> None:
    """Also where a gust carries the UAV, and where something stops it."""
    both = tuple(
        kind(ExpectedMotion(Vector3(), Vector3(), Vector3(), response)) for kind in (VelocityEndPoint, SlowEndPoint)
    )
    chance, here = Random(seed), Vector3()
    velocity = commanded = error = Vector3()
    is_stopped = False
    for _ in range(60):
        if chance.random() < 0.15:
            commanded = Vector3(chance.gauss(0.0, fast), chance.gauss(0.0, fast), 0.0)
            error = Vector3(chance.gauss(0.0, 0.3), chance.gauss(0.0, 0.3), 0.0)
            is_stopped = chance.random() < 0.3
        if chance.random() < 0.05:
            velocity += Vector3(chance.gauss(0.0, 3.0), chance.gauss(0.0, 3.0), 0.0)
        velocity += (commanded - velocity) * 0.1
        velocity = Vector3() if is_stopped else velocity
        here += velocity * 0.04
        one, other = (
            each.step(commanded, MotionEstimate(here, velocity + error, error), 0.04, response) for each in both
        )
        assert (one - other).norm() <= 1e-9
        assert len(both[0]._free) == len(both[1]._free)
