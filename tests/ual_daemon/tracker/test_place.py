"""How a vehicle is expected to move: many steps at once are those steps one by one."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from ual.geometry import Vector3
from ual_daemon.backends.values import VelocityResponse
from ual_daemon.tracker.place import ExpectedMotion

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
