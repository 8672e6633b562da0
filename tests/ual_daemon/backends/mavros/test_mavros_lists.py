"""The fence, the rally points and the mission through a simulated MAVROS: what is kept, read back, and what fails."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import LIMIT_S
from tests.simulators.ardupilot import ArduPilot
from tests.simulators.lockstep_mavros import LockstepMavros
from tests.simulators.mission_store import FENCE, MISSION, RALLY
from tests.ual_daemon.backends.mavros.test_mavros_faults import make
from tests.waiting import until
from ual.errors import NotSupportedError, RejectedByAutopilotError, UalError, UalTimeoutError, WrongStateError
from ual.fences.values import FencePlan, FenceZone, RallyPoint
from ual.geometry import Vector3
from ual.missions import HoldTime, Item, ReturnToLaunch, Speed, TakeOff, Waypoint
from ual.types import AltitudeReference, State
from ual_daemon import UAL
from ual_daemon.backends.firmwares.mission_items import MissionItem
from ual_daemon.backends.mavros.missions import item_of, waypoint_of
from ual_daemon.backends.offers.missions import AutopilotMissions
from ual_daemon.backends.offers.parameters import UndecidedError
from ual_daemon.services.mission import VehicleMission


@pytest.fixture(params=[("px4", 1), ("px4", 2), ("ardupilot", 1)], ids=lambda each: f"{each[0]}-{each[1]}")
def backend(request: pytest.FixtureRequest) -> LockstepMavros:
    return make(*request.param)


@pytest.fixture
def uav(backend: LockstepMavros) -> Iterator[UAL]:
    with UAL(backend) as uav:
        stand(uav)
        yield uav


def stand(uav: UAL) -> None:
    until(lambda: uav.state() is State.LANDED_DISARMED, "a state", seen=uav.telemetry)
    until(lambda: uav.telemetry().position_geo is not None, "its place", seen=uav.telemetry)


def current_position(backend: LockstepMavros, north_m: float, east_m: float) -> tuple[float, float]:
    found = backend.autopilot.projection.to_geo(Vector3(east_m, north_m, 0.0))
    return round(found.latitude_deg, 7), round(found.longitude_deg, 7)


def square(backend: LockstepMavros, size_m: float = 50.0) -> FenceZone:
    corners = ((-size_m, -size_m), (-size_m, size_m), (size_m, size_m), (size_m, -size_m))
    return FenceZone(is_inclusion=True, points=tuple(current_position(backend, *each) for each in corners))


def mission(backend: LockstepMavros, count: int) -> list[Item]:
    way = [Waypoint(*current_position(backend, 5.0 + number, 3.0 * (number % 2)), 12.0) for number in range(count)]
    return [TakeOff(10.0), Speed(4.0), *way, HoldTime(2.0), ReturnToLaunch()]


@pytest.mark.parametrize("by", ["client", "daemon"])
def test_a_mission_that_was_cut_off_is_not_started(backend: LockstepMavros, tmp_path: Path, by: str) -> None:
    home_file = tmp_path / "uav_1.home"
    uploading: list[Future[Any]] = []
    cut = threading.Event()

    def on_taken(_: int, seq: int) -> None:
        if seq == 5 and not cut.is_set():
            cut.set()
            if by == "client":
                uploading[0].cancel()

    with UAL(backend, home_file=home_file) as uav:
        stand(uav)
        with backend.autopilot.lock:
            backend.autopilot.missions.on_taken = on_taken
            uploading.append(VehicleMission(uav.vehicle).upload(mission(backend, 30), ""))
        until(lambda: cut.is_set() or uploading[0].done(), "the cut", seen=uav.telemetry)
        assert cut.is_set(), uploading[0].exception()
        if by == "client":
            with pytest.raises(WrongStateError, match=r"upload the mission again|has no mission"):
                uav.mission.start()
            uav.mission.upload(mission(backend, 3))
            with pytest.raises(WrongStateError, match="LANDED_ARMED"):
                uav.mission.start()
    if by == "daemon":
        other = make("px4" if not isinstance(backend.autopilot, ArduPilot) else "ardupilot")
        with UAL(other, home_file=home_file) as uav:
            stand(uav)
            with pytest.raises(WrongStateError, match="upload the mission again"):
                uav.mission.start()


def test_a_fence_and_rally_points_are_kept_and_applied(uav: UAL, backend: LockstepMavros) -> None:
    circle = FenceZone(is_inclusion=False, points=(current_position(backend, 30.0, 30.0),), radius_m=5.0)
    plan = FencePlan(
        (square(backend), circle), (RallyPoint(*current_position(backend, 5.0, 0.0), 15, AltitudeReference.HOME),)
    )
    kept = uav.fence.upload(plan)
    assert kept == uav.fence.get()
    assert [(each.is_inclusion, each.points, each.radius_m) for each in kept.zones] == [
        (each.is_inclusion, each.points, each.radius_m) for each in plan.zones
    ]
    assert kept.rally_points == plan.rally_points
    assert kept.is_enabled is True
    lists = backend.autopilot.missions.lists
    assert (len(lists[FENCE]), len(lists[RALLY])) == (5, 1)
    until(lambda: (known := backend.snapshot().autopilot_fence) is not None and len(known.zones) == 2, "zones for UAL")
    with pytest.raises(WrongStateError, match="has another one"):
        uav.fence.upload(FencePlan((square(backend, 60.0),)))
    uav.fence.clear(with_rally_points=True)
    assert (lists[FENCE], lists[RALLY]) == ([], [])


def test_a_mission_of_sixty_items_is_read_back_as_it_was_sent(uav: UAL, backend: LockstepMavros) -> None:
    items = mission(backend, 56)
    kept = uav.mission.upload(items)
    assert [replace(each, number="") for each in kept.items[1:]] == [replace(each, number="") for each in items[1:]]
    assert uav.mission.download().digest == kept.digest
    on_autopilot = backend.autopilot.missions.lists[MISSION]
    own = on_autopilot[1:] if len(on_autopilot) == 61 else on_autopilot
    way = [each for each in items if isinstance(each, Waypoint)]
    assert [(each.x, each.y) for each in own if each.command == 16] == [
        (round(each.latitude_deg * 1e7), round(each.longitude_deg * 1e7)) for each in way
    ]
    uav.mission.clear()
    assert uav.mission.download().items == ()


def test_no_item_is_chosen_while_it_is_not_known_who_has_taken_the_uav(uav: UAL, backend: LockstepMavros) -> None:
    items = mission(backend, 3)
    uav.mission.upload(items)
    offer = backend.offer(AutopilotMissions)  # type: ignore[type-abstract]  # it is only looked for
    assert offer is not None
    asked = list[int]()

    def refusal() -> UalError | None:
        asked.append(backend.autopilot.mission.seq)
        return UndecidedError("the mode has changed") if len(asked) <= 3 else None

    before = backend.autopilot.mission.seq
    offer.set_current(items, 4, refusal, anew=False).result(LIMIT_S)
    assert asked[:4] == [before] * 4
    assert backend.autopilot.mission.seq != before


def test_what_the_autopilot_refuses_is_an_error(uav: UAL, backend: LockstepMavros) -> None:
    backend.autopilot.missions.refusal = 4  # NO_SPACE
    with pytest.raises(RejectedByAutopilotError, match="the autopilot has not taken it, MAVROS got as far as item"):
        uav.mission.upload(mission(backend, 3))


def test_another_list_than_was_sent_is_an_error(uav: UAL, backend: LockstepMavros) -> None:
    """MAVROS publishes what it has sent, too: that is not taken for what the autopilot has."""
    store = backend.autopilot.missions
    keep = store.keep
    store.keep = lambda kind, items: keep(kind, items[:-1])  # type: ignore[method-assign]
    with pytest.raises(RejectedByAutopilotError, match="keeps another one: it has 3 items instead of 4"):
        uav.fence.upload(FencePlan((square(backend),)))


def test_a_plugin_that_is_not_there_is_named(uav: UAL, backend: LockstepMavros) -> None:
    backend.node.denied |= {"mission", "geofence"}
    with pytest.raises(NotSupportedError, match="/mavros/mission/push"):
        uav.mission.upload(mission(backend, 3))
    with pytest.raises(NotSupportedError, match="/mavros/geofence/pull"):
        uav.fence.get()


def test_a_mavros_that_dies_in_an_upload_is_reported_and_the_next_one_reads(uav: UAL, backend: LockstepMavros) -> None:
    if backend.node.ros == 2:
        pytest.skip("it is not answered, and ends with its time: see the parameters")
    backend.node.dies_in = "mission/push"
    with pytest.raises(UalTimeoutError, match="it is not known which mission the autopilot has now"):
        uav.mission.upload(mission(backend, 3))
    until(lambda: uav.state() is State.LANDED_DISARMED, "a state", seen=uav.telemetry)
    assert uav.mission.download().items == ()


def test_a_plugin_that_is_busy_is_queried_again(uav: UAL, backend: LockstepMavros) -> None:
    with backend.autopilot.lock:
        for plugin in backend.node.lists:
            plugin.fetch()
    assert uav.mission.upload(mission(backend, 3)).items


@pytest.mark.parametrize("x", [473977418, -473977418, 0, 1, -1, 1799999999])
def test_coordinates_pass_mavros_exactly(x: int) -> None:
    """It multiplies by 1e7 and cuts off what is beyond; back it divides."""
    item = MissionItem(3, 16, 1.5, 2.0, 0.0, math.nan, x, -x, 12.5)
    sent = waypoint_of(item)
    on_wire = int(sent["x_lat"] * 1e7), int(sent["y_long"] * 1e7)
    assert on_wire == (x, -x)
    read = item_of({**sent, "x_lat": on_wire[0] / 1e7, "y_long": on_wire[1] / 1e7, "param4": None})
    assert (read.x, read.y, read[:5]) == (x, -x, item[:5])
    assert math.isnan(read.param4)
