"""A mission that is started while others command the UAV."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from typing import Any

import pytest

from tests.ual_daemon.stepped import Stepped, stepped
from tests.waiting import LIMIT_S, until
from ual.errors import ResourceExhaustedError, TaskAbortedError, UalError, WrongStateError
from ual.geometry import Pose
from ual.missions import HoldTime, Item, ReturnToLaunch, Waypoint
from ual.missions.plan import MissionPlan
from ual.types import TaskInfo, TaskKind
from ual_daemon.backends.chain import done
from ual_daemon.backends.offers.missions import AutopilotMissions, KeptMission, MissionReport, OnItsOwn
from ual_daemon.services.mission import VehicleMission
from ual_daemon.vehicle.planning import MOST_PLANS_AT_ONCE


class MadeUp(AutopilotMissions):
    """An autopilot that is slow to send its mission."""

    mode, return_mode, pause_mode, done_mode = "MISSION", "RETURN", "PAUSE", "HOLD"

    def __init__(self) -> None:
        self.downloaded: Future[KeptMission] = Future()
        self.own: Future[OnItsOwn] = done(OnItsOwn(None, "it goes on"))
        self.may_send: Callable[[], UalError | None] = lambda: None

    def require(self, items: Sequence[Item]) -> None:
        """Takes any."""

    def upload(self, items: Sequence[Item], refusal: Callable[[], UalError | None]) -> Future[KeptMission]:
        self.may_send = refusal
        return Future()

    def clear(self, refusal: Callable[[], UalError | None]) -> Future[KeptMission]:
        raise NotImplementedError

    def download(self) -> Future[KeptMission]:
        return self.downloaded

    def report(self) -> MissionReport | None:
        return None

    def set_current(
        self, items: Sequence[Item], item: int, refusal: Callable[[], UalError | None], *, anew: bool
    ) -> Future[None]:
        return Future()

    def fly(self) -> Future[None]:
        return Future()

    def on_its_own(self) -> Future[OnItsOwn]:
        return self.own


class Lab:
    """A UAV in the air, whose mission is being read for a start."""

    def __init__(self, uav: Stepped, monkeypatch: pytest.MonkeyPatch) -> None:
        self.uav, self.offer = uav, MadeUp()
        monkeypatch.setattr(uav.vehicle, "offer", lambda _: self.offer)
        self.starting: Future[TaskInfo] = VehicleMission(uav.vehicle).start(1, None, "")

    def read(self) -> None:
        """The autopilot has sent its mission."""
        self.offer.downloaded.set_result(KeptMission((self.here(),), "1"))

    def here(self) -> Waypoint:
        place: Any = self.uav.vehicle.telemetry().position_geo
        return Waypoint(place.latitude_deg, place.longitude_deg, 5.0)

    def upload(self) -> None:
        """Another program does."""
        VehicleMission(self.uav.vehicle).upload([self.here()], "")


@pytest.fixture
def lab(monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    with stepped() as uav:
        uav.fly()
        yield Lab(uav, monkeypatch)


def test_a_mission_begins_once_it_was_read(lab: Lab) -> None:
    lab.read()
    assert lab.starting.result(LIMIT_S).kind is TaskKind.MISSION


@pytest.mark.parametrize(
    ("command", "name"),
    [
        (lambda uav: uav.prepare.go_to_waypoint(Pose.at(2.0, 0.0, 3.0)).begin(), "go_to_waypoint"),
        (lambda uav: uav.vehicle.commands.abort(), "abort"),
    ],
)
def test_a_command_that_comes_while_it_is_read_is_not_replaced(
    lab: Lab, command: Callable[[Stepped], object], name: str
) -> None:
    command(lab.uav)
    before = lab.uav.vehicle.commands.last_command
    lab.read()
    with pytest.raises(TaskAbortedError, match=f"mission: replaced by {name}, while it was planned"):
        lab.starting.result(LIMIT_S)
    assert lab.uav.vehicle.commands.last_command is before


def test_a_mission_is_not_changed_while_its_start_is_in_progress(lab: Lab) -> None:
    """Until the autopilot was in its mode, another program could bring another one, which nothing had checked."""
    lab.read()
    lab.starting.result(LIMIT_S)
    with pytest.raises(WrongStateError, match="the autopilot flies a mission now"):
        lab.upload()


@pytest.mark.parametrize("is_changed", [True, False])
def test_a_mission_that_is_changed_after_it_was_read_does_not_begin(lab: Lab, is_changed: bool) -> None:
    lab.upload()
    assert lab.offer.may_send() is None  # its transfer ends before the mission is read
    lab.offer.own = Future()
    lab.read()
    if is_changed:
        assert lab.offer.may_send() is None
    lab.offer.own.set_result(OnItsOwn(None, "it goes on"))
    if is_changed:
        with pytest.raises(TaskAbortedError, match="was changed while this one was started"):
            lab.starting.result(LIMIT_S)
    else:
        lab.starting.result(LIMIT_S)
    assert (lab.uav.vehicle.telemetry().task is None) is is_changed
    assert (lab.offer.may_send() is None) is is_changed


@pytest.mark.parametrize("last", [ReturnToLaunch(), HoldTime(3.0)])
def test_a_mission_begins_with_its_last_item_though_that_leads_to_no_position(lab: Lab, last: Item) -> None:
    """Its dry run failed as a defect of UAL."""
    lab.offer.downloaded.set_result(KeptMission((lab.here(), last), "1"))
    starting = VehicleMission(lab.uav.vehicle).start(2, None, "")
    assert starting.result(LIMIT_S).kind is TaskKind.MISSION
    assert lab.uav.vehicle.missions.plan([lab.here(), last], 2).lowest_m == pytest.approx(3.0, abs=0.2)


class HeldPlans:
    """Has each plan of a mission wait until `go_on`, as one of 20,000 executed items does for seconds."""

    def __init__(self, lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
        self.begun_count = 0
        self._may_go_on = threading.Event()
        plan = lab.uav.vehicle.missions.plan

        def held(items: Sequence[Item], first: int = 1) -> MissionPlan:
            self.begun_count += 1
            assert self._may_go_on.wait(LIMIT_S)
            return plan(items, first)

        monkeypatch.setattr(lab.uav.vehicle.missions, "plan", held)

    def go_on(self) -> None:
        self._may_go_on.set()


def test_the_thread_that_sends_setpoints_does_not_wait_until_the_start_is_planned(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    plans = HeldPlans(lab, monkeypatch)
    lab.read()  # calls back on that thread
    assert not lab.starting.done()
    plans.go_on()
    assert lab.starting.result(LIMIT_S).kind is TaskKind.MISSION


def test_a_command_that_comes_while_the_start_is_planned_is_not_replaced(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    plans = HeldPlans(lab, monkeypatch)
    lab.read()
    lab.uav.vehicle.commands.abort()
    plans.go_on()
    with pytest.raises(TaskAbortedError, match="mission: replaced by abort, while it was planned"):
        lab.starting.result(LIMIT_S)


def test_a_start_that_its_caller_gave_up_while_it_was_planned_does_not_begin(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    plans = HeldPlans(lab, monkeypatch)
    lab.read()
    assert lab.starting.cancel()
    plans.go_on()
    until(lambda: lab.uav.vehicle.missions.plans.figures.ended_count == 1)
    assert lab.uav.vehicle.telemetry().task is None


def test_more_plans_at_once_are_refused(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    plans = HeldPlans(lab, monkeypatch)
    mission, items = VehicleMission(lab.uav.vehicle), [lab.here()]
    planned = [mission.plan(items) for _ in range(MOST_PLANS_AT_ONCE)]
    for command in (mission.plan, lambda items: mission.upload(items, "")):
        with pytest.raises(ResourceExhaustedError, match="are being planned for this UAV already"):
            command(items)
    plans.go_on()
    assert [each.result(LIMIT_S).executed_count for each in planned] == [1] * MOST_PLANS_AT_ONCE
