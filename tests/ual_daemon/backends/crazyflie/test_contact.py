"""Whether it stands on something, by its thrust and velocity."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from ual.geometry import Vector3
from ual_daemon.backends.crazyflie.contact import GroundContact

HOVER, LEAST = 38000.0, 20000.0
RATE_S = 0.02
Phase = tuple[float, float, float]
"""Duration, thrust, velocity upwards."""

DESCENT = (3.0, HOVER, -0.4)


def assessed(*phases: Phase, rate_s: float = RATE_S) -> list[bool]:
    """Returns whether it touches, at the end of each phase."""
    contact = GroundContact()
    ends = []
    now_s = 100.0
    for duration_s, thrust, climb_m_s in phases:
        for _ in _steps(duration_s, rate_s):
            now_s += rate_s
            contact.update(thrust, Vector3(0.0, 0.0, climb_m_s), now_s)
        ends.append(contact.touches)
    return ends


def _steps(duration_s: float, rate_s: float) -> Iterator[int]:
    return iter(range(round(duration_s / rate_s)))


@pytest.mark.parametrize("rate_s", [0.01, 0.02, 0.2])
def test_it_touches_once_a_descent_has_ended_and_the_thrust_does_not_carry_it(rate_s: float) -> None:
    assert assessed((3.0, HOVER, 0.0), DESCENT, (0.6, LEAST, 0.0), rate_s=rate_s) == [False, False, True]


def test_a_bounce_does_not_hide_that_it_touches() -> None:
    assert assessed((3.0, HOVER, 0.0), DESCENT, (0.1, LEAST, 0.2), (0.5, LEAST, 0.0))[-1]


@pytest.mark.parametrize(
    "after",
    [
        (1.0, HOVER, 0.0),  # it hovers
        (1.0, LEAST, -1.0),  # it falls
        (0.2, LEAST, 0.0),  # a moment
        (1.0, 0.8 * HOVER, 0.0),
    ],
)
def test_in_the_air_it_never_touches(after: Phase) -> None:
    assert not any(assessed((3.0, HOVER, 0.0), DESCENT, after))


def test_it_does_not_touch_before_it_has_descended() -> None:
    assert not any(assessed((3.0, HOVER, 0.0), (1.0, LEAST, 0.0)))
    assert not any(assessed(DESCENT, (3.0, HOVER, 0.4), (1.0, LEAST, 0.0)))


def test_values_with_gaps_show_nothing() -> None:
    assert not any(assessed((3.0, HOVER, 0.0), DESCENT, (3.0, LEAST, 0.0), rate_s=0.3))
