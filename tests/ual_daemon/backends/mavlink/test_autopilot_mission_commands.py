"""Commands to a mission from several threads: while the autopilot flies it, UAL says so, and its abort works."""

from __future__ import annotations

import os
import random
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import LIMIT_S
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from tests.ual_daemon.backends.mavlink.test_autopilot_own_missions import FAR_M, at, keeping
from tests.waiting import until
from ual.errors import UalError
from ual.types import State, Telemetry
from ual_daemon.backends.mavlink.wire.messages import mavlink
from ual_daemon.backends.values import Cause
from ual_daemon.services.mission import VehicleMission

_COMMANDS_COUNT = 5
_SEEDS_COUNT = int(os.environ.get("UAL_TEST_MISSION_EXAMPLES", "3"))
_COMMANDED_S = 30.0
_OURS = ("OFFBOARD", "GUIDED")
_OTHERS = {cause.value for cause in Cause}


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Flight]:
    yield from keeping(str(request.param), tmp_path)


def command_by_turns(flight: Flight, seed: int) -> None:
    """One of the threads that command, each at times of its own."""
    chance, mission = random.Random(seed), flight.uav.mission
    commands: list[Callable[[], object]] = [
        mission.start,
        mission.start,
        mission.pause,
        mission.resume,
        flight.uav.abort,
        lambda: mission.jump_to(2),
    ]
    for _ in range(_COMMANDS_COUNT):
        flight.let_pass(chance.uniform(0.0, 0.6))
        try:
            chance.choice(commands)()
        except UalError as error:
            refused = str(error)
            assert "INTERNAL" not in refused


@pytest.mark.parametrize("seed", range(3))
def test_a_mission_of_ual_is_not_lost_by_its_own_commands(flight: Flight, seed: int) -> None:
    """It was told as flown by the safety pilot or a ground station, where only UAL had commanded."""
    flight.take_off()
    flight.uav.mission.upload([at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M), at(flight, 0, FAR_M)])
    begun_s = flight.now_s
    threads = [threading.Thread(target=command_by_turns, args=(flight, 3 * seed + each)) for each in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LIMIT_S)
    flight.let_pass(3.0)
    assert State.FLYING_MANUAL not in flight.states_since(begun_s)
    flight.uav.abort()
    flight.wait_for(lambda: flight.uav.telemetry().flight_mode in ("OFFBOARD", "GUIDED"), "the control")


class Caller:
    """One of the programs that command, at moments of the vehicle's time: the next one once the one before is answered.

    It acts on the backend's thread, between two updates: each seed is one interleaving, on a busy computer too.
    """

    def __init__(self, flight: Flight, seed: int) -> None:
        self._chance, self._commands = random.Random(seed), flight.uav.vehicle.commands
        missions = VehicleMission(flight.uav.vehicle)
        self._choices: list[Callable[[], Future[Any] | None]] = [
            lambda: missions.start(1, None, ""),
            lambda: missions.start(1, None, ""),
            lambda: missions.pause(""),
            lambda: missions.resume(""),
            self._commands.abort,
            lambda: missions.jump_to(2, ""),
        ]
        self._waits_for: Future[Any] | None = None
        self._next_s = flight.now_s
        self.ends: list[UalError] = []

    def step(self, now_s: float) -> None:
        """Commands something, if it is time."""
        if self._waits_for is not None and self._waits_for.done():
            self._note(self._waits_for.exception())
            self._waits_for, self._next_s = None, now_s + self._chance.uniform(0.0, 0.6)
        if self._waits_for is not None or now_s < self._next_s:
            return
        self._next_s = now_s + self._chance.uniform(0.0, 0.6)
        try:
            self._waits_for = self._chance.choice(self._choices)()
        except UalError as error:
            self._note(error)

    def _note(self, error: BaseException | None) -> None:
        if error is not None:
            assert isinstance(error, UalError), error
            self.ends.append(error)


class Judge:
    """Judge of each sample of telemetry while only UAL commands."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._flown_s: float | None = None
        self.broken: list[str] = []

    def poll_once(self, told: Telemetry) -> None:
        """Looks at one."""
        if told.state is not State.FLYING_AUTO:
            self._say("the state", told)
        if told.health is not None and told.health.held_by:
            self._say(f"held by {told.health.held_by}", told)
        now_s = self._flight.now_s
        is_mission = told.flight_mode in ("AUTO.MISSION", "AUTO")
        self._flown_s = (self._flown_s or now_s) if is_mission else None
        if self._flown_s is not None and now_s - self._flown_s > 1.0 and "mission" not in told.state_reason:
            self._say("no mission", told)

    def _say(self, what: str, told: Telemetry) -> None:
        if len(self.broken) < 5:
            self.broken.append(f"{self._flight.now_s:.2f} s: {what}: {told.state.name}, {told.state_reason}")


@pytest.mark.parametrize("seed", range(_SEEDS_COUNT))
def test_what_three_programs_command_between_updates_loses_no_mission(flight: Flight, seed: int) -> None:
    """While the autopilot flies UAL's mission, UAL says so, names nobody else, and its abort works."""
    flight.take_off()
    flight.uav.mission.upload([at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M), at(flight, 0, FAR_M)])
    judge, callers, aborted_s = Judge(flight), list[Caller](), list[float]()
    begin_s = flight.now_s

    def act(told: Telemetry) -> None:
        if not callers:
            callers.extend(Caller(flight, 3 * seed + number) for number in range(3))
        judge.poll_once(told)
        if flight.now_s < begin_s + _COMMANDED_S:
            for caller in callers:
                caller.step(flight.now_s)
        elif not aborted_s and flight.now_s >= begin_s + _COMMANDED_S + 3.0:
            aborted_s.append(flight.now_s)
            flight.uav.vehicle.commands.abort()

    flight.uav.vehicle.subscribe(act)
    until(lambda: bool(aborted_s), "the last abort", seen=flight.uav.telemetry)
    flight.wait_for(lambda: flight.uav.telemetry().flight_mode in _OURS or flight.now_s > aborted_s[0] + 8.0, "its end")
    assert judge.broken == []
    assert flight.uav.telemetry().flight_mode in _OURS
    ends = [error for caller in callers for error in caller.ends]
    assert [error for error in ends if error.reason == "INTERNAL"] == []
    assert [error for error in ends if error.metadata.get("by") in _OTHERS - {""}] == []


def test_one_command_has_ardupilot_enter_its_mission_and_begin_it() -> None:
    """Between AUTO and MISSION_START a pilot could take over, or the daemon end: the next one came 20 ms later."""
    flight = Flight("ardupilot")
    try:
        flight.take_off()
        flight.uav.mission.upload([at(flight, FAR_M, 0)])
        asked_s = flight.now_s
        flight.uav.mission.start()
        flight.wait_for(lambda: flight.uav.telemetry().flight_mode == "AUTO", "its mission")
        assert flight.commands_since(asked_s) == {mavlink.MAV_CMD_MISSION_START}
    finally:
        flight.uav.close()
