"""Reduced rates where a link loses much, on links that are models: overrun, bad, or both."""

import itertools
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual_daemon.backends.mavlink.session.rate_fit import (
    GROW_S,
    HIGH_LOSS,
    HIGHEST_LEVEL,
    LOSS_DURATION_S,
    RETRY_S,
    RateFit,
)

UNUSED, USED = 0.7, 0.3
"""Parts of what the autopilot sends."""


def demand(fit: RateFit) -> float:
    """The part of all that is asked for at its level."""
    return (USED + UNUSED) if not fit.level else 0.05 + USED * fit.share


def radio(capacity: float, bad: float = 0.0) -> Callable[[RateFit], float]:
    """The loss of one that carries a part of all, and loses another part of that at random."""
    return lambda fit: 1.0 - min(1.0, capacity / demand(fit)) * (1.0 - bad)


def settle(loss_of: Callable[[RateFit], float], duration_s: float = 300.0, *, is_armed: bool = True) -> RateFit:
    fit, changes = RateFit(), []
    lately: list[float] = []
    for second in range(round(duration_s)):
        lately = [*lately, loss_of(fit)][-round(LOSS_DURATION_S) :]
        if fit.update(float(second), sum(lately) / len(lately), is_armed=is_armed):
            changes.append(second)
    assert len(changes) <= 2 + 2 * duration_s / RETRY_S
    return fit


@pytest.mark.parametrize(
    ("capacity", "level"),
    [(1.0, 0), (0.75, 0), (0.5, 1), (0.36, 1), (0.2, 2), (0.125, 3), (0.05, HIGHEST_LEVEL), (0.01, HIGHEST_LEVEL)],
)
def test_an_overrun_radio_is_requested_as_much_as_it_carries(capacity: float, level: int) -> None:
    assert settle(radio(capacity)).level == level


@pytest.mark.parametrize("loss", [0.1, 0.3, 0.5, 0.9])
def test_a_bad_link_gets_requests_for_all(loss: float) -> None:
    """Each try is taken back, and they become rare."""
    fit = RateFit()
    levels = []
    for second in range(1000):
        fit.update(float(second), loss, is_armed=True)
        levels.append(fit.level)
    assert set(levels) <= {0, 1}
    tries_count = sum(later > earlier for earlier, later in itertools.pairwise(levels))
    assert tries_count == (5 if loss >= HIGH_LOSS else 0)
    assert sum(levels) <= tries_count * (LOSS_DURATION_S + 2.0)


def test_one_that_is_bad_and_overrun_is_requested_what_it_carries() -> None:
    assert settle(radio(0.2, bad=0.15), 600.0).level in (2, 3)


def test_a_short_loss_changes_nothing() -> None:
    fit = RateFit()
    assert not any(fit.update(float(second), 0.9 * (second % 10 < 8), is_armed=True) for second in range(100))


def test_more_is_requested_again_on_the_ground_once_the_link_is_good() -> None:
    fit = settle(radio(0.2))
    for is_armed in (True, False):
        changed = [fit.update(1000.0 + second, 0.0, is_armed=is_armed) for second in range(round(4 * GROW_S))]
        assert any(changed) is not is_armed
    assert fit.level < 2


@given(st.lists(st.floats(0.0, 1.0), max_size=200))
def test_no_losses_lead_beyond_the_levels(losses: list[float]) -> None:
    fit = RateFit()
    for second, loss in enumerate(losses):
        fit.update(float(second), loss, is_armed=False)
        assert 0 <= fit.level <= HIGHEST_LEVEL
        assert 0.125 <= fit.share <= 1.0
