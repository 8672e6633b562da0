"""A verdict needs agreeing samples, waits for the end of a flight, and ends with its data."""

from __future__ import annotations

import pytest

from ual_daemon.backends.engine.agreement import FIRST_VERDICT_S, SAMPLE_LAPSE_S, Agreement, AirborneWatch
from ual_daemon.backends.values import LandedState, Sample


def noted(agreement: Agreement[str], *samples: tuple[str, float], is_flying: bool = False) -> list[str]:
    """The verdict after each sample, and the time at which it comes."""
    values = []
    for value, now_s in samples:
        agreement.note(value, now_s, is_flying=is_flying)
        values.append(agreement.value)
    return values


def test_samples_in_a_row_that_last_make_a_verdict() -> None:
    assert noted(Agreement("a"), ("a", 0.0), ("b", 1.0), ("b", 1.5), ("b", 2.0)) == ["a", "a", "a", "b"]


@pytest.mark.parametrize(
    "samples",
    [
        [("b", 1.0), ("b", 1.01), ("b", 1.02), ("b", 1.03)],  # a burst
        [("b", 1.0), ("a", 1.1), ("b", 1.5), ("a", 1.6), ("b", 2.0), ("a", 2.1), ("b", 2.5)],  # contradicted
        [("b", 1.0), ("c", 1.5), ("b", 2.0), ("c", 2.5), ("b", 3.0)],  # they do not agree
        [("b", 1.0), ("b", 1.0 + SAMPLE_LAPSE_S + 0.1), ("b", 1.2 + 2 * SAMPLE_LAPSE_S)],  # too far apart
    ],
)
def test_other_samples_make_none(samples: list[tuple[str, float]]) -> None:
    assert set(noted(Agreement("a"), ("a", 0.0), *samples)) == {"a"}


def test_what_samples_agree_on_in_flight_is_pending_until_the_landing() -> None:
    agreement = Agreement("a")
    assert set(noted(agreement, ("a", 0.0), ("b", 1.0), ("b", 1.5), ("b", 2.0), is_flying=True)) == {"a"}
    assert agreement.pending == "b"
    assert not agreement.tick(2.1, is_flying=True)
    assert agreement.tick(2.2, is_flying=False)
    assert agreement.value == "b"
    assert not agreement.is_open


@pytest.mark.parametrize("end", ["no more samples", "a contradiction"])
def test_what_is_pending_is_forgotten_with_its_samples(end: str) -> None:
    agreement = Agreement("a")
    noted(agreement, ("a", 0.0), ("b", 1.0), ("b", 1.5), ("b", 2.0), is_flying=True)
    if end == "a contradiction":
        agreement.note("a", 2.1, is_flying=True)
    agreement.tick(2.1 + SAMPLE_LAPSE_S, is_flying=True)
    assert not agreement.tick(2.2 + SAMPLE_LAPSE_S, is_flying=False)
    assert (agreement.value, agreement.pending) == ("a", None)


def test_a_first_verdict_counts_in_flight_and_a_late_one_does_not() -> None:
    assert noted(Agreement("a"), ("b", 0.0), ("b", 0.5), ("b", 1.0), is_flying=True)[-1] == "b"
    late = Agreement("a")
    late.tick(0.0, is_flying=True)
    since_s = FIRST_VERDICT_S + 0.1
    assert noted(late, *(("b", since_s + after_s) for after_s in (0.0, 0.5, 1.0)), is_flying=True)[-1] == "a"


def test_a_verdict_whose_samples_have_ended_yields() -> None:
    agreement = Agreement("", ends_s=5.0)
    noted(agreement, ("b", 0.0), ("b", 0.5), ("b", 1.0))
    agreement.tick(5.9, is_flying=True)
    assert agreement.value == "b"
    assert agreement.tick(6.1, is_flying=True)
    assert agreement.value == ""
    assert noted(Agreement("a", ended_s=4.0), ("a", 0.0), ("b", 4.1), ("b", 4.2))[-1] == "b"
    assert noted(Agreement("a"), ("a", 0.0), ("b", 4.1), ("b", 4.2))[-1] == "a"


def test_a_flight_ends_on_the_ground_after_a_while_and_with_its_data() -> None:
    seen, armed = AirborneWatch(), Sample(value=True, time_s=10.0)
    seen.update(armed, Sample(LandedState.IN_AIR, 10.0), 10.0)
    seen.update(armed, Sample(LandedState.ON_GROUND, 10.1), 10.1)  # one sample ends none
    assert seen.is_flying(10.9)
    assert not seen.is_flying(11.1)
    seen.update(armed, Sample(LandedState.IN_AIR, 10.2), 13.0)  # nothing has said for long that it is armed
    assert not seen.is_flying(13.0)
