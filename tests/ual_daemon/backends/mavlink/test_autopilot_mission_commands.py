"""Commands to a mission from several threads: while the autopilot flies it, UAL says so, and its abort works."""

from __future__ import annotations

import random
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.conftest import LIMIT_S
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from tests.ual_daemon.backends.mavlink.test_autopilot_own_missions import FAR_M, at
from ual.errors import UalError
from ual.types import State

_COMMANDS_COUNT = 5


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Flight]:
    class Kept(Flight):
        home_file = tmp_path / "uav_1.home"

    flight = Kept(str(request.param))
    yield flight
    flight.uav.close()


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
