"""Missions that are stopped before they have lifted off, while they do, or unseen, by an autopilot that a test sets."""

from __future__ import annotations

from concurrent.futures import Future
from typing import cast

import pytest

from tests.ual_daemon.flight.hand_made import Autopilot
from tests.ual_daemon.flight.manoeuvres.test_autopilot_mission import Lab
from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError, UalError, UalTimeoutError
from ual.types import State
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Cause, Control, LandedState
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre
from ual_daemon.flight.manoeuvres.stay_on_ground import LIFTS_OFF_S
from ual_daemon.flight.mission_stop import MissionStop
from ual_daemon.flight.policy.authority import LONGEST_LINK_GAP_S


class RequestLog:
    """Requests to an autopilot: "hold" or "take", each with its answer."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.answers: list[Future[None]] = []

    def hold(self) -> Future[None]:
        return self._ask("hold")

    def take_control(self) -> Future[None]:
        return self._ask("take")

    def _ask(self, name: str) -> Future[None]:
        self.names.append(name)
        self.answers.append(Future())
        return self.answers[-1]


class Stopped:
    """A mission that is stopped in a state; `flown` is what stops it now."""

    def __init__(self, state: State, autopilot: Autopilot) -> None:
        self.autopilot, self.asked = autopilot, RequestLog()
        mission, snapshot = Lab().mission, autopilot.snapshot()
        mission.begins_in("MISSION")
        stop = MissionStop("cancel", mission, cast("Backend", self.asked))
        handover = stop.after(state, snapshot, mission)
        assert handover is not None
        self.flown: Manoeuvre = handover.manoeuvre
        self.flown.begins_in("MISSION")
        handover.begin()
        self.error: UalError | None = None
        self.has_ended = False

    def step(self) -> None:
        step = self.autopilot.step(self.flown)
        self.has_ended, self.error = step.has_ended, step.error
        if step.handover is not None:
            self.flown = step.handover.manoeuvre
            self.flown.begins_in(self.autopilot.snapshot().control.settled_mode)
            step.handover.begin()

    def run(self, duration_s: float = 0.5) -> None:
        """It is stepped, and does not end."""
        for _ in range(round(duration_s * 10.0)):
            self.step()
            assert not self.has_ended, self.error

    def until_end(self, limit_s: float) -> UalError | None:
        end_s = self.autopilot.now_s() + limit_s
        while not self.has_ended:
            assert self.autopilot.now_s() < end_s, "it does not end"
            self.step()
        return self.error

    def answer(self, mode: str) -> None:
        """The autopilot accepts the newest command, and shows a mode."""
        self.asked.answers[-1].set_result(None)
        self.autopilot.mode = mode

    def give_references(self) -> None:
        """It enters the mode in which it takes references, and so the stop has succeeded."""
        self.answer("OFFBOARD")
        self.autopilot.control = Control.REFERENCES
        assert self.until_end(5.0) is None


@pytest.fixture
def ground() -> Stopped:
    return Stopped(State.LANDED_ARMED, Autopilot(mode="MISSION"))


def test_it_ends_once_the_autopilot_has_held_for_longer_than_it_may_lift_off(ground: Stopped) -> None:
    ground.run()
    ground.answer("PAUSE")
    ground.run(LIFTS_OFF_S - 0.5)
    assert ground.until_end(1.0) is None
    assert ground.asked.names == ["hold"]


def test_it_ends_with_the_disarming(ground: Stopped) -> None:
    ground.answer("PAUSE")
    ground.run()
    ground.autopilot.armed = False
    assert ground.until_end(0.2) is None


@pytest.mark.parametrize("late_s", [0.0, 1.0, 3.0, 5.5])
def test_one_that_lifts_off_while_it_holds_is_taken_back(ground: Stopped, late_s: float) -> None:
    """PX4 had begun to raise its thrust: it hovered in its hold at 0.1 m, and UAL had let it go."""
    ground.answer("PAUSE")
    ground.run(late_s)
    ground.autopilot.landed = LandedState.IN_AIR
    ground.run()
    assert ground.asked.names == ["hold", "take"]
    assert ground.flown.mission, "it is no flight of others"
    ground.give_references()


def test_a_hold_that_was_not_answered_is_not_sent_again_once_the_control_is_taken_back(ground: Stopped) -> None:
    ground.run()
    ground.autopilot.landed = LandedState.IN_AIR
    ground.run()
    assert ground.asked.names == ["hold", "take"]
    assert [each.cancelled() for each in ground.asked.answers] == [True, False]


def test_one_that_lifts_off_before_it_obeys_is_taken_back(ground: Stopped) -> None:
    ground.autopilot.landed = LandedState.TAKING_OFF
    ground.run()
    assert ground.asked.names == ["hold"]
    ground.autopilot.landed = LandedState.IN_AIR
    ground.run()
    assert ground.asked.names == ["hold", "take"]
    ground.autopilot.mode = "PAUSE"  # by the command from before
    ground.run()
    ground.give_references()


def test_one_whose_hold_is_refused_in_the_climb_is_taken_back_after_it(ground: Stopped) -> None:
    ground.autopilot.landed = LandedState.TAKING_OFF
    ground.asked.answers[-1].set_exception(RejectedByAutopilotError("no"))
    ground.run(10.0)
    assert ground.asked.names == ["hold"]
    ground.autopilot.landed = LandedState.IN_AIR
    ground.run()
    assert ground.asked.names == ["hold", "take"]


def test_a_mission_that_is_entered_late_is_held_again(ground: Stopped) -> None:
    ground.answer("PAUSE")
    ground.run()
    ground.autopilot.mode = "MISSION"
    ground.run()
    assert ground.asked.names == ["hold", "hold"]
    ground.answer("PAUSE")
    assert ground.until_end(LIFTS_OFF_S + 1.0) is None


@pytest.mark.parametrize(("held_by", "after_s"), [(Cause.SAFETY_PILOT, 0.5), (Cause.GROUND_STATION, 0.5), (None, 3.0)])
def test_who_selects_the_mode_of_the_mission_after_the_stop_is_not_overruled(
    ground: Stopped, held_by: Cause | None, after_s: float
) -> None:
    ground.answer("PAUSE")
    ground.run(after_s)
    ground.autopilot.mode, ground.autopilot.held_by = "MISSION", held_by
    assert isinstance(ground.until_end(1.0), TaskAbortedError)
    assert ground.asked.names == ["hold"]


def test_who_goes_back_to_the_mode_before_the_stop_is_not_overruled(ground: Stopped) -> None:
    ground.flown.begins_in("POSCTL")
    ground.answer("PAUSE")
    ground.run()
    ground.autopilot.mode, ground.autopilot.landed = "POSCTL", LandedState.IN_AIR
    assert isinstance(ground.until_end(1.0), TaskAbortedError)


def test_an_autopilot_that_accepts_and_flies_on_is_reported_and_not_flooded(ground: Stopped) -> None:
    ground.answer("MISSION")
    end_s = ground.autopilot.now_s() + 20.0
    while not ground.has_ended and ground.autopilot.now_s() < end_s:
        if not ground.asked.answers[-1].done():
            ground.answer("MISSION")
        ground.step()
    assert isinstance(ground.error, RejectedByAutopilotError)
    assert "in mode MISSION" in str(ground.error)
    assert 2 <= len(ground.asked.names) <= 20


@pytest.mark.parametrize("landed", [LandedState.ON_GROUND, LandedState.IN_AIR])
def test_others_who_choose_a_mode_are_not_overruled(ground: Stopped, landed: LandedState) -> None:
    ground.autopilot.mode, ground.autopilot.landed = "POSCTL", landed
    assert isinstance(ground.until_end(1.0), TaskAbortedError)
    assert ground.asked.names == ["hold"]


def test_an_autopilot_that_does_not_answer_is_reported(ground: Stopped) -> None:
    assert isinstance(ground.until_end(10.0), UalTimeoutError)


# --- While it takes off, or is not seen -------------------------------------------------------------------------------


@pytest.fixture
def climb() -> Stopped:
    return Stopped(State.TAKING_OFF, Autopilot(mode="MISSION", landed=LandedState.TAKING_OFF))


@pytest.fixture
def unseen() -> Stopped:
    return Stopped(State.UNINITIALIZED, Autopilot(mode="MISSION", silent_s=100.0))


@pytest.mark.parametrize("blind_s", [0.0, 5.0])
def test_it_is_taken_back_once_it_has_taken_off_and_is_observed(climb: Stopped, blind_s: float) -> None:
    climb.run(20.0)
    assert climb.asked.names == []
    climb.autopilot.landed = LandedState.IN_AIR
    climb.autopilot.silent_s = 100.0
    climb.run(blind_s)
    assert climb.asked.names == []
    climb.autopilot.silent_s = 0.0
    climb.run(0.2)
    assert climb.asked.names == ["take"]
    climb.give_references()


def test_one_that_is_observed_again_on_the_ground_stays_there(unseen: Stopped) -> None:
    """A lease had ended in a silence: the mission was not stopped, and flown once its take-off came."""
    unseen.run(5.0)
    assert unseen.asked.names == []
    unseen.autopilot.silent_s = 0.0
    unseen.run(0.2)
    assert unseen.asked.names == ["hold"]
    unseen.answer("PAUSE")
    assert unseen.until_end(LIFTS_OFF_S + 1.0) is None


def test_a_silence_while_it_is_held_on_the_ground_does_not_let_it_go(ground: Stopped) -> None:
    ground.run()
    ground.autopilot.silent_s = 100.0
    ground.run(5.0)
    ground.autopilot.silent_s = 0.0
    ground.run(0.2)
    assert ground.asked.names == ["hold", "hold"]
    ground.autopilot.silent_s, ground.autopilot.landed = 100.0, LandedState.IN_AIR
    ground.run(5.0)
    ground.autopilot.silent_s = 0.0
    ground.run(0.3)
    assert ground.asked.names == ["hold", "hold", "take"]


@pytest.mark.parametrize("landed", [LandedState.ON_GROUND, LandedState.IN_AIR])
def test_a_link_that_is_lost_again_and_again_does_not_make_it_grow(unseen: Stopped, landed: LandedState) -> None:
    """Each stop kept the one before: after a thousand silences, a take-over was reported as a defect of UAL."""
    unseen.autopilot.landed = landed
    for _ in range(1100):
        unseen.autopilot.silent_s = 0.0
        unseen.step()
        unseen.autopilot.silent_s = 100.0
        unseen.step()
    assert not unseen.has_ended
    unseen.autopilot.mode, unseen.autopilot.silent_s = "POSCTL", 0.0
    assert isinstance(unseen.until_end(0.2), TaskAbortedError)


def test_a_command_that_was_obeyed_in_a_silence_has_succeeded(climb: Stopped) -> None:
    climb.autopilot.landed = LandedState.IN_AIR
    climb.run()
    climb.autopilot.silent_s = 100.0
    climb.run()
    climb.autopilot.silent_s = 0.0
    climb.give_references()


@pytest.mark.parametrize("landed", [LandedState.ON_GROUND, LandedState.TAKING_OFF])
def test_a_lift_off_that_is_reported_too_early_is_stopped_by_what_follows(climb: Stopped, landed: LandedState) -> None:
    climb.autopilot.landed = LandedState.IN_AIR
    climb.run()
    climb.autopilot.landed = landed
    climb.run()
    climb.autopilot.landed = LandedState.IN_AIR
    climb.run()
    assert climb.asked.names[-1] == "take"
    assert ("hold" in climb.asked.names) == (landed is LandedState.ON_GROUND)
    climb.give_references()


@pytest.mark.parametrize("name", ["climb", "unseen", "ground"])
def test_after_a_long_silence_it_is_not_stopped_any_more(name: str, request: pytest.FixtureRequest) -> None:
    stopped: Stopped = request.getfixturevalue(name)
    asked_count = len(stopped.asked.names)
    stopped.autopilot.silent_s = 100.0
    error = stopped.until_end(LONGEST_LINK_GAP_S + 1.0)
    assert isinstance(error, LinkLostError)
    assert "the flight may be another's" in str(error)
    assert len(stopped.asked.names) == asked_count


@pytest.mark.parametrize("landed", [LandedState.IN_AIR, LandedState.ON_GROUND, LandedState.TAKING_OFF])
@pytest.mark.parametrize("name", ["climb", "unseen"])
def test_the_pilot_who_takes_it_meanwhile_keeps_it(
    name: str, landed: LandedState, request: pytest.FixtureRequest
) -> None:
    stopped: Stopped = request.getfixturevalue(name)
    stopped.run(1.0)
    stopped.autopilot.mode, stopped.autopilot.landed, stopped.autopilot.silent_s = "POSCTL", landed, 0.0
    assert isinstance(stopped.until_end(1.0), TaskAbortedError)
    assert stopped.asked.names == []


@pytest.mark.parametrize("landed", [LandedState.IN_AIR, LandedState.ON_GROUND, LandedState.TAKING_OFF])
def test_the_pilot_who_takes_it_as_the_control_is_taken_back_keeps_it(climb: Stopped, landed: LandedState) -> None:
    climb.autopilot.landed = LandedState.IN_AIR
    climb.run()
    climb.autopilot.mode, climb.autopilot.landed = "POSCTL", landed
    assert isinstance(climb.until_end(1.0), TaskAbortedError)
    assert climb.asked.names == ["take"]
