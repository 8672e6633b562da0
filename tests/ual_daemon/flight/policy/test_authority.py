"""Words about a flight that UAL has begun and others have taken."""

from __future__ import annotations

import pytest

from tests.ual_daemon.flight.hand_made import Autopilot
from ual.types import State
from ual_daemon.backends.values import Cause, Control, LandedState
from ual_daemon.flight.policy.authority import Authority


@pytest.fixture
def pilots() -> Autopilot:
    """A UAV in the air, in a mode of the safety pilot; what took it is not known yet."""
    return Autopilot(landed=LandedState.IN_AIR, mode="POSCTL", held_by=Cause.OPEN)


@pytest.fixture
def authority(pilots: Autopilot) -> Authority:
    """The authority over the same UAV, which UAL has flown until now."""
    authority, snapshot = Authority(), pilots.snapshot()
    authority.begin()
    authority.follow(State.FLYING_AUTO, snapshot)
    authority.observe(State.FLYING_AUTO, snapshot, is_sending=True)
    assert authority.is_ours
    return authority


def update(authority: Authority, pilots: Autopilot, state: State) -> None:
    pilots.time_s += 0.1
    authority.follow(state, pilots.snapshot())
    authority.observe(state, pilots.snapshot(), is_sending=False)


@pytest.mark.parametrize("state", [State.FLYING_MANUAL, State.UNINITIALIZED])
def test_what_comes_back_before_it_is_known_what_took_it_was_taken(
    authority: Authority, pilots: Autopilot, state: State
) -> None:
    """Campaign, 1710000000087: PX4 returned to OFFBOARD by itself, and the flight "has not been commanded"."""
    update(authority, pilots, state)
    pilots.mode, pilots.control, pilots.held_by = "OFFBOARD", Control.REFERENCES, None
    update(authority, pilots, State.FLYING_AUTO)
    assert not authority.is_ours
    assert authority.taken == "it is not known who flies it (mode POSCTL)"


def test_what_took_it_is_named_once_it_is_known(authority: Authority, pilots: Autopilot) -> None:
    update(authority, pilots, State.FLYING_MANUAL)
    pilots.held_by = Cause.SAFETY_PILOT
    update(authority, pilots, State.FLYING_MANUAL)
    assert authority.taken == "the safety pilot took it (mode POSCTL)"
    pilots.held_by = None
    update(authority, pilots, State.FLYING_MANUAL)
    assert authority.taken == "the safety pilot took it (mode POSCTL)"
