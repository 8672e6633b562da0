"""A command that replaces a mission while the autopilot enters, pauses, resumes or ends it, in the vehicle's time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.simulators.px4 import LOITER
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight, px4_of
from tests.ual_daemon.backends.mavlink.test_autopilot_own_missions import FAR_M, at, position_m, start
from ual.errors import TaskAbortedError
from ual.types import State, Telemetry

_NEXT_UPDATES = (0, 1, 2, 4)
_TO_END_M = (3.0, 2.4, 2.0)


@pytest.fixture
def flight(tmp_path: Path) -> Iterator[Flight]:
    class Kept(Flight):
        home_file = tmp_path / "uav_1.home"

    flight = Kept("px4")
    yield flight
    flight.uav.close()


def _is_on_mission(telemetry: Telemetry) -> bool:
    return "our mission" in telemetry.state_reason


def _after(condition: Callable[[Telemetry], bool], updates_count: int) -> Callable[[Telemetry], bool]:
    """Returns a condition that holds a number of updates after the first that fulfils the given one."""
    passed: list[int] = []

    def is_due(telemetry: Telemetry) -> bool:
        if passed or condition(telemetry):
            passed.append(1)
        return len(passed) > updates_count

    return is_due


def _holds_by_ual(flight: Flight, acted_s: list[float]) -> None:
    flight.wait_for(lambda: bool(acted_s), "the command")
    flight.let_pass(6.0)
    telemetry = flight.uav.telemetry()
    assert (telemetry.state, telemetry.flight_mode) == (State.FLYING_AUTO, "OFFBOARD"), telemetry.state_reason
    assert flight.states_since(acted_s[0]) == [State.FLYING_AUTO]  # at no time was it said that others fly it


def _act_when(flight: Flight, condition: Callable[[Telemetry], bool], act: Callable[[], object]) -> list[float]:
    acted_s: list[float] = []

    def do() -> None:
        act()
        acted_s.append(flight.now_s)

    flight.when(condition, do)
    return acted_s


@pytest.mark.parametrize("updates_count", _NEXT_UPDATES)
def test_an_abort_while_the_mission_is_entered_takes_it_back(flight: Flight, updates_count: int) -> None:
    flight.take_off()
    acted_s = _act_when(flight, _after(_is_on_mission, updates_count), flight.uav.abort)
    start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)])
    _holds_by_ual(flight, acted_s)


@pytest.mark.parametrize("left_m", _TO_END_M)
def test_an_abort_as_the_mission_ends_is_no_take_over(flight: Flight, left_m: float) -> None:
    flight.take_off()
    acted_s = _act_when(flight, lambda _: position_m(flight)[0] > 12.0 - left_m, flight.uav.abort)
    start(flight, [at(flight, 4, 0, 3.0), at(flight, 12, 0, 3.0)])
    _holds_by_ual(flight, acted_s)


def test_an_abort_once_the_autopilot_holds_after_the_mission_is_no_take_over(flight: Flight) -> None:
    flight.take_off()
    acted_s = _act_when(flight, lambda telemetry: telemetry.flight_mode == "AUTO.LOITER", flight.uav.abort)
    start(flight, [at(flight, 4, 0, 3.0), at(flight, 8, 0, 3.0)])
    _holds_by_ual(flight, acted_s)


def test_a_go_to_as_the_mission_ends_is_executed(flight: Flight) -> None:
    flight.take_off()
    goal = flight.goal(0.0, 3.0)

    def go() -> None:
        flight.uav.go_to_waypoint(goal, blocking=False)

    acted_s = _act_when(flight, lambda _: position_m(flight)[0] > 9.6, go)
    start(flight, [at(flight, 4, 0, 3.0), at(flight, 12, 0, 3.0)])
    flight.wait_for(lambda: bool(acted_s), "the command")
    flight.wait_for(lambda: (flight.uav.pose().pose.position - goal.position).norm() < 1.0, "its goal")
    assert flight.states_since(acted_s[0]) == [State.FLYING_AUTO]


@pytest.mark.parametrize("ends", ["pausing", "resuming"])
def test_an_abort_while_it_pauses_or_resumes_takes_it_back(flight: Flight, ends: str) -> None:
    flight.take_off()
    start(flight, [at(flight, FAR_M, 0, 3.0), at(flight, FAR_M, FAR_M, 3.0)])
    flight.wait_for(lambda: position_m(flight)[0] > 3.0, "its way")
    if ends == "resuming":
        flight.uav.mission.pause()
        flight.wait_for(lambda: "holds on our mission" in flight.uav.telemetry().state_reason, "its hold")
    (flight.uav.mission.resume if ends == "resuming" else flight.uav.mission.pause)()
    flight.uav.abort()
    _holds_by_ual(flight, [flight.now_s])


def test_a_hold_of_a_ground_station_amid_the_mission_wins_over_an_abort(flight: Flight) -> None:
    flight.take_off()

    def act() -> None:
        flight.uav.abort()
        assert px4_of(flight).request_mode(LOITER)

    acted_s = _act_when(flight, lambda _: position_m(flight)[0] > 8.0, act)
    task = flight.uav.task(start(flight, [at(flight, FAR_M, 0, 3.0), at(flight, FAR_M, FAR_M, 3.0)]))
    flight.wait_for(lambda: bool(acted_s), "the command")
    with pytest.raises(TaskAbortedError):
        task.wait(0.0)
    flight.let_pass(6.0)
    assert flight.uav.state() is State.FLYING_MANUAL
    assert px4_of(flight).mode == LOITER
