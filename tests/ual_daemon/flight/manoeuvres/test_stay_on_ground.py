"""Missions that end before they have lifted off, or while they do, by an autopilot whose mode a test sets."""

from __future__ import annotations

from concurrent.futures import Future

import pytest

from tests.ual_daemon.flight.hand_made import Autopilot
from tests.ual_daemon.flight.manoeuvres.test_autopilot_mission import Lab
from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError, UalTimeoutError
from ual.types import Limits
from ual_daemon.backends.values import Control, LandedState
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.recover import Recover
from ual_daemon.flight.manoeuvres.stay_on_ground import StayOnGround
from ual_daemon.flight.policy.authority import LONGEST_GAP_S


class Ground:
    """A UAV on the ground that is to stay there; `asked` are the answers to its commands to hold."""

    def __init__(self) -> None:
        self.autopilot = Autopilot(mode="MISSION")
        self.asked: list[Future[None]] = []
        self.stay = StayOnGround("cancel", Lab().mission, self._hold)
        self.stay.begins_in("MISSION")
        self.stay.send()

    def _hold(self) -> Future[None]:
        self.asked.append(Future())
        return self.asked[-1]

    def run(self, count: int = 5) -> None:
        """Lets it be stepped; it does not end."""
        for _ in range(count):
            assert not self.autopilot.step(self.stay).has_ended

    def answer(self, mode: str) -> None:
        """The autopilot accepts to hold, and shows a mode."""
        self.asked[-1].set_result(None)
        self.autopilot.mode = mode


@pytest.fixture
def ground() -> Ground:
    return Ground()


def test_it_ends_once_the_autopilot_has_held_for_a_while(ground: Ground) -> None:
    ground.run()
    ground.answer("PAUSE")
    ground.run()
    assert ground.autopilot.until_end(ground.stay, 5.0) is None
    assert len(ground.asked) == 1


def test_a_mission_that_is_entered_late_is_held_again(ground: Ground) -> None:
    ground.answer("PAUSE")
    ground.run()
    ground.autopilot.mode = "MISSION"
    ground.run()
    assert len(ground.asked) == 2
    ground.answer("PAUSE")
    assert ground.autopilot.until_end(ground.stay, 5.0) is None


def test_an_autopilot_that_accepts_and_flies_on_is_told_and_not_flooded(ground: Ground) -> None:
    ground.answer("MISSION")
    error, end_s = None, ground.autopilot.now_s() + 20.0
    while error is None and ground.autopilot.now_s() < end_s:
        if not ground.asked[-1].done():
            ground.answer("MISSION")
        error = ground.autopilot.step(ground.stay).error
    assert isinstance(error, RejectedByAutopilotError)
    assert "in mode MISSION" in str(error)
    assert 2 <= len(ground.asked) <= 20


def test_others_who_choose_a_mode_are_not_overruled(ground: Ground) -> None:
    ground.autopilot.mode = "POSCTL"
    assert isinstance(ground.autopilot.until_end(ground.stay, 1.0), TaskAbortedError)


def test_an_autopilot_that_does_not_answer_is_told(ground: Ground) -> None:
    assert isinstance(ground.autopilot.until_end(ground.stay, 10.0), UalTimeoutError)


# --- While it takes off, or is not seen -------------------------------------------------------------------------------


class Climb:
    """A UAV that takes off in a mission, and is to be taken back."""

    def __init__(self) -> None:
        self.autopilot = Autopilot(mode="MISSION", landed=LandedState.TAKING_OFF)
        self.asked_count = 0
        command = AutopilotCommand("take our references")
        self.recover = Recover(command, Limits(), self._take, lambda _: None, name="lease", is_patient=True)
        self.recover.begins_in("MISSION")
        self.recover.replaces(Lab().mission)

    def _take(self) -> Future[None]:
        self.asked_count += 1
        return Future()

    def run(self, duration_s: float) -> None:
        """Lets it be stepped; it does not end."""
        for _ in range(round(duration_s * 10.0)):
            assert not self.autopilot.step(self.recover).has_ended


@pytest.mark.parametrize("blind_s", [0.0, 5.0])
def test_it_is_taken_back_once_it_has_taken_off_and_is_seen(blind_s: float) -> None:
    climb = Climb()
    climb.run(20.0)
    assert climb.asked_count == 0
    climb.autopilot.landed = LandedState.IN_AIR
    climb.autopilot.silent_s = 100.0
    climb.run(blind_s)
    assert climb.asked_count == 0
    climb.autopilot.silent_s = 0.0
    climb.run(0.2)
    assert climb.asked_count == 1
    climb.autopilot.mode, climb.autopilot.control = "OFFBOARD", Control.REFERENCES
    assert climb.autopilot.step(climb.recover).next_reference is not None


def test_after_a_long_silence_it_is_not_taken_any_more() -> None:
    climb = Climb()
    climb.autopilot.silent_s = 100.0
    assert isinstance(climb.autopilot.until_end(climb.recover, LONGEST_GAP_S + 1.0), LinkLostError)
    assert climb.asked_count == 0


def test_the_pilot_who_takes_it_in_its_climb_keeps_it() -> None:
    climb = Climb()
    climb.run(1.0)
    climb.autopilot.mode, climb.autopilot.landed = "POSCTL", LandedState.IN_AIR
    assert isinstance(climb.autopilot.until_end(climb.recover, 1.0), TaskAbortedError)
    assert climb.asked_count == 0
