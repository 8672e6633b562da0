"""A mission of UAL that another station replaces while it is flown, in the vehicle's time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import LIMIT_S
from tests.simulators import ArduPilot, Px4
from tests.simulators.ardupilot import AUTO
from tests.simulators.px4 import MISSION
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from tests.ual_daemon.backends.mavlink.test_autopilot_own_missions import FAR_M, at, keeping, landing, position_m, start
from ual.errors import TaskAbortedError, WrongStateError
from ual.missions import Item
from ual.types import State

REPLACED = "has another mission now, which UAL has not started: another station has brought it"


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Flight]:
    yield from keeping(str(request.param), tmp_path)


def bring(flight: Flight, count: int, changed: tuple[int, ...] = ()) -> float:
    """Another station brings the first items of the mission, some of them 30 m higher. Returns when."""
    items = flight.autopilot.missions.lists[0]
    brought = [each._replace(z=each.z + 30.0 * (seq in changed)) for seq, each in enumerate(items[:count])]
    flight.autopilot.station_uploads(brought)
    return flight.now_s


def four(flight: Flight) -> list[Item]:
    return [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M), at(flight, 0, FAR_M), at(flight, 0, FAR_M + 9)]


@pytest.mark.parametrize(("count", "changed"), [(3, ()), (5, (1,))])  # told by the number of items, and by a text
def test_one_that_is_replaced_in_flight_ends_at_once(flight: Flight, count: int, changed: tuple[int, ...]) -> None:
    """ArduPilot: it was told as ours, and SUCCEEDED with items unflown."""
    flight.take_off()
    task = flight.uav.task(start(flight, four(flight)))
    flight.wait_for(lambda: position_m(flight)[0] > 5.0, "its way")
    brought_s = bring(flight, count, changed)
    with pytest.raises(TaskAbortedError, match=REPLACED):
        task.wait(LIMIT_S)
    assert flight.first_s(lambda told: told.state is State.FLYING_MANUAL, brought_s) < brought_s + 3.0
    flight.wait_for(lambda: held_by(flight) == "ground station", "who holds it")
    flight.uav.recover_from_manual()
    assert held_by(flight) == ""


def test_one_that_is_replaced_in_its_pause_ends_at_once(flight: Flight) -> None:
    """It was told only as it went on (campaign, ArduCopter 11300048: 1.4 s)."""
    flight.take_off()
    task = flight.uav.task(start(flight, four(flight)))
    flight.wait_for(lambda: position_m(flight)[0] > 2.0, "its way")
    flight.uav.mission.pause()
    flight.wait_for(lambda: "holds on our mission" in flight.uav.telemetry().state_reason, "its hold")
    brought_s = bring(flight, 5, (1,))
    with pytest.raises(TaskAbortedError, match=REPLACED):
        task.wait(LIMIT_S)
    assert flight.first_s(lambda told: told.state is State.FLYING_MANUAL, brought_s) < brought_s + 2.0


def held_by(flight: Flight) -> str:
    health = flight.uav.telemetry().health
    return "" if health is None else health.held_by


@pytest.mark.parametrize("flight", ["ardupilot"], indirect=True)  # it says nothing of what is further on
@pytest.mark.parametrize("is_landing", [True, False])
def test_one_whose_further_items_are_replaced_never_succeeds(flight: Flight, *, is_landing: bool) -> None:
    flight.take_off()
    way: list[Item] = [at(flight, 8.0 * step, 0) for step in range(1, 6)]
    end: Item = landing(flight, 40, 8) if is_landing else at(flight, 40, 8)
    task = flight.uav.task(start(flight, [*way, end]))
    flight.wait_for(lambda: position_m(flight)[0] > 2.0, "its way")
    items = flight.autopilot.missions.lists[0]
    flight.autopilot.station_uploads([*items[:-1], items[-1]._replace(x=items[-1].x + 100)])
    assert not flight.autopilot.said.startswith("Auto mission changed")
    with pytest.raises(TaskAbortedError, match=REPLACED):
        task.wait(LIMIT_S)


def test_one_that_is_replaced_as_it_is_started_ends(flight: Flight) -> None:
    """Reports about the mission were noted only then: the one of the other station counted as ours. What is reported
    before the start is not started.
    """
    flight.take_off()
    flight.when(lambda told: told.task is not None, lambda: flight.autopilot.station_uploads(brought))
    items = four(flight)
    flight.uav.mission.upload(items)
    brought = flight.autopilot.missions.lists[0][:3]
    task = flight.uav.task(flight.uav.mission.start().id)
    with pytest.raises(TaskAbortedError, match=f"{REPLACED}|brought another mission since this one was read"):
        task.wait(LIMIT_S)
    flight.wait_for_state(State.FLYING_MANUAL, State.FLYING_AUTO)


def test_the_same_mission_that_is_brought_again_is_still_ours(flight: Flight) -> None:
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, 12, 0), at(flight, 12, 12)]))
    flight.wait_for(lambda: position_m(flight)[0] > 2.0, "its way")
    bring(flight, 9)
    assert task.wait(LIMIT_S).status.name == "SUCCEEDED"


@pytest.mark.parametrize("is_ours", [True, False])
def test_one_in_which_another_station_jumps_over_items_does_not_succeed(flight: Flight, *, is_ours: bool) -> None:
    """It SUCCEEDED without them. A jump of UAL leaves them out on purpose."""
    flight.take_off()
    ways: list[Item] = [at(flight, 8, 0), at(flight, 8, 8), at(flight, 0, 8), at(flight, 0, 16)]
    task = flight.uav.task(start(flight, ways))
    flight.wait_for(lambda: position_m(flight)[0] > 2.0, "its way")
    if is_ours:
        flight.uav.mission.jump_to(4)
        assert task.wait(LIMIT_S).status.name == "SUCCEEDED"
        return
    assert flight.autopilot.mission.choose(3 if isinstance(flight.autopilot, Px4) else 4)
    flight.wait_for(lambda: "jumped over item 2" in flight.uav.telemetry().state_reason, "that it is told")
    with pytest.raises(
        TaskAbortedError, match=r"without item 1 .*, item 2 .*, item 3 .*another station has jumped"
    ) as error:
        task.wait(LIMIT_S)
    assert error.value.metadata["by"] == "ground station"
    flight.wait_for_state(State.FLYING_AUTO)


def test_a_landing_ends_no_mission_of_others_before_the_control_was_queried_back(flight: Flight) -> None:
    """A pilot's own mission ended with `land` in the cleanup of a program: docs/evidence/decisions/0050."""
    flight.take_off()
    flight.uav.mission.upload(four(flight))
    if isinstance(flight.autopilot, Px4):
        assert flight.autopilot.request_mode(MISSION)
    else:
        assert isinstance(flight.autopilot, ArduPilot)
        assert flight.autopilot.set_mode(AUTO)
    flight.wait_for_state(State.FLYING_MANUAL)
    since_s = flight.now_s
    with pytest.raises(WrongStateError, match="a mission that UAL has not begun; recover_from_manual") as refused:
        flight.uav.land()
    assert refused.value.metadata["needed"] == "FLYING_AUTO"
    assert flight.commands_since(since_s) == set()
    flight.wait_for(lambda: held_by(flight) == "ground station", "who holds it")
    flight.uav.recover_from_manual()
    flight.land()
