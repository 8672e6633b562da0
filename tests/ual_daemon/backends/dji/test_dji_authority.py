"""Controller of an aircraft of dji_osdk_ros, by its display mode."""

from __future__ import annotations

import pytest

from ual_daemon.backends.dji import modes
from ual_daemon.backends.dji.authority import DjiAuthority


def flying() -> DjiAuthority:
    """In the air after a take-off, with authority that was granted, and setpoints since 10 s."""
    authority = DjiAuthority()
    authority.grant(is_granted=True)
    authority.note_status(modes.IN_AIR, 5.0)
    authority.observe(modes.AUTO_TAKE_OFF, 0.5, 5.1)
    authority.observe(modes.P_GPS, 1.2, 9.0)
    authority.note_setpoint(10.0)
    return authority


def test_one_that_follows_late_was_not_taken_by_others() -> None:
    """Else its motors would be theirs to stop, and a landing by setpoints would not end."""
    authority = flying()
    assert not authority.observe(modes.P_GPS, 1.2, 10.5)
    assert authority.why_lost
    assert authority.observe(modes.SDK_CONTROL, 1.2, 10.6)
    assert not authority.why_lost


@pytest.mark.parametrize(("before", "seen"), [(modes.ATTITUDE, modes.ATTITUDE), (modes.SDK_CONTROL, modes.P_GPS)])
def test_one_that_a_pilot_was_observed_to_fly_stays_taken_until_authority_is_granted(before: int, seen: int) -> None:
    authority = flying()
    authority.observe(before, 1.2, 10.2)
    authority.observe(modes.P_GPS, 1.2, 10.6)
    authority.observe(modes.SDK_CONTROL, 1.2, 11.0)
    assert authority.why_lost == f"its mode was {modes.name(seen)} in the air"
    authority.grant(is_granted=True)
    assert not authority.why_lost


def test_a_pilot_who_flies_after_a_doubt_has_taken_it() -> None:
    authority = flying()
    authority.observe(modes.P_GPS, 1.2, 10.5)
    authority.observe(modes.ATTITUDE, 1.2, 10.6)
    authority.observe(modes.SDK_CONTROL, 1.2, 11.0)
    assert authority.why_lost
