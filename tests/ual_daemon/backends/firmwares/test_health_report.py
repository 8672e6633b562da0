"""Failing checks before arming, by an autopilot's texts."""

from __future__ import annotations

from ual_daemon.backends.firmwares.health_report import READY_TEXT_S, TEXTS_S, HealthReport


def failing(health: HealthReport, now_s: float, *, is_ready: bool) -> tuple[str, ...]:
    return health.report(now_s, is_ready, 0, lambda: 0.0).failing_checks


def test_a_check_that_fails_is_reported_before_its_status_comes() -> None:
    """ArduPilot: the text came 0.2 s before the SYS_STATUS, and was taken for an old one (campaign, 13400017)."""
    health = HealthReport()
    health.on_text("PreArm: Battery 1 low voltage failsafe", 10.0)
    assert failing(health, 10.05, is_ready=True) == ("Battery 1 low voltage failsafe",)
    assert failing(health, 10.2, is_ready=False) == ("Battery 1 low voltage failsafe",)
    assert failing(health, 10.0 + TEXTS_S - 1.0, is_ready=False) == ("Battery 1 low voltage failsafe",)
    assert failing(health, 10.0 + TEXTS_S - 0.9, is_ready=True) == ()


def test_a_check_that_passes_again_is_over() -> None:
    health = HealthReport()
    health.on_text("PreArm: Battery 1 low voltage failsafe", 10.0)
    assert failing(health, 10.0 + READY_TEXT_S + 0.1, is_ready=True) == ()
    assert failing(health, 10.0 + READY_TEXT_S + 0.2, is_ready=False) == ()
