"""Taking control back from the safety pilot."""

from __future__ import annotations

from concurrent.futures import Future

from tests.ual_daemon.flight.hand_made import Autopilot, sent
from ual.errors import TaskAbortedError
from ual.geometry import Vector3
from ual.types import Limits, State
from ual_daemon.backends.values import Control, LandedState, PositionSetpoint
from ual_daemon.flight.manoeuvres.recover import Recover


def test_recovering_holds_where_it_is_until_the_mode_changes(flying: Autopilot, ack: Future[None]) -> None:
    flying.control = Control.OTHER
    recover = Recover(sent(ack, flying), Limits(), lambda: ack, lambda _: None)
    ack.set_result(None)
    setpoint = flying.step(recover).setpoint
    assert isinstance(setpoint, PositionSetpoint)
    assert setpoint.position == Vector3(1.0, 2.0, 5.0)
    flying.control = Control.REFERENCES
    step = flying.step(recover)
    assert step.has_ended
    assert step.error is None
    assert step.next_reference is not None


def test_recovering_ends_when_the_uav_has_landed(flying: Autopilot, ack: Future[None]) -> None:
    flying.control = Control.OTHER
    recover = Recover(sent(ack, flying), Limits(), lambda: ack, lambda _: None)
    flying.landed = LandedState.ON_GROUND
    error = flying.step(recover).error
    assert isinstance(error, TaskAbortedError)
    assert error.state == State.LANDED_ARMED.name


def test_recovering_ends_when_the_pilot_selects_another_mode(flying: Autopilot, ack: Future[None]) -> None:
    """A command that is repeated because no answer came would take control from the pilot."""
    flying.control, flying.mode = Control.OTHER, "HOLD"
    recover = Recover(sent(ack, flying), Limits(), lambda: ack, lambda _: None)
    assert not flying.step(recover).has_ended
    flying.mode = "POSCTL"
    step = flying.step(recover)
    assert step.is_taken
    assert isinstance(step.error, TaskAbortedError)
    assert step.error.metadata["by"] == "safety pilot"
