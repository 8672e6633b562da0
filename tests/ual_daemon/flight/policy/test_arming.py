"""Origin of an arming, in the order in which a caller and the updates notice it."""

from __future__ import annotations

import pytest

from ual_daemon.backends.values import Cause, Control, ControlState, LandedState, Mode, OnArming, Sample, Snapshot
from ual_daemon.flight.policy.arming import Arming

HOVER = Mode("LOITER", Control.OTHER)
MISSION = Mode("MISSION", Control.OTHER, on_arming=OnArming.FLIES)


class Updates:
    """The updates of an autopilot on the ground."""

    def __init__(self) -> None:
        self.arming = Arming()
        self._time_s = 0.0

    def show(self, mode: Mode, *, armed: bool, by: Cause | None = None) -> None:
        self._time_s += 1.0
        control = ControlState(
            armed=Sample(armed, self._time_s),
            landed=Sample(LandedState.ON_GROUND, self._time_s),
            mode=Sample(mode, self._time_s),
            held_by=by,
        )
        self.arming.follow(Snapshot(self._time_s, self._time_s, control=control), is_idle=True)


@pytest.fixture
def updates() -> Updates:
    """It is armed by UAL, and has been disarmed: a caller may know that before the next update."""
    updates = Updates()
    updates.show(HOVER, armed=False)
    updates.arming.order()
    updates.show(HOVER, armed=True)
    return updates


def test_an_arming_is_ours_that_was_ordered_before_an_update_showed_the_last_flights_end(updates: Updates) -> None:
    updates.arming.order()
    updates.show(HOVER, armed=False)
    updates.show(HOVER, armed=True)
    updates.show(MISSION, armed=True, by=Cause.GROUND_STATION)
    assert updates.arming.is_ours
    assert updates.arming.is_ours_to_end


def test_an_arming_that_failed_leaves_the_next_to_others(updates: Updates) -> None:
    updates.show(HOVER, armed=False)
    updates.arming.order()
    updates.arming.withdraw()
    updates.show(MISSION, armed=False)
    updates.show(MISSION, armed=True)
    assert not updates.arming.is_ours
    assert not updates.arming.is_ours_to_end


def test_one_order_is_for_one_arming(updates: Updates) -> None:
    updates.show(HOVER, armed=False)
    assert not updates.arming.is_ours
    updates.show(HOVER, armed=True)
    assert not updates.arming.is_ours
