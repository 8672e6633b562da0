"""Taking control back from the safety pilot."""

from __future__ import annotations

from concurrent.futures import Future

from typing_extensions import override

from tests.ual_daemon.flight.hand_made import Autopilot, sent
from ual.errors import RejectedByAutopilotError, TaskAbortedError, UalTimeoutError
from ual.geometry import Vector3
from ual.types import State, TaskKind
from ual_daemon.backends.values import Control, LandedState, PositionSetpoint, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre, Step
from ual_daemon.flight.manoeuvres.recover import Recover
from ual_daemon.flight.state import Estimate


def test_recovering_holds_where_it_is_until_the_mode_changes(flying: Autopilot, ack: Future[None]) -> None:
    flying.control = Control.OTHER
    recover = Recover(sent(ack, flying), lambda: ack, lambda _: None)
    ack.set_result(None)
    setpoint = flying.step(recover).setpoint
    assert isinstance(setpoint, PositionSetpoint)
    assert setpoint.position == Vector3(1.0, 2.0, 5.0)
    flying.control = Control.REFERENCES
    step = flying.step(recover)
    assert step.has_ended
    assert step.error is None
    assert step.is_to_stop


def test_recovering_ends_when_the_uav_has_landed(flying: Autopilot, ack: Future[None]) -> None:
    flying.control = Control.OTHER
    recover = Recover(sent(ack, flying), lambda: ack, lambda _: None)
    flying.landed = LandedState.ON_GROUND
    error = flying.step(recover).error
    assert isinstance(error, TaskAbortedError)
    assert error.state == State.LANDED_ARMED.name


def test_recovering_ends_when_the_pilot_selects_another_mode(flying: Autopilot, ack: Future[None]) -> None:
    """A command that is repeated because no answer came would take control from the pilot."""
    flying.control, flying.mode = Control.OTHER, "HOLD"
    recover = Recover(sent(ack, flying), lambda: ack, lambda _: None)
    assert not flying.step(recover).has_ended
    flying.mode = "POSCTL"
    step = flying.step(recover)
    assert step.is_taken
    assert isinstance(step.error, TaskAbortedError)
    assert step.error.metadata["by"] == "safety pilot"


def test_a_mission_that_does_not_give_the_control_back_says_in_which_mode_the_autopilot_stays(
    flying: Autopilot,
) -> None:
    """It said that the mission goes on, also where that had ended and PX4 held the UAV in AUTO.LOITER."""
    ack, task = Future[None](), flying.task(TaskKind.MISSION)
    flying.control, flying.mode = Control.OTHER, "AUTO.LOITER"
    command = AutopilotCommand("take control")
    recover = Recover(command, lambda: ack, lambda _: None, name="mission", task=task)
    recover.replaces(_Mission("mission", None))
    flying.step(recover)
    ack.set_exception(UalTimeoutError("PX4 has not answered"))
    error = flying.step(recover).error
    assert error is not None
    assert error.message == (
        "PX4 has not answered; the autopilot stays in its mode (AUTO.LOITER) and flies by itself: "
        "recover_from_manual takes control back"
    )


def test_it_begins_anew_in_the_mode_to_which_a_mission_led_before_its_first_step(flying: Autopilot) -> None:
    """PX4 tells the end of its mission up to 1 s before the mode that follows. The engine ends a command over that."""
    acks = [Future[None]() for _ in range(2)]
    left = iter(acks)
    flying.control, flying.mode = Control.OTHER, "AUTO.MISSION"
    recover = Recover(AutopilotCommand("take our references"), lambda: next(left), lambda _: None)
    recover.replaces(_Mission("mission", None))
    recover.begins_in(flying.mode)
    recover.send()
    acks[0].set_exception(RejectedByAutopilotError("not sent: the mode became AUTO.LOITER"))
    flying.mode = "AUTO.LOITER"
    assert not flying.step(recover).has_ended
    assert next(left, None) is None, "the command was not given anew"
    flying.control, flying.mode = Control.REFERENCES, "OFFBOARD"
    step = flying.step(recover)
    assert step.has_ended
    assert step.error is None


class _Mission(Manoeuvre):
    """A mission that leads to every mode."""

    mission = "the autopilot flies our mission"

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        raise NotImplementedError

    @override
    def led_to(self, snapshot: Snapshot) -> bool:
        return True
