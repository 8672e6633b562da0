"""The handover to the autopilot at the end of the daemon."""

from __future__ import annotations

from concurrent.futures import Future
from typing import cast

import pytest

from tests.ual_daemon.flight.hand_made import Autopilot
from ual.errors import LinkLostError
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Control, Freshness, LandedState, Snapshot
from ual_daemon.flight.shutdown import Shutdown


class Holding:
    """Backend as the shutdown needs it, over an autopilot that is set by hand. Its hold is never answered."""

    freshness = Freshness()

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self.held: Future[None] = Future()
        self.holds_count = 0

    def snapshot(self) -> Snapshot:
        return self._autopilot.snapshot()

    def hold(self) -> Future[None]:
        self.holds_count += 1
        return self.held


@pytest.mark.parametrize("control", [Control.LAND, Control.OTHER, Control.TAKE_OFF])
def test_the_hold_is_not_sent_again_once_others_fly_or_land_it(autopilot: Autopilot, control: Control) -> None:
    autopilot.control, autopilot.landed = Control.REFERENCES, LandedState.IN_AIR
    backend = Holding(autopilot)
    shutdown = Shutdown(cast("Backend", backend), lambda: True)
    assert not shutdown.step(autopilot.snapshot())
    assert not backend.held.cancelled()
    autopilot.control = control
    assert shutdown.step(autopilot.snapshot())
    shutdown.finish()
    assert backend.held.cancelled()


def test_the_hold_is_not_sent_again_after_the_end(autopilot: Autopilot) -> None:
    autopilot.control, autopilot.landed = Control.REFERENCES, LandedState.IN_AIR
    backend = Holding(autopilot)
    shutdown = Shutdown(cast("Backend", backend), lambda: True)
    assert not shutdown.step(autopilot.snapshot())
    shutdown.finish()
    assert backend.held.cancelled()


def test_a_state_that_is_not_known_for_a_moment_is_waited_for(autopilot: Autopilot) -> None:
    """As after a stall of this computer: without the hold its failsafe would fly it."""
    autopilot.control, autopilot.landed, autopilot.silent_s = Control.REFERENCES, LandedState.IN_AIR, 2.3
    backend = Holding(autopilot)
    shutdown = Shutdown(cast("Backend", backend), lambda: True)
    assert not shutdown.step(autopilot.snapshot())
    assert backend.holds_count == 0
    autopilot.silent_s = 0.0
    assert not shutdown.step(autopilot.snapshot())
    assert backend.holds_count == 1
    autopilot.control = Control.OTHER
    assert shutdown.step(autopilot.snapshot())


def test_a_state_that_stays_unknown_is_waited_for_5_s(autopilot: Autopilot) -> None:
    autopilot.control, autopilot.landed, autopilot.silent_s = Control.REFERENCES, LandedState.IN_AIR, 2.3
    shutdown = Shutdown(cast("Backend", Holding(autopilot)), lambda: True)
    assert not shutdown.step(autopilot.snapshot())
    autopilot.time_s += 4.9
    assert not shutdown.step(autopilot.snapshot())
    autopilot.time_s += 0.2
    assert shutdown.step(autopilot.snapshot())
    shutdown.finish()
    with pytest.raises(LinkLostError, match="its state is not known: "):
        shutdown.future.result()


def test_each_time_in_which_the_state_is_not_known_is_waited_for_anew(autopilot: Autopilot) -> None:
    autopilot.control, autopilot.landed, autopilot.silent_s = Control.REFERENCES, LandedState.IN_AIR, 2.3
    shutdown = Shutdown(cast("Backend", Holding(autopilot)), lambda: True)
    assert not shutdown.step(autopilot.snapshot())
    autopilot.silent_s = 0.0
    autopilot.time_s += 1.0
    assert not shutdown.step(autopilot.snapshot())  # the hold is sent, and shows no effect yet
    autopilot.silent_s = 2.3
    autopilot.time_s += 4.5
    assert not shutdown.step(autopilot.snapshot())


@pytest.mark.parametrize(("landed", "is_ours"), [(LandedState.ON_GROUND, True), (LandedState.IN_AIR, False)])
def test_an_unknown_state_on_the_ground_or_of_others_is_not_waited_for(
    autopilot: Autopilot, landed: LandedState, is_ours: bool
) -> None:
    autopilot.control, autopilot.landed, autopilot.silent_s = Control.REFERENCES, landed, 2.3
    assert Shutdown(cast("Backend", Holding(autopilot)), lambda: is_ours).step(autopilot.snapshot())
