"""Landing."""

from __future__ import annotations

from concurrent.futures import Future

from tests.ual_daemon.flight.hand_made import Autopilot, sent
from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError, UalTimeoutError
from ual.geometry import Vector3
from ual.types import TaskKind
from ual_daemon.backends.values import Control, LandedState, PositionSetpoint
from ual_daemon.flight.manoeuvres.land import LandManoeuvre
from ual_daemon.flight.manoeuvres.manoeuvre import Step
from ual_daemon.tracker.references import Hold


def land(autopilot: Autopilot, ack: Future[None]) -> LandManoeuvre:
    hold = Hold(Vector3(1.0, 2.0, autopilot.z), 0.5)
    return LandManoeuvre(autopilot.task(TaskKind.LAND), sent(ack, autopilot), hold, autopilot.snapshot())


def test_a_landing_sends_references_only_until_the_autopilot_lands_by_itself(
    flying: Autopilot, ack: Future[None]
) -> None:
    landing = land(flying, ack)
    assert isinstance(flying.step(landing).setpoint, PositionSetpoint)
    flying.landed = LandedState.LANDING  # its landed state may come before its mode
    assert flying.step(landing) == Step()
    flying.control, flying.climb_m_s = Control.LAND, -1.0
    for _ in range(40):
        assert flying.step(landing) == Step()
    flying.landed, flying.climb_m_s = LandedState.ON_GROUND, 0.0
    assert not flying.step(landing).has_ended  # it may have been disarmed in the air
    assert flying.until_end(landing) is None


def test_a_landing_that_is_disarmed_in_the_air_has_not_landed(flying: Autopilot, ack: Future[None]) -> None:
    landing = land(flying, ack)
    flying.control = Control.LAND
    flying.step(landing)
    flying.landed, flying.armed = LandedState.ON_GROUND, False  # ArduPilot says so of all that is disarmed
    flying.climb_m_s = -4.0
    for _ in range(40):
        assert not flying.step(landing).has_ended


def test_a_landing_of_an_autopilot_that_is_not_received_any_more_is_reported_to_go_on(
    flying: Autopilot, ack: Future[None]
) -> None:
    landing = land(flying, ack)
    flying.control = Control.LAND
    flying.step(landing)
    flying.silent_s = 10.0
    error = flying.step(landing).error
    assert isinstance(error, LinkLostError)
    assert error.message.endswith("; the autopilot had begun to land, and goes on by itself: look at the state")


def test_a_landing_that_the_pilot_stops_is_aborted(flying: Autopilot, ack: Future[None]) -> None:
    landing = land(flying, ack)
    flying.control = Control.LAND
    flying.step(landing)
    flying.control = Control.OTHER
    error = flying.step(landing).error
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "safety pilot"


def test_a_landing_that_stops_in_the_air_times_out_and_a_slow_one_does_not(
    flying: Autopilot, ack: Future[None]
) -> None:
    landing = land(flying, ack)
    flying.control, flying.climb_m_s, flying.z = Control.LAND, -0.25, 100.0
    landing = land(flying, ack)
    flying.control = Control.LAND
    for _ in range(3900):
        assert flying.step(landing) == Step()
    flying.climb_m_s = 0.0
    assert isinstance(flying.until_end(landing, 600.0), UalTimeoutError)


def test_a_landing_that_is_stuck_says_so_and_what_can_be_done(flying: Autopilot, ack: Future[None]) -> None:
    flying.control, flying.climb_m_s = Control.LAND, 0.0
    landing = land(flying, ack)
    assert landing.task is not None
    for _ in range(70):  # it notices the ground late
        assert flying.step(landing) == Step()
    assert landing.task.info().description == ""
    for _ in range(25):
        flying.step(landing)
    assert "has not descended for 9 s" in landing.task.info().description
    assert "lands it by hand" in landing.task.info().description
    flying.climb_m_s = -1.0
    for _ in range(10):
        flying.step(landing)
    assert landing.task.info().description == ""
    flying.climb_m_s = 0.0
    error = flying.until_end(landing)
    assert isinstance(error, UalTimeoutError)
    assert "command land again" in str(error)


def test_where_there_is_no_safety_pilot_the_advice_is_to_abort(flying: Autopilot, ack: Future[None]) -> None:
    landing = LandManoeuvre(
        flying.task(TaskKind.LAND), sent(ack, flying), None, flying.snapshot(), has_safety_pilot=False
    )
    flying.control, flying.climb_m_s = Control.LAND, 0.0
    for _ in range(120):
        flying.step(landing)
    assert landing.task is not None
    assert "abort ends the landing" in landing.task.info().description
    assert "pilot" not in landing.task.info().description


def test_a_landing_that_was_not_answered_before_a_silence_may_still_come(flying: Autopilot, ack: Future[None]) -> None:
    landing, answered, begun = (land(flying, each) for each in (ack, Future(), Future()))
    answered.command._ack.set_result(None)  # type: ignore[union-attr]
    flying.control = Control.LAND
    flying.step(begun)
    flying.control, flying.silent_s = Control.REFERENCES, 10.0
    assert "may still be executed" in str(flying.step(landing).error)
    assert "executed" not in str(flying.step(answered).error)
    assert "executed" not in str(flying.step(begun).error)


def test_a_landing_that_is_refused_says_what_can_be_done(flying: Autopilot, ack: Future[None]) -> None:
    landing = land(flying, ack)
    ack.set_exception(RejectedByAutopilotError("refused to land: DENIED", {"result": "DENIED"}))
    error = flying.step(landing).error
    assert isinstance(error, RejectedByAutopilotError)
    assert "holds its position: command land again" in str(error)
    assert error.metadata["result"] == "DENIED"


def test_a_landing_that_was_not_sent_because_the_pilot_took_over_is_aborted_by_the_pilot(
    flying: Autopilot, ack: Future[None]
) -> None:
    landing = land(flying, ack)
    flying.control = Control.OTHER
    ack.set_exception(RejectedByAutopilotError("the command to land was not sent: the mode became POSCTL"))
    step = flying.step(landing)
    assert step.is_taken
    assert isinstance(step.error, TaskAbortedError)


def test_a_landing_that_ends_as_nothing_is_received_does_not_say_what_the_uav_does(
    flying: Autopilot, ack: Future[None]
) -> None:
    landing = land(flying, ack)
    ack.set_exception(LinkLostError("cannot land: no autopilot is heard"))
    assert str(flying.step(landing).error) == str(LinkLostError("cannot land: no autopilot is heard"))
