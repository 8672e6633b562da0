"""Texts of an autopilot that are reported as severe, and the duration."""

from __future__ import annotations

import pytest

from ual_daemon.backends.engine.severe_texts import SEVERE, TEXT_S, SevereTexts

LONG = "EKF primary changed: the first fifty bytes of text"


def texts_of(found: SevereTexts, now_s: float) -> list[str]:
    return [each.text for each in found.fresh(now_s)]


@pytest.mark.parametrize(("severity", "is_told"), [(0, True), (SEVERE, True), (SEVERE + 1, False), (6, False)])
def test_what_is_critical_or_worse_is_reported(severity: int, is_told: bool) -> None:
    found = SevereTexts()
    found.on_text("Potential Thrust Loss (3)", severity, 1.0)
    assert texts_of(found, 1.0) == ["Potential Thrust Loss (3)"] * is_told


def test_a_text_ages_and_one_that_comes_again_is_new() -> None:
    found = SevereTexts()
    found.on_text("EKF variance", SEVERE, 0.0)
    found.on_text("Crash: Disarming", 0, 10.0)
    found.on_text("EKF variance", SEVERE, 20.0)
    assert texts_of(found, TEXT_S + 0.1) == ["Crash: Disarming", "EKF variance"]
    assert texts_of(found, TEXT_S + 10.1) == ["EKF variance"]
    assert not texts_of(found, TEXT_S + 20.1)


def test_a_text_ends_by_the_one_that_says_that_it_is_over() -> None:
    found = SevereTexts()
    found.on_text("GPS Glitch or Compass error", SEVERE, 0.0)
    found.on_text("Glitch cleared", SEVERE, 1.0, ends=("GPS Glitch",))
    assert not texts_of(found, 1.0)


def test_checks_before_arming_are_reported_as_checks() -> None:
    found = SevereTexts()
    found.on_text("PreArm: Mode requires mission", SEVERE, 0.0)
    assert not texts_of(found, 0.0)


def test_the_next_part_of_a_long_text_completes_it() -> None:
    found = SevereTexts()
    found.on_text(LONG, SEVERE, 0.0)
    found.on_text(f"{LONG} and more", SEVERE, 0.1)
    assert texts_of(found, 0.1) == [f"{LONG} and more"]


def test_a_flood_of_texts_keeps_the_newest() -> None:
    found = SevereTexts()
    for number in range(100):
        found.on_text(f"text {number}", SEVERE, number * 0.01)
    assert texts_of(found, 1.0)[-1] == "text 99"
    assert len(texts_of(found, 1.0)) == 8


def test_it_is_the_same_object_while_nothing_changes() -> None:
    found = SevereTexts()
    found.on_text("EKF variance", SEVERE, 0.0)
    assert found.fresh(1.0) is found.fresh(2.0)
