"""Missions that the autopilot flies by itself, through a simulated MAVROS: begun, paused, jumped, taken, ended."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.conftest import LIMIT_S
from tests.ual_daemon.backends.mavros.test_mavros_faults import Flight, make
from tests.ual_daemon.backends.mavros.test_mavros_lists import current_position
from ual.errors import TaskAbortedError, WrongStateError
from ual.missions import HoldTime, Item, Jump, ReturnToLaunch, TakeOff, Waypoint
from ual.missions.plan import LinkLossAction, MissionStage
from ual.types import State, TaskStatus
from ual_daemon import UAL
from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.firmwares.mission_items import MissionItem
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.mavros.missions import MissionTopics, waypoint_of


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    backend = make(request.param)
    with UAL(backend, allow_arming=True) as uav:
        yield Flight(backend, uav)


def at(flight: Flight, north_m: float, east_m: float) -> Waypoint:
    return Waypoint(*current_position(flight.backend, north_m, east_m), 6.0)


def stand_armed(flight: Flight) -> None:
    flight.backend.autopilot.pilot_readies()
    flight.until(flight.uav.is_ready)
    flight.until(lambda: flight.uav.telemetry().position_geo is not None)
    flight.uav.arm()
    flight.until_state(State.LANDED_ARMED)
    earth = flight.backend.snapshot
    flight.until(lambda: earth().earth.home_geo is not None and earth().earth.projection is not None)


def item_of(flight: Flight) -> int:
    return flight.uav.mission.progress().item or 0


def test_it_is_executed_from_the_ground_and_ends_in_the_air(flight: Flight) -> None:
    stand_armed(flight)
    flight.uav.mission.upload([TakeOff(6.0), at(flight, 8, 0), at(flight, 8, 8)])
    begun_count = flight.setpoints_count
    task = flight.uav.task(flight.uav.mission.start().id)
    flight.until(lambda: "the autopilot flies our mission: item 2 of 3" in flight.uav.telemetry().state_reason)
    assert flight.uav.telemetry().state in (State.TAKING_OFF, State.FLYING_AUTO)
    assert flight.setpoints_count == begun_count
    assert task.wait(LIMIT_S).status is TaskStatus.SUCCEEDED
    assert flight.uav.state() is State.FLYING_AUTO
    assert flight.uav.mission.progress().reached == 3


def test_it_begins_in_the_air_jumps_back_and_returns() -> None:
    backend = make("ardupilot")
    with UAL(backend, allow_arming=True) as uav:
        flight = Flight(backend, uav)
        flight.fly()
        items: list[Item] = [at(flight, 4, 0), at(flight, 4, 4), Jump(1, 1), HoldTime(1.0), ReturnToLaunch()]
        uav.mission.upload(items)
        assert uav.task(uav.mission.start().id).wait(LIMIT_S).status is TaskStatus.SUCCEEDED
        assert backend.autopilot.landed_state == 1


def test_it_is_paused_resumed_jumped_and_taken_by_the_pilot(flight: Flight) -> None:
    flight.fly()
    flight.uav.mission.upload([at(flight, 60, 0), at(flight, 60, 20), at(flight, 0, 20)])
    task = flight.uav.task(flight.uav.mission.start().id)
    flight.until(lambda: flight.backend.autopilot.current_position[0] > 3.0)
    flight.uav.mission.pause()
    flight.until(lambda: "holds on our mission" in flight.uav.telemetry().state_reason)
    flight.uav.mission.resume()
    north_m = flight.backend.autopilot.current_position[0]
    flight.until(lambda: flight.backend.autopilot.current_position[0] > north_m + 3.0)
    flight.uav.mission.jump_to(3)
    flight.until(lambda: item_of(flight) == 3)
    flight.backend.autopilot.pilot_take_over()
    with pytest.raises(TaskAbortedError):
        task.wait(LIMIT_S)
    assert flight.uav.state() is State.FLYING_MANUAL


def test_it_is_stopped_while_its_position_is_lost(flight: Flight) -> None:
    flight.fly()
    flight.uav.mission.upload([at(flight, 300, 0), at(flight, 300, 20)])
    task = flight.uav.task(flight.uav.mission.start().id)
    flight.until(lambda: flight.backend.autopilot.current_position[0] > 3.0)
    builders = flight.backend.autopilot.builders
    told = builders[mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED]
    builders[mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED] = lambda: None
    flight.until(lambda: flight.uav.state() is State.UNINITIALIZED)
    flight.uav.abort()
    with pytest.raises(TaskAbortedError, match="cancelled"):
        task.wait(LIMIT_S)
    flight.until(lambda: "has stopped its mission" in flight.uav.telemetry().state_reason)
    builders[mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED] = told
    flight.until(lambda: flight.uav.telemetry().flight_mode in ("OFFBOARD", "GUIDED"))
    flight.until_state(State.FLYING_AUTO)


@pytest.mark.parametrize(
    ("told", "is_over"),
    [
        ([("current", 1), ("reached", 1)], False),
        ([("current", 1), ("reached", 1), ("current", 2), ("reached", 2)], True),
        ([("current", 2), ("reached", 2), ("current", 2)], False),  # it flies there again: of a flight before
        ([("current", 2), ("reached", 2), ("current", 2), ("reached", 2)], True),
    ],
)
def test_arducopter_is_over_once_it_has_reached_the_last_item(told: list[tuple[str, int]], is_over: bool) -> None:
    """It stays in its mode, and MAVROS passes on no end. What was reached last comes again with a subscription."""
    mission = MissionTopics(ArduCopter())
    items = [waypoint_of(MissionItem(3, 16, x=1, y=1)) for _ in range(3)]
    for kind, seq in told:
        if kind == "current":
            mission.handlers[topics.MISSION]({"current_seq": seq, "waypoints": items}, 1.0)
        else:
            mission.handlers[topics.REACHED]({"wp_seq": seq}, 2.0)
    assert mission.heard is not None
    assert (mission.heard.stage is MissionStage.COMPLETE) is is_over


def test_one_that_jumps_back_at_its_end_is_not_over_there() -> None:
    mission = MissionTopics(ArduCopter())
    items = [waypoint_of(MissionItem(3, command)) for command in (16, 16, 16, 177)]
    mission.handlers[topics.MISSION]({"current_seq": 2, "waypoints": items}, 1.0)
    mission.handlers[topics.REACHED]({"wp_seq": 2}, 2.0)
    assert mission.heard is not None
    assert mission.heard.stage is MissionStage.UNKNOWN


def test_what_the_autopilot_does_without_us_is_read(flight: Flight) -> None:
    stand_armed(flight)
    flight.uav.mission.upload([TakeOff(6.0), at(flight, 8, 0), ReturnToLaunch()])
    with pytest.raises(WrongStateError, match="once its ground station is lost"):
        flight.uav.mission.start(on_link_loss=LinkLossAction.LAND)
