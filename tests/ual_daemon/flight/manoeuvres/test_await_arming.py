"""The wait of a take-off for the arming."""

from __future__ import annotations

import pytest

from tests.ual_daemon.flight.hand_made import Autopilot
from ual.errors import WrongStateError
from ual.types import State, TaskKind
from ual_daemon.backends.values import Cause, Control, LandedState
from ual_daemon.flight.manoeuvres.await_arming import AwaitArming


@pytest.fixture
def waiting(autopilot: Autopilot) -> AwaitArming:
    autopilot.armed = False
    task = autopilot.task(TaskKind.TAKE_OFF)
    return AwaitArming(task, lambda _: pytest.fail("it was not armed"), autopilot.now_s())


def test_what_lifts_it_off_meanwhile_ends_the_wait_and_is_named(autopilot: Autopilot, waiting: AwaitArming) -> None:
    assert not autopilot.step(waiting).has_ended
    autopilot.armed, autopilot.landed, autopilot.z = True, LandedState.IN_AIR, 2.0
    autopilot.mode, autopilot.held_by = "AUTO.LOITER", Cause.GROUND_STATION
    step = autopilot.step(waiting)
    assert step.is_taken
    assert step.error is not None
    assert step.error.metadata["by"] == Cause.GROUND_STATION.value
    assert "take_off: the ground station took over" in step.error.message


def test_the_climb_of_another_program_is_none_of_its_own(autopilot: Autopilot, waiting: AwaitArming) -> None:
    autopilot.armed, autopilot.landed, autopilot.control = True, LandedState.TAKING_OFF, Control.TAKE_OFF
    step = autopilot.step(waiting)
    assert step.is_taken
    assert step.error is not None
    assert step.error.metadata["state"] == State.TAKING_OFF.name


def test_an_arming_that_does_not_come_ends_the_wait(autopilot: Autopilot, waiting: AwaitArming) -> None:
    error = autopilot.until_end(waiting)
    assert isinstance(error, WrongStateError)
    assert "not armed within 15 s" in error.message
