"""Fixtures: a hand-made autopilot on the ground and in the air."""

from __future__ import annotations

from concurrent.futures import Future

import pytest

from tests.ual_daemon.flight.hand_made import Autopilot
from ual_daemon.backends.values import Control, LandedState


@pytest.fixture
def autopilot() -> Autopilot:
    return Autopilot()


@pytest.fixture
def ack() -> Future[None]:
    return Future()


@pytest.fixture
def flying(autopilot: Autopilot) -> Autopilot:
    autopilot.z, autopilot.landed, autopilot.control = 5.0, LandedState.IN_AIR, Control.REFERENCES
    return autopilot
