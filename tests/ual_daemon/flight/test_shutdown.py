"""The handover to the autopilot at the end of the daemon."""

from __future__ import annotations

from concurrent.futures import Future
from typing import cast

import pytest

from tests.ual_daemon.flight.hand_made import Autopilot
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Control, Freshness, LandedState, Snapshot
from ual_daemon.flight.shutdown import Shutdown


class Holding:
    """What the shutdown needs of a backend, over an autopilot that is set by hand. Its hold is never answered."""

    freshness = Freshness()

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self.held: Future[None] = Future()

    def snapshot(self) -> Snapshot:
        return self._autopilot.snapshot()

    def hold(self) -> Future[None]:
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
