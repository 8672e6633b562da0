"""A mission that is started while others command the UAV."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from typing import Any

import pytest

from tests.ual_daemon.stepped import Stepped, stepped
from ual.errors import TaskAbortedError, UalError, WrongStateError
from ual.geometry import Pose
from ual.missions import HoldTime, Item, ReturnToLaunch, Waypoint
from ual.types import TaskInfo, TaskKind
from ual_daemon.backends.chain import done
from ual_daemon.backends.offers.missions import AutopilotMissions, KeptMission, MissionReport, OnItsOwn
from ual_daemon.services.mission import VehicleMission


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
    assert lab.starting.result(0).kind is TaskKind.MISSION


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
        lab.starting.result(0)
    assert lab.uav.vehicle.commands.last_command is before


def test_a_mission_is_not_changed_while_its_start_is_in_progress(lab: Lab) -> None:
    """Until the autopilot was in its mode, another program could bring another one, which nothing had checked."""
    lab.read()
    assert lab.starting.done()
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
            lab.starting.result(0)
    assert lab.starting.done()
    assert (lab.uav.vehicle.telemetry().task is None) is is_changed
    assert (lab.offer.may_send() is None) is is_changed


@pytest.mark.parametrize("last", [ReturnToLaunch(), HoldTime(3.0)])
def test_a_mission_begins_with_its_last_item_though_that_leads_to_no_position(lab: Lab, last: Item) -> None:
    """Its dry run failed as a defect of UAL."""
    lab.offer.downloaded.set_result(KeptMission((lab.here(), last), "1"))
    starting = VehicleMission(lab.uav.vehicle).start(2, None, "")
    assert starting.result(0).kind is TaskKind.MISSION
    assert lab.uav.vehicle.missions.plan([lab.here(), last], 2).lowest_m == pytest.approx(3.0, abs=0.2)
