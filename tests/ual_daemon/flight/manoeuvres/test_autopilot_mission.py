"""A mission that the autopilot flies, by an autopilot whose mode a test sets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace

import pytest

from tests.ual_daemon.flight.hand_made import Autopilot
from ual.errors import RejectedByAutopilotError, TaskAbortedError, UalError
from ual.geometry import Vector3
from ual.missions import Item, ReturnToLaunch, Waypoint
from ual.missions.plan import MissionStage
from ual.types import TaskKind
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.chain import done
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.offers.missions import AutopilotMissions, KeptMission, MissionReport, OnItsOwn
from ual_daemon.backends.values import Cause, Control, LandedState
from ual_daemon.flight.manoeuvres.autopilot_mission import AutopilotMission, TakeBack
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.tracker.references import Hold

KEPT = KeptMission((Waypoint(47.0, 8.0, 5.0),), "1", 5)


class Missions(AutopilotMissions):
    """Missions of an autopilot; `asked` is what it was asked for."""

    mode, return_mode, pause_mode, done_mode = "MISSION", "RETURN", "PAUSE", "HOLD"

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.read: Future[KeptMission] = Future()
        self.told: MissionReport | None = None
        self.chosen = done(None)
        self.why_not: Callable[[], UalError | None] = lambda: None
        """Refusal of the last choice of an item."""

    def require(self, items: Sequence[Item]) -> None:
        """Takes any."""

    def upload(self, items: Sequence[Item], refusal: Callable[[], UalError | None]) -> Future[KeptMission]:
        raise NotImplementedError

    def clear(self, refusal: Callable[[], UalError | None]) -> Future[KeptMission]:
        raise NotImplementedError

    def download(self) -> Future[KeptMission]:
        self.asked.append("download")
        self.read = Future()
        return self.read

    def report(self) -> MissionReport | None:
        return self.told

    def set_current(
        self, items: Sequence[Item], item: int, refusal: Callable[[], UalError | None], *, anew: bool
    ) -> Future[None]:
        self.asked.append("set_current")
        self.why_not = refusal
        return self.chosen

    def fly(self) -> Future[None]:
        self.asked.append("fly")
        return done(None)

    def on_its_own(self) -> Future[OnItsOwn]:
        return done(OnItsOwn(None, "it goes on"))


class Lab:
    """A mission that was started in the air."""

    def __init__(self) -> None:
        self.autopilot = Autopilot(control=Control.REFERENCES, landed=LandedState.IN_AIR, mode="OFFBOARD")
        self.offer = Missions()
        self.task = self.autopilot.task(TaskKind.MISSION)
        self.kept = KEPT
        self.mission = self.make()

    def make(self) -> AutopilotMission:
        """Makes a mission that begins with its first item."""
        backend = LightBackend(BackendOptions("uav_1", settings={"speed_factor": 0}))
        reference = Hold(Vector3(1.0, 2.0, 3.0), 0.0)
        return AutopilotMission(self.task, backend, self.offer, self.kept, 1, reference, self._take_back, lambda: None)

    def _take_back(self, task: VehicleTask) -> TakeBack:
        raise NotImplementedError

    def enter(self, mode: str) -> None:
        """The autopilot enters a mode."""
        self.autopilot.mode, self.autopilot.control = mode, Control.OTHER
        self.run()

    def run(self) -> None:
        """Lets it be stepped a few times."""
        for _ in range(3):
            step = self.autopilot.step(self.mission)
            assert not step.has_ended, step.error

    def fly(self) -> None:
        """It is flown."""
        self.run()
        self.enter("MISSION")

    def pause(self) -> None:
        """It is paused, and the autopilot holds."""
        self.task.is_paused = True
        self.run()
        self.enter("PAUSE")
        self.offer.asked.clear()


@pytest.fixture
def lab() -> Lab:
    return Lab()


def test_a_pilot_who_takes_over_in_the_moment_of_the_start_keeps_it(lab: Lab) -> None:
    """It was judged in OFFBOARD, and is stepped first in the pilot's mode."""
    lab.mission.begins_in("OFFBOARD")
    lab.autopilot.mode, lab.autopilot.control = "POSCTL", Control.OTHER
    assert lab.autopilot.step(lab.mission).is_taken
    assert lab.offer.asked == []


def test_one_that_replaces_another_in_the_moment_of_its_start_is_executed(lab: Lab) -> None:
    """The mode to which the first one led came late, and counted as one of others: nobody could stop it."""
    first = lab.mission
    first.begins_in("OFFBOARD")
    lab.run()
    assert lab.offer.asked == ["set_current", "fly"]
    lab.offer.chosen = Future()
    lab.task = lab.autopilot.task(TaskKind.MISSION)
    lab.mission = lab.make()
    lab.mission.begins_in("OFFBOARD")
    lab.mission.replaces(first)
    lab.run()
    lab.enter("MISSION")
    lab.offer.chosen.set_result(None)
    lab.run()
    assert lab.offer.asked[-1] == "fly"
    assert "flies our mission" in lab.mission.mission


def test_a_pilot_who_takes_over_as_one_replaces_another_keeps_it(lab: Lab) -> None:
    first = lab.mission
    lab.run()
    lab.offer.chosen = Future()
    lab.task = lab.autopilot.task(TaskKind.MISSION)
    lab.mission = lab.make()
    lab.mission.begins_in("OFFBOARD")
    lab.mission.replaces(first)
    lab.run()
    lab.autopilot.mode, lab.autopilot.control = "POSCTL", Control.OTHER
    assert lab.autopilot.step(lab.mission).is_taken


def start_with_another_list(lab: Lab) -> None:
    """Another list is reported while the first item is being made the current one."""
    lab.offer.told = MissionReport(MissionStage.NOT_STARTED, None, None, 0.0, changes=(2,))
    lab.offer.chosen = Future()
    lab.mission = lab.make()
    lab.run()
    lab.offer.told = replace(lab.offer.told, changes=(3,))
    lab.offer.chosen.set_result(None)
    lab.run()
    assert lab.offer.asked == ["set_current", "download"]


def test_a_mission_that_another_station_replaces_before_its_start_is_not_begun(lab: Lab) -> None:
    """A real ArduCopter: it was flown to the other's places for half a second, after its list had been reported."""
    start_with_another_list(lab)
    lab.offer.read.set_result(KEPT._replace(digest="2"))
    step = lab.autopilot.step(lab.mission)
    assert isinstance(step.error, TaskAbortedError)
    assert step.error.metadata["by"] == "ground station"
    assert "fly" not in lab.offer.asked


def test_a_list_that_is_reported_late_does_not_keep_a_mission_from_its_start(lab: Lab) -> None:
    start_with_another_list(lab)
    lab.offer.read.set_result(KEPT)
    lab.run()
    assert lab.offer.asked == ["set_current", "download", "fly"]


def test_a_paused_mission_is_read_again_and_goes_on(lab: Lab) -> None:
    lab.fly()
    lab.pause()
    lab.task.is_paused = False
    lab.run()
    assert lab.offer.asked == ["download"]
    lab.offer.read.set_result(KEPT)
    lab.run()
    assert lab.offer.asked == ["download", "set_current", "fly"]
    lab.enter("MISSION")


def test_a_pause_while_a_mission_is_read_again_keeps_it_where_it_holds(lab: Lab) -> None:
    """It flew on, though it had been paused anew, and was held only then."""
    lab.fly()
    lab.pause()
    lab.task.is_paused = False
    lab.run()
    lab.task.is_paused = True
    lab.offer.read.set_result(KEPT)
    lab.run()
    assert "fly" not in lab.offer.asked
    lab.task.is_paused = False
    lab.run()
    lab.offer.read.set_result(KEPT)  # others may have brought another one in that pause
    lab.run()
    assert lab.offer.asked == ["download", "download", "set_current", "fly"]
    lab.enter("MISSION")


def test_one_that_is_paused_is_not_reported_to_fly_on_in_a_silence(lab: Lab) -> None:
    lab.fly()
    lab.pause()
    lab.autopilot.silent_s = 5.0
    lab.run()
    assert lab.task.note.endswith("; the autopilot holds by itself")
    lab.task.is_paused = False  # it is read again once it is seen
    lab.run()
    assert lab.task.note.endswith("; the autopilot holds by itself")


def test_a_pause_that_is_refused_leaves_the_task_with_the_mission(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """The task ended, and the mission was flown on as one of others, which nobody could abort."""
    refused: Future[None] = Future()
    refused.set_exception(RejectedByAutopilotError("it does not hold"))
    lab.fly()
    monkeypatch.setattr(lab.mission._backend, "hold", lambda: refused)
    lab.task.is_paused = True
    lab.run()
    assert not lab.task.is_paused
    assert "it could not be paused: it does not hold" in lab.task.info().description
    monkeypatch.setattr(lab.mission._backend, "hold", lambda: done(None))
    lab.pause()
    assert "could not be paused" not in lab.task.info().description


@pytest.mark.parametrize("held_by", [None, Cause.GROUND_STATION, Cause.BATTERY])
def test_a_pause_as_its_own_return_begins_holds_the_return(lab: Lab, held_by: Cause | None) -> None:
    """It was told as taken by a ground station. A failsafe's return is not held."""
    lab.kept = KeptMission((*KEPT.items, ReturnToLaunch()), "1")
    lab.mission = lab.make()
    lab.fly()
    lab.task.is_paused = True
    lab.run()
    lab.autopilot.mode, lab.autopilot.held_by = lab.offer.return_mode, held_by
    if held_by is Cause.BATTERY:
        assert lab.autopilot.step(lab.mission).is_taken
        return
    lab.run()
    lab.autopilot.held_by = None
    lab.enter("PAUSE")
    assert lab.mission.mission.startswith("the autopilot holds on our mission: item 2")


def test_others_who_take_it_while_it_is_paused_end_it(lab: Lab) -> None:
    lab.fly()
    lab.pause()
    lab.autopilot.mode = "POSCTL"
    assert isinstance(lab.autopilot.step(lab.mission).error, TaskAbortedError)


@pytest.mark.parametrize("stage", [MissionStage.ACTIVE, MissionStage.COMPLETE])
def test_a_failsafe_that_holds_at_the_last_item_is_no_end_of_the_mission(lab: Lab, stage: MissionStage) -> None:
    """PX4 holds in the mode that follows a mission, too. It was told as FLYING_AUTO for 2.5 s, or taken back."""
    lab.fly()
    lab.offer.told = MissionReport(stage, 1, 1, lab.autopilot.time_s + 0.1, 5)
    lab.autopilot.mode, lab.autopilot.held_by = "HOLD", Cause.RC
    step = lab.autopilot.step(lab.mission)
    assert step.is_taken
    assert isinstance(step.error, TaskAbortedError)
    assert step.error.metadata["by"] == "rc failsafe"


@pytest.mark.parametrize("is_refused", [False, True])
def test_a_hold_before_a_jump_of_ours_to_the_last_item_is_reported_may_be_its_end(
    lab: Lab, *, is_refused: bool
) -> None:
    """A ground station was named at once."""
    lab.kept = KeptMission((*KEPT.items, Waypoint(47.1, 8.0, 5.0)), "1", 5)
    lab.mission = lab.make()
    lab.fly()
    lab.offer.told = MissionReport(MissionStage.ACTIVE, 1, None, lab.autopilot.time_s, 5)
    lab.run()
    lab.offer.chosen = Future()
    lab.mission.jump(2, lambda: None)
    lab.autopilot.mode, lab.autopilot.held_by = lab.offer.done_mode, Cause.AUTOPILOT
    if is_refused:
        lab.offer.chosen.set_exception(RejectedByAutopilotError("it has no such item"))
        step = lab.autopilot.step(lab.mission)
        assert step.is_taken
        assert "the autopilot holds by itself, as after a mission" in str(step.error)
        return
    lab.run()
    lab.offer.told = MissionReport(MissionStage.COMPLETE, 2, None, lab.autopilot.time_s, 5)
    with pytest.raises(NotImplementedError):  # it takes the control back
        lab.run()


def test_one_that_replaces_another_goes_on_where_its_jump_to_the_last_item_has_ended_that(lab: Lab) -> None:
    """The jump was withdrawn with its mission after it had left, and the hold counted as no end of that."""
    lab.kept = KeptMission((*KEPT.items, Waypoint(47.1, 8.0, 5.0)), "1", 5)
    first = lab.mission = lab.make()
    lab.fly()
    lab.offer.told = MissionReport(MissionStage.ACTIVE, 1, None, lab.autopilot.time_s, 5)
    lab.run()
    jump = lab.offer.chosen = Future()
    first.jump(2, lambda: None)
    lab.offer.chosen = Future()
    lab.task = lab.autopilot.task(TaskKind.MISSION)
    lab.mission = lab.make()
    lab.mission.replaces(first)
    lab.run()
    jump.set_exception(TaskAbortedError("mission: it has ended", {"by": "mission"}))
    lab.autopilot.mode, lab.autopilot.held_by = lab.offer.done_mode, Cause.AUTOPILOT
    lab.run()
    lab.offer.told = MissionReport(MissionStage.COMPLETE, 2, None, lab.autopilot.time_s, 5)
    lab.run()
    lab.offer.chosen.set_result(None)
    lab.run()
    assert lab.offer.asked[-1] == "fly"


def test_an_item_that_was_reached_in_a_flight_before_is_none_of_this_one(lab: Lab) -> None:
    """The holder was then reported as its end, and UAL took the control back from them."""
    lab.offer.told = MissionReport(MissionStage.ACTIVE, 1, 1, 0.0, 5, reached_s=0.0)
    assert lab.mission.reached(lab.offer.told) is None
    lab.fly()
    lab.offer.told = replace(lab.offer.told, time_s=lab.autopilot.time_s)
    assert lab.mission.reached(lab.offer.told) is None
    lab.autopilot.mode, lab.autopilot.held_by = lab.offer.done_mode, Cause.GROUND_STATION
    lab.run()
    for _ in range(30):
        step = lab.autopilot.step(lab.mission)
        assert step.handover is None
        if step.has_ended:
            break
    assert step.is_taken


def test_an_item_that_is_reached_is_its_end_where_the_autopilot_holds(lab: Lab) -> None:
    lab.fly()
    now_s = lab.autopilot.time_s
    lab.offer.told = MissionReport(MissionStage.ACTIVE, 1, 1, now_s, 5, reached_s=now_s)
    assert lab.mission.reached(lab.offer.told) == 1
    lab.autopilot.mode = lab.offer.done_mode
    with pytest.raises(NotImplementedError):  # it takes the control back
        lab.run()


def test_a_mission_that_replaces_another_is_never_reported_as_controlled_by_others(lab: Lab) -> None:
    """It was FLYING_MANUAL until the autopilot had taken its first item, and an abort was refused."""
    assert not lab.mission.mission
    lab.fly()
    lab.offer.chosen = Future()
    successor = lab.make()
    successor.replaces(lab.mission)
    lab.autopilot.step(successor)
    assert successor.mission == "the autopilot still flies the mission before"
    lab.offer.chosen.set_result(None)
    for _ in range(3):
        lab.autopilot.step(successor)
    assert successor.mission == "the autopilot flies our mission: item 1 of 1, waypoint"


def test_a_failsafe_that_left_the_mission_flying_does_not_keep_its_end_from_being_observed(lab: Lab) -> None:
    """ArduPilot stays in the mode of its mission at the end, and may tell a failsafe just before that mode."""
    lab.offer.done_mode = lab.offer.mode
    lab.autopilot.held_by = Cause.RC
    lab.fly()
    lab.offer.told = MissionReport(MissionStage.COMPLETE, 1, 1, lab.autopilot.time_s + 0.1, 5)
    with pytest.raises(NotImplementedError):  # it takes the control back
        lab.run()
