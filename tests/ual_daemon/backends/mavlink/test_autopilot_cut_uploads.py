"""Uploads that are cut off amid their items: none of them is flown, or applied, by this daemon or the next one."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.simulators import ArduPilot, Faults
from tests.simulators.mission_store import FENCE, MISSION, RALLY
from tests.ual_daemon.backends.mavlink.test_autopilot_fence_upload import current_position, field
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from tests.ual_daemon.backends.mavlink.test_autopilot_own_missions import (
    at,
    box,
    landing,
    stand_armed,
    wait_for_position,
)
from ual.errors import RejectedByAutopilotError, UalError, WrongStateError
from ual.fences import FencePlan, FenceZone, RallyPoint
from ual.missions import Item, TakeOff
from ual.types import State
from ual_daemon.services.fence import VehicleFence
from ual_daemon.services.mission import VehicleMission

SILENT = Faults(is_silent=True)
COUNT = 40
CUTS = ("client", "link", "daemon", "autopilot")


class KeptFlight(Flight):
    """One whose daemons keep their files in a directory."""

    def __init__(self, kind: str, directory: Path) -> None:
        self.home_file = directory / "uav_1.home"
        super().__init__(kind)
        if kind == "px4":
            self.autopilot.parameters["GF_ACTION"] = 0

    def cut(self, begin: Callable[[], Future[Any]], kind: int, seq: int, by: str) -> Future[Any]:
        """Begins an upload, and cuts it off once the autopilot has taken an item."""
        store = self.autopilot.missions
        futures: list[Future[Any]] = []
        was_cut: list[int] = []

        def on_taken(of: int, taken: int) -> None:
            if of != kind or taken != seq or was_cut:
                return
            was_cut.append(taken)
            if by == "client":
                futures[0].cancel()
            elif by == "autopilot":
                self.autopilot.reboot()
            else:
                self.link.up = self.link.down = SILENT

        with self.autopilot.lock:
            store.on_taken = on_taken
            futures.append(begin())
        self.wait_for(lambda: bool(was_cut), "the cut")
        if by == "daemon":
            self.restart()
        elif by == "link":
            self.wait_for(futures[0].done, "the end of the upload")
            self.link.up = self.link.down = Faults()
        return futures[0]

    def restart(self) -> None:
        """The daemon is killed, and a new one begins."""
        self.kill()
        self.link.up = self.link.down = Faults()
        self.start()


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Callable[[str], KeptFlight]]:
    flights: list[KeptFlight] = []

    def made(kind: str) -> KeptFlight:
        flight = KeptFlight(kind, tmp_path)
        flights.append(flight)
        flight.wait_for_state(State.LANDED_DISARMED)
        wait_for_position(flight)
        return flight

    yield made
    for flight in flights:
        flight.uav.close()


def circle(flight: Flight) -> list[Item]:
    turns = [2.0 * math.pi * index / COUNT for index in range(COUNT - 2)]
    places = [at(flight, 20.0 * math.cos(turn), 20.0 * math.sin(turn)) for turn in turns]
    return [TakeOff(6.0), *places, landing(flight, 0, 0)]


def begins(flight: Flight) -> Callable[[], Future[Any]]:
    items = circle(flight)
    return lambda: VehicleMission(flight.uav.vehicle).upload(items, "")


def is_over(flight: Flight) -> bool:
    """Returns whether nothing is transferred any more."""
    return not flight.uav.vehicle.uploads._running


@pytest.mark.parametrize(("by", "seq"), [*((by, 13) for by in CUTS), ("daemon", 0), ("link", COUNT - 2)])
@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_a_mission_that_was_cut_off_is_not_started_until_it_is_uploaded_again(
    make: Callable[[str], KeptFlight], kind: str, by: str, seq: int
) -> None:
    flight = make(kind)
    flight.uav.mission.upload(box(flight))
    ended = flight.cut(begins(flight), MISSION, seq, by)
    if by == "autopilot":  # it takes the whole list again, or it is told that it has rebooted
        flight.wait_for(ended.done, "the end of the upload")
        if ended.exception() is None:
            stand_armed(flight)
            assert len(flight.uav.mission.download().items) == COUNT
            return
        assert "NO_SPACE" not in str(ended.exception())
    stand_armed(flight)
    flight.wait_for(lambda: is_over(flight), "the end")
    for _ in range(2):
        with pytest.raises(WrongStateError, match=r"upload the mission again|has no mission; upload one"):
            flight.uav.mission.start()
        assert flight.autopilot.pilot_disarm()  # else a minute passes until it disarms by itself
        flight.restart()
        stand_armed(flight)
    flight.uav.mission.upload(box(flight))
    assert flight.uav.task(flight.uav.mission.start().id).info().description.startswith("mission of 5 items")
    flight.uav.abort()


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_a_cancelled_upload_leaves_no_part(make: Callable[[str], KeptFlight], kind: str) -> None:
    flight = make(kind)
    flight.uav.mission.upload(box(flight))
    before = list(flight.autopilot.missions.lists[MISSION])
    flight.cut(begins(flight), MISSION, 13, "client")
    if kind == "ardupilot":
        flight.wait_for(lambda: not flight.autopilot.missions.lists[MISSION], "the removal")
    assert len(flight.uav.mission.download().items) == (5 if kind == "px4" else 0)
    assert flight.autopilot.missions.lists[MISSION] == (before if kind == "px4" else [])


@pytest.mark.parametrize("by", CUTS)
@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_a_fence_whose_rally_points_were_cut_off_is_not_enabled(
    make: Callable[[str], KeptFlight], kind: str, by: str
) -> None:
    flight = make(kind)
    points = tuple(RallyPoint(*current_position(flight, 5.0 * index, 5.0), 20) for index in range(4))
    plan = FencePlan((field(flight),), points)

    def begin() -> Future[Any]:
        fence = VehicleFence(flight.uav.vehicle)
        return fence.upload(plan, "", replace=True, enable=True, force=False)

    ended = flight.cut(begin, RALLY, 1, by)
    if by == "autopilot":
        flight.wait_for(ended.done, "the end of the upload")
    flight.wait_for_state(State.LANDED_DISARMED)
    wait_for_position(flight)
    if by == "client":  # those that had come are removed, and PX4 had none
        flight.wait_for(lambda: not flight.autopilot.missions.lists[RALLY], "the removal")
    flight.wait_for(lambda: is_over(flight), "the end")
    is_whole = ended.done() and not ended.cancelled() and ended.exception() is None
    if is_whole or (by == "client" and kind == "ardupilot"):
        flight.uav.fence.enable()
    else:
        with pytest.raises(WrongStateError, match="upload the rally points again"):
            flight.uav.fence.enable()
        flight.restart()
        flight.wait_for_state(State.LANDED_DISARMED)
        wait_for_position(flight)
        with pytest.raises(WrongStateError, match="upload the rally points again"):
            flight.uav.fence.enable()
    kept_fence = flight.uav.fence.upload(plan, replace=True)
    assert (len(kept_fence.rally_points), kept_fence.is_enabled) == (4, True)


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_a_fence_that_was_cut_off_is_not_enabled_by_the_next_daemon(
    make: Callable[[str], KeptFlight], kind: str
) -> None:
    flight = make(kind)
    corners = [current_position(flight, 40.0 * math.cos(turn), 40.0 * math.sin(turn)) for turn in range(6)]
    plan = FencePlan((FenceZone(True, tuple(corners)),))

    def begin() -> Future[Any]:
        fence = VehicleFence(flight.uav.vehicle)
        return fence.upload(plan, "", replace=True, enable=True, force=False)

    flight.cut(begin, FENCE, 2, "daemon")
    flight.wait_for_state(State.LANDED_DISARMED)
    wait_for_position(flight)
    with pytest.raises(WrongStateError, match="upload the fence again"):
        flight.uav.fence.enable()
    flight.uav.fence.clear()
    flight.uav.fence.enable()


def test_what_is_refused_before_anything_is_sent_leaves_no_entry(
    make: Callable[[str], KeptFlight], tmp_path: Path
) -> None:
    flight = make("ardupilot")
    stand_armed(flight)
    plan = FencePlan((field(flight),), (RallyPoint(*current_position(flight, 5.0, 5.0), 20),))
    for refused in (partial(flight.uav.fence.upload, plan), partial(flight.uav.fence.clear, with_rally_points=True)):
        with pytest.raises(WrongStateError, match="the UAV is armed"):
            refused()
        assert is_over(flight)
        assert json.loads((tmp_path / "uav_1.uploads").read_text()) == []


def test_a_mission_that_is_refused_amid_its_items_leaves_no_mixture(
    make: Callable[[str], KeptFlight], monkeypatch: pytest.MonkeyPatch
) -> None:
    flight = make("ardupilot")
    flight.uav.mission.upload(circle(flight))
    monkeypatch.setattr(ArduPilot.make_store, "_judge", lambda self, _: 3 if self._seq == 4 else 0)
    with pytest.raises(RejectedByAutopilotError, match="item 4: the autopilot answers UNSUPPORTED"):
        flight.uav.mission.upload(box(flight))
    flight.wait_for(lambda: not flight.autopilot.missions.lists[MISSION], "the removal")
    assert flight.uav.mission.download().items == ()


def test_a_removal_that_is_refused_changes_nothing(make: Callable[[str], KeptFlight]) -> None:
    flight = make("px4")
    flight.uav.mission.upload(box(flight))
    flight.autopilot.missions.refusal = 5
    with pytest.raises(RejectedByAutopilotError, match="INVALID"):
        flight.uav.mission.clear()
    flight.autopilot.missions.refusal = None
    stand_armed(flight)
    assert flight.uav.mission.start().description.startswith("mission of 5 items")
    flight.uav.abort()


def test_a_list_that_is_too_long_changes_nothing(make: Callable[[str], KeptFlight]) -> None:
    flight = make("ardupilot")
    flight.uav.mission.upload(box(flight))
    before = list(flight.autopilot.missions.lists[MISSION])
    flight.autopilot.missions.most = {MISSION: 20, FENCE: 84, RALLY: 5}
    with pytest.raises(RejectedByAutopilotError, match="it has no room for so many items"):
        flight.uav.mission.upload(circle(flight))
    assert flight.autopilot.missions.lists[MISSION] == before
    stand_armed(flight)
    assert flight.uav.mission.start().description.startswith("mission of 5 items")
    flight.uav.abort()


def test_an_entry_of_another_vehicle_does_not_count(make: Callable[[str], KeptFlight], tmp_path: Path) -> None:
    flight = make("ardupilot")
    flight.wait_for(lambda: bool(flight.backend.info().identity), "which vehicle it is")
    entry = {"list": "mission", "vehicle": "ArduCopter 9 abc", "items_count": 3, "began_s": 1.0}
    (tmp_path / "uav_1.uploads").write_text(json.dumps([entry]))
    flight.restart()
    stand_armed(flight)
    flight.wait_for(lambda: bool(flight.backend.info().identity), "which vehicle it is")
    flight.uav.mission.upload(box(flight))
    assert json.loads((tmp_path / "uav_1.uploads").read_text()) == [entry]
    flight.uav.mission.start()
    flight.uav.abort()


@pytest.mark.parametrize("text", ["", "[", "[1]", '[{"list": "mission", "vehicle": "", "items_count": 1}]', "[" * 3000])
def test_a_file_that_is_none_is_ignored(make: Callable[[str], KeptFlight], tmp_path: Path, text: str) -> None:
    (tmp_path / "uav_1.uploads").write_text(text)
    flight = make("px4")
    stand_armed(flight)
    with pytest.raises(UalError, match="has no mission"):
        flight.uav.mission.start()


def test_an_autopilot_that_boots_again_and_again_is_not_reported_to_have_no_room(
    make: Callable[[str], KeptFlight],
) -> None:
    flight = make("ardupilot")
    store, items = flight.autopilot.missions, circle(flight)

    def on_taken(_: int, seq: int) -> None:
        if seq == 20:  # as if it had booted in an instant, and has no storage yet
            store.boot(flight.now_s + 30.0)

    store.on_taken = on_taken
    with pytest.raises(RejectedByAutopilotError, match=r"asked for item 20 before|asked for item 21 before") as caught:
        flight.uav.mission.upload(items)
    assert "no room" not in caught.value.message
