"""Reports of a mission: against the mode in which it flies, and with the settings that it begins with."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import pytest

from tests.sitl.doing import HEIGHT_M, NORTH_DEG, waypoints
from tests.sitl.flights import PATIENCE_S, Flight
from tests.sitl.truth import Truth
from ual.errors import TaskAbortedError
from ual.missions import Item, MissionStage, Speed, TakeOff
from ual.types import State
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

TOLD_S = 1.0
SPEED_M_S, OVER = 2.0, 1.25
MISSION_MODES = {"PX4": "AUTO.MISSION", "ArduCopter": "AUTO"}
ENTERED_S = 5.0
"""Longest from a start or resume to that mode: PX4 reports once a second which item is its current one."""


def _wait_for_its_mode(flight: Flight) -> None:
    mode = MISSION_MODES[flight.pilot.autopilot]
    took_s = flight.wait_for(lambda: flight.uav.telemetry().flight_mode == mode, mode, ENTERED_S)
    print(f"{flight.pilot.autopilot}: {mode} after {took_s:.2f} s")


def _stages(flight: Flight, duration_s: float, is_over: Callable[[], bool] = lambda: False) -> set[MissionStage]:
    """Returns the stages that are told from a second on, for so long, or until something is over."""
    seen: set[MissionStage] = set()
    began_s = monotonic()

    def poll() -> bool:
        if monotonic() - began_s > TOLD_S:
            seen.add(flight.uav.mission.progress().stage)
        return monotonic() - began_s > duration_s or is_over()

    flight.wait_for(poll, "time to look")
    return seen


def test_its_stage_is_that_of_what_flies(flight: Flight, uav: UAL) -> None:
    flight.take_off()
    uav.mission.upload([*waypoints(flight, 1, 0, 1)])
    task = uav.task(uav.mission.start().id)
    _wait_for_its_mode(flight)
    assert _stages(flight, 3.0) == {MissionStage.ACTIVE}
    uav.mission.pause()
    assert _stages(flight, 4.0) == {MissionStage.PAUSED}
    uav.mission.resume()
    _wait_for_its_mode(flight)
    assert _stages(flight, 4.0) == {MissionStage.ACTIVE}
    uav.abort()
    with pytest.raises(TaskAbortedError):
        task.wait(PATIENCE_S)
    flight.wait_for_state(State.FLYING_AUTO)
    go_to = uav.go_to_waypoint(flight.offset(0.0, 12.0), max_speed_m_s=2.0, blocking=False)
    after = _stages(flight, 20.0, go_to.done)
    print(f"after its abort: {sorted(each.name for each in after)}")
    assert not after & {MissionStage.ACTIVE, MissionStage.COMPLETE}
    uav.land()
    flight.wait_for_state(State.LANDED_DISARMED)
    landed = _stages(flight, 4.0)
    print(f"after its landing: {sorted(each.name for each in landed)}")
    assert not landed & {MissionStage.ACTIVE, MissionStage.COMPLETE}


def test_a_mission_begins_with_a_speed_before_its_take_off(flight: Flight, uav: UAL, truth: Truth) -> None:
    flight.be_armed()
    point = uav.telemetry().position_geo
    assert point is not None
    away = waypoints(flight, 1)
    items: list[Item] = [Speed(SPEED_M_S), TakeOff(HEIGHT_M), *away]
    uav.mission.upload(items)
    task = uav.task(uav.mission.start().id)
    fastest_m_s = [0.0]

    def poll() -> bool:
        fastest_m_s[0] = max(fastest_m_s[0], truth.speed_m_s)
        return truth.distance_m((point.latitude_deg + NORTH_DEG, point.longitude_deg)) < 8.0

    flight.wait_for(poll, "its place", 60.0)
    print(f"{flight.pilot.autopilot}: {fastest_m_s[0]:.2f} m/s at most, {SPEED_M_S} asked")
    assert 0.5 * SPEED_M_S < fastest_m_s[0] < OVER * SPEED_M_S
    task.wait(PATIENCE_S)
