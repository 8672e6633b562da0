"""Missions that simulated autopilots fly by themselves, as tasks of UAL, in the vehicle's time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.conftest import LIMIT_S
from tests.simulators import Faults, Px4
from tests.simulators.ardupilot import BRAKE, GUIDED
from tests.simulators.mission_flight import COMPLETE
from tests.simulators.mission_store import Sender
from tests.simulators.px4 import LOITER, OFFBOARD
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from ual.errors import (
    GeofenceError,
    InvalidArgumentError,
    TaskAbortedError,
    UalError,
    WrongStateError,
)
from ual.geometry import Twist, Vector3
from ual.interface import Task
from ual.missions import HoldTime, Item, Jump, Land, ReturnToLaunch, Speed, TakeOff, Waypoint
from ual.missions.plan import LinkLossAction, MissionProgress, MissionStage
from ual.types import State, TaskKind, TaskStatus, Telemetry
from ual_daemon.backends.mavlink.wire.messages import Message

HOME = (47.3977428, 8.5455967)
SILENT = Faults(is_silent=True)
FAR_M = 300.0
"""Distance in metres at which a busy computer acts before the end, though simulated time passes meanwhile."""
PILOTS_MODES = ("POSCTL", "LOITER")
LOSSY = Faults(loss=0.2, duplication=0.05, jitter_s=0.05)


def keeping(kind: str, directory: Path) -> Iterator[Flight]:
    """A flight whose daemons keep home, and so missions, in a directory; closed when it goes on."""

    class Kept(Flight):
        home_file = directory / "uav_1.home"

    flight = Kept(kind)
    yield flight
    flight.uav.close()


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Flight]:
    yield from keeping(str(request.param), tmp_path)


def at(flight: Flight, north_m: float, east_m: float, altitude_m: float = 6.0, **more: Any) -> Waypoint:
    """A waypoint so far from where the autopilot's frame begins."""
    place = flight.autopilot.projection.to_geo(Vector3(east_m, north_m, 0.0))
    return Waypoint(round(place.latitude_deg, 7), round(place.longitude_deg, 7), altitude_m, **more)


def landing(flight: Flight, north_m: float, east_m: float) -> Land:
    place = at(flight, north_m, east_m)
    return Land(place.latitude_deg, place.longitude_deg)


def box(flight: Flight) -> list[Item]:
    return [TakeOff(6.0), at(flight, 12, 0), at(flight, 12, 12), at(flight, 0, 12), landing(flight, 0, 0)]


def wait_for_position(flight: Flight) -> None:
    def is_placed() -> bool:
        snapshot = flight.backend.snapshot()
        return snapshot.motion.position_geo is not None and snapshot.earth.projection is not None

    flight.wait_for(is_placed, "its place on Earth")


def stand_armed(flight: Flight) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    wait_for_position(flight)
    assert flight.autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    flight.wait_for(flight._is_take_off_planned, "what a mission needs")


def start(flight: Flight, items: list[Item], first: int = 1) -> str:
    flight.uav.mission.upload(items)
    return flight.uav.mission.start(first).id


def mission_file(flight: Flight) -> Path:
    return (flight.home_file or Path()).with_suffix(".mission")


def item_of(flight: Flight) -> int | None:
    return flight.uav.mission.progress().item


def wait_for_item(flight: Flight, item: int) -> None:
    flight.wait_for(lambda: (item_of(flight) or 0) >= item, f"item {item}")


def position_m(flight: Flight) -> tuple[float, float, float]:
    north, east, down = flight.autopilot.current_position
    return north, east, -down


def test_a_mission_is_executed_from_the_ground_to_its_landing(flight: Flight) -> None:
    stand_armed(flight)
    begun_s = flight.now_s
    at_third: list[tuple[TaskKind, str, MissionStage]] = []

    def note() -> None:
        told = flight.uav.telemetry()
        assert told.task is not None
        at_third.append((told.task.kind, told.state_reason, flight.uav.mission.progress().stage))

    flight.when(lambda told: told.task is not None and told.task.waypoint_index == 2, note)
    task = flight.uav.task(start(flight, box(flight)))
    info = task.wait(LIMIT_S)
    assert info.status is TaskStatus.SUCCEEDED
    ((kind, reason, stage),) = at_third
    assert (kind, stage) == (TaskKind.MISSION, MissionStage.ACTIVE)
    assert "the autopilot flies our mission: item 3" in reason
    north, east, _ = position_m(flight)
    assert math.hypot(north, east) < 1.5
    flight.wait_for_state(State.LANDED_DISARMED)
    assert State.FLYING_MANUAL not in flight.states_since(begun_s)
    assert [each for each in flight.autopilot.setpoints_s if each > begun_s] == []


def test_it_is_watched_until_the_caller_ends_it(flight: Flight) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    wait_for_position(flight)
    flight.wait_for(lambda: flight.uav.mission.progress().stage is MissionStage.NONE, "what it says of its mission")
    watched = flight.uav.mission.watch()
    assert next(watched).stage is MissionStage.NONE
    flight.uav.mission.upload(box(flight))
    assert next(watched).stage is MissionStage.NOT_STARTED


def test_a_mission_that_does_not_land_ends_with_the_uav_held_by_ual(flight: Flight) -> None:
    stand_armed(flight)
    task = flight.uav.task(start(flight, [TakeOff(6.0), at(flight, 8, 0), at(flight, 8, 8)]))
    assert task.wait(LIMIT_S).status is TaskStatus.SUCCEEDED
    assert flight.uav.state() is State.FLYING_AUTO
    flight.let_pass(3.0)
    north, east, up = position_m(flight)
    assert math.dist((north, east, up), (8.0, 8.0, 6.0)) < 2.0
    holders = {told.health.held_by for _, told in list(flight.seen) if told.health is not None}
    assert holders == {""}  # a real PX4's own hold after a mission was told as that for 0.5 s
    flight.uav.go_to_waypoint(flight.goal(3.0, 0.0))
    flight.land()


def test_the_progress_of_a_next_mission_begins_empty(flight: Flight) -> None:
    """The item that the one before had reached last was told under the identifier of the new task."""
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, 6, 0), at(flight, 6, 6)]))
    assert task.wait(LIMIT_S).status is TaskStatus.SUCCEEDED
    assert flight.uav.mission.progress().reached == 2
    first_id, begun = task.id, list[MissionProgress]()
    flight.when(
        lambda told: told.task is not None and told.task.id != first_id,
        lambda: begun.append(flight.uav.mission.progress()),
    )
    task_id = flight.uav.mission.start().id
    flight.wait_for(lambda: bool(begun), "its task")
    assert (begun[0].task_id, begun[0].reached) == (task_id, None)
    flight.wait_for(lambda: flight.uav.mission.progress().reached == 1, "its first item")
    assert flight.uav.task(task_id).wait(LIMIT_S).status is TaskStatus.SUCCEEDED


def test_a_mission_begins_in_the_air_jumps_and_returns(flight: Flight) -> None:
    flight.take_off()
    items = [at(flight, 6, 0), at(flight, 6, 6), Jump(1, 1), HoldTime(3.0), ReturnToLaunch()]
    task = flight.uav.task(start(flight, items))
    assert task.wait(LIMIT_S).status is TaskStatus.SUCCEEDED
    assert flight.autopilot.landed_state == 1
    reached = flight.uav.mission.progress().reached
    assert reached is not None


def test_it_is_paused_resumed_jumped_and_aborted(flight: Flight) -> None:
    stand_armed(flight)
    far = [TakeOff(6.0), at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M), at(flight, 0, FAR_M)]
    task = flight.uav.task(start(flight, far))
    wait_for_item(flight, 2)
    flight.wait_for(lambda: position_m(flight)[0] > 10.0, "its way")
    flight.uav.mission.pause()
    flight.wait_for(lambda: "holds on our mission" in flight.uav.telemetry().state_reason, "its hold")
    assert flight.uav.state() is State.FLYING_AUTO
    flight.wait_for(lambda: flight.uav.velocity().twist.linear.norm() < 0.2, "its rest")
    flight.let_pass(3.0)
    held = position_m(flight)
    flight.let_pass(5.0)
    assert math.dist(held, position_m(flight)) < 0.3
    assert task.info().is_paused
    flight.uav.mission.resume()
    flight.wait_for(lambda: position_m(flight)[0] > held[0] + 5.0, "its way again")
    assert item_of(flight) == 2
    flight.uav.mission.jump_to(4)
    assert item_of(flight) == 4
    flight.wait_for(lambda: position_m(flight)[1] > 3.0, "the other way")
    flight.uav.abort()
    with pytest.raises(TaskAbortedError, match="cancelled"):
        task.wait(LIMIT_S)
    flight.wait_for_state(State.FLYING_AUTO)
    flight.wait_for(lambda: flight.uav.velocity().twist.linear.norm() < 0.1, "its rest")
    flight.land()


@pytest.mark.parametrize("command", ["go_to_waypoint", "follow_path", "land", "return_to_launch"])
def test_any_flying_command_replaces_it(flight: Flight, command: str) -> None:
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)]))
    flight.wait_for(lambda: "our mission" in flight.uav.telemetry().state_reason, "the mission")
    flight.wait_for(lambda: flight.uav.velocity().twist.linear.norm() > 1.0, "its way")
    uav, goal = flight.uav, flight.goal(-6.0, 0.0)
    calls: dict[str, Callable[[], Any]] = {
        "go_to_waypoint": lambda: uav.go_to_waypoint(goal),
        "follow_path": lambda: uav.follow_path([goal]),
        "land": uav.land,
        "return_to_launch": lambda: uav.return_to_launch(8.0),
    }
    calls[command]()
    with pytest.raises(TaskAbortedError, match=f"replaced by {command}"):
        task.wait(LIMIT_S)
    if command in ("go_to_waypoint", "follow_path"):
        assert (flight.uav.pose().pose.position - goal.position).norm() < 1.0
        assert flight.uav.state() is State.FLYING_AUTO


def test_a_stream_of_references_does_not_replace_it(flight: Flight) -> None:
    flight.take_off()
    start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)])
    flight.wait_for(lambda: "our mission" in flight.uav.telemetry().state_reason, "the mission")
    with pytest.raises(WrongStateError, match=r"the autopilot flies a mission; stop it first \(abort\)"):
        flight.uav.set_velocity(Twist(Vector3(1.0, 0.0, 0.0)))
    with pytest.raises(WrongStateError, match="the autopilot flies a mission now"):
        flight.uav.mission.upload([at(flight, 5, 5)])
    flight.uav.abort()
    flight.wait_for_state(State.FLYING_AUTO)


def test_the_pilot_takes_it_as_always(flight: Flight) -> None:
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)]))
    flight.wait_for(lambda: flight.uav.velocity().twist.linear.norm() > 2.0, "its way")
    flight.autopilot.pilot_take_over()
    with pytest.raises(TaskAbortedError, match="the safety pilot took over"):
        task.wait(LIMIT_S)
    taken_s = flight.now_s
    flight.wait_for_state(State.FLYING_MANUAL)
    flight.let_pass(2.0)
    assert [each for each in flight.autopilot.setpoints_s if each > taken_s] == []
    assert flight.commands_since(taken_s) == set()


def test_it_goes_on_without_a_link_and_its_task_with_it(flight: Flight) -> None:
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, 120, 0), at(flight, 120, 30)]))
    flight.wait_for(lambda: position_m(flight)[0] > 5.0, "its way")
    flight.link.down = flight.link.up = SILENT
    flight.wait_for_state(State.UNINITIALIZED)
    flight.let_pass(6.0)
    assert task.info().status is TaskStatus.RUNNING
    assert "the autopilot flies on by itself" in task.info().description
    flight.link.down = flight.link.up = Faults()
    flight.wait_for_state(State.FLYING_AUTO)
    assert task.wait(LIMIT_S).status is TaskStatus.SUCCEEDED


def test_a_long_silence_in_which_another_mission_came_makes_it_theirs(flight: Flight) -> None:
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)]))
    flight.wait_for(lambda: position_m(flight)[0] > 5.0, "its way")
    flight.link.down = flight.link.up = SILENT
    flight.wait_for_state(State.UNINITIALIZED)
    flight.let_pass(11.0)
    store = flight.autopilot.missions
    with flight.autopilot.lock:
        store.keep(0, [*store.lists[0], store.lists[0][-1]])
        flight.autopilot.mission.state = 3
    flight.link.down = flight.link.up = Faults()
    with pytest.raises(TaskAbortedError, match="has another mission now, which UAL has not started"):
        task.wait(LIMIT_S)


@pytest.mark.parametrize("flight", ["px4"], indirect=True)  # ArduPilot tells no checksum
def test_another_mission_that_came_in_flight_is_not_reported_as_ours(flight: Flight) -> None:
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)]))
    flight.wait_for(lambda: position_m(flight)[0] > 5.0, "its way")
    store = flight.autopilot.missions
    with flight.autopilot.lock:
        store.keep(0, [*store.lists[0], store.lists[0][-1]])
    with pytest.raises(TaskAbortedError, match="has another mission now, which UAL has not started"):
        task.wait(LIMIT_S)
    flight.wait_for_state(State.FLYING_MANUAL)
    flight.let_pass(1.0)
    assert flight.uav.telemetry().state_reason.endswith("; the ground station has brought another mission")


def test_another_mission_that_came_in_a_pause_is_not_executed(flight: Flight) -> None:
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, 90, 0), at(flight, 90, 90)]))
    flight.uav.mission.pause()
    flight.wait_for(lambda: "holds on our mission" in flight.uav.telemetry().state_reason, "its hold")
    store = flight.autopilot.missions
    with flight.autopilot.lock:
        store.keep(0, [*store.lists[0], store.lists[0][-1]])
    held = flight.uav.telemetry().flight_mode
    flight.uav.mission.resume()
    with pytest.raises(TaskAbortedError, match="has another mission now, which UAL has not started"):
        task.wait(LIMIT_S)
    assert flight.uav.telemetry().flight_mode == held


def test_a_new_daemon_finds_its_mission_and_its_task_again(flight: Flight) -> None:
    stand_armed(flight)
    task_id = start(flight, [TakeOff(6.0), at(flight, 50, 0), at(flight, 50, 20), landing(flight, 20, 20)])
    wait_for_item(flight, 2)
    flight.wait_for(lambda: position_m(flight)[0] > 10.0, "its way")
    flight.kill()
    flight.autopilot.run(4.0)
    began_s = flight.now_s
    flight.start()
    flight.wait_for(lambda: flight.uav.telemetry().task is not None, "its task")
    flight.wait_for_state(State.FLYING_AUTO)
    task = flight.uav.task(task_id)
    assert task.info().status is TaskStatus.RUNNING
    assert flight.commands_since(began_s) == set()
    assert task.wait(LIMIT_S).status is TaskStatus.SUCCEEDED
    flight.wait_for(lambda: not mission_file(flight).exists(), "it to be forgotten")


def test_a_new_daemon_finds_one_that_was_paused_and_resumes_it(flight: Flight) -> None:
    """It had no task, and `resume` was refused: its mode was no longer that of the mission."""
    stand_armed(flight)
    task_id = start(flight, [TakeOff(6.0), at(flight, 30, 0), at(flight, 30, 20), landing(flight, 20, 20)])
    wait_for_item(flight, 3)
    flight.uav.mission.pause()
    flight.wait_for(lambda: "holds on our mission: item 3" in flight.uav.telemetry().state_reason, "its hold")
    flight.wait_for(lambda: '"paused_at": 3' in mission_file(flight).read_text(), "its note")
    flight.kill()
    flight.autopilot.run(2.0)
    began_s = flight.now_s
    flight.start()
    flight.wait_for(lambda: flight.uav.telemetry().task is not None, "its task")
    flight.wait_for_state(State.FLYING_AUTO)
    assert "holds on our mission: item 3" in flight.uav.telemetry().state_reason
    task = flight.uav.task(task_id)
    assert task.info().is_paused
    flight.wait_for(lambda: flight.uav.mission.progress().stage is not MissionStage.UNKNOWN, "its progress")
    assert flight.uav.mission.progress().stage is MissionStage.PAUSED
    flight.let_pass(3.0)
    assert flight.commands_since(began_s) == set()
    flight.uav.mission.resume()
    assert task.wait(LIMIT_S).status is TaskStatus.SUCCEEDED
    north, east, _ = position_m(flight)
    assert math.hypot(north - 20.0, east - 20.0) < 1.5


def test_a_new_daemon_leaves_a_hold_that_is_no_pause_of_ual_alone(flight: Flight) -> None:
    flight.take_off()
    start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)])
    flight.wait_for(lambda: position_m(flight)[0] > 5.0, "its way")
    flight.kill()
    hold_by_a_station(flight)
    flight.autopilot.run(1.0)
    flight.start()
    flight.wait_for_state(State.FLYING_MANUAL)
    flight.wait_for(lambda: not mission_file(flight).exists(), "it to be forgotten")


def test_a_new_daemon_leaves_a_mission_of_others_alone(flight: Flight) -> None:
    stand_armed(flight)
    start(flight, [TakeOff(6.0), at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)])
    wait_for_item(flight, 2)
    flight.kill()
    store = flight.autopilot.missions
    store.keep(0, [*store.lists[0], store.lists[0][-1]])
    flight.autopilot.mission.state = 3
    flight.start()
    flight.wait_for_state(State.FLYING_MANUAL)
    flight.wait_for(lambda: not mission_file(flight).exists(), "it to be forgotten")
    assert flight.uav.telemetry().task is None


def test_what_cannot_be_executed_is_refused_before_anything_moves(flight: Flight) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    wait_for_position(flight)
    mission = flight.uav.mission
    with pytest.raises(WrongStateError, match="has no mission; upload one"):
        mission.start()
    with pytest.raises(InvalidArgumentError, match="item 2"):
        mission.upload([at(flight, 5, 5), Speed(-1.0)])
    flight.wait_for(flight._is_take_off_planned, "home")
    with pytest.raises(GeofenceError, match=r"mission: item 2 \(waypoint\)"):
        mission.upload([TakeOff(6.0), at(flight, 5, 5, 200.0)])
    mission.upload([at(flight, 5, 5), at(flight, 5, 9)])
    with pytest.raises(WrongStateError, match="LANDED_ARMED"):
        mission.start()
    assert flight.autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    with pytest.raises(WrongStateError, match="has to begin with a take-off"):
        mission.start()
    with pytest.raises(WrongStateError, match="no item 3"):
        mission.start(3)
    with pytest.raises(WrongStateError, match="on_link_loss is LAND, but once its ground station is lost"):
        mission.start(on_link_loss=LinkLossAction.LAND)
    with pytest.raises(WrongStateError, match="no mission of UAL is flown"):
        mission.pause()
    mission.clear()
    assert mission.download().items == ()
    assert flight.uav.state() is State.LANDED_ARMED


def test_a_dry_run_tells_length_time_and_heights(flight: Flight) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    wait_for_position(flight)
    flight.wait_for(flight._is_take_off_planned, "home")
    items = [TakeOff(6.0), at(flight, 20, 0), at(flight, 20, 30), HoldTime(9.0), Jump(2, 1)]
    flight.wait_for(lambda: flight.uav.mission.plan(items).duration_s < 80.0, "its limits")
    plan = flight.uav.mission.plan(items)
    assert plan.length_m == pytest.approx(6 + 20 + 30 + 30 + 30, abs=2.0)
    assert plan.duration_s > 25.0
    assert plan.lowest_m == pytest.approx(6.0, abs=1.0)
    assert plan.highest_m == pytest.approx(6.0, abs=1.0)
    assert plan.executed_count == 7


def test_uploads_over_a_link_that_loses_a_fifth_are_whole(flight: Flight) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    wait_for_position(flight)
    flight.link.down = flight.link.up = LOSSY
    try:
        for number in range(4):
            items: list[Item] = [at(flight, float(number), float(east)) for east in range(1, 9)]
            assert list(flight.uav.mission.upload(items).items) == items
    finally:
        flight.link.down = flight.link.up = Faults()


def test_with_a_mission_that_begins_anew_it_is_not_paused() -> None:
    flight = Flight("ardupilot")
    try:
        flight.autopilot.parameters["MIS_RESTART"] = 1.0
        flight.take_off()
        flight.uav.mission.upload([at(flight, 60, 0), at(flight, 60, 60)])
        with pytest.raises(WrongStateError, match=r"would begin with item 1 \(MIS_RESTART is 1\)"):
            flight.uav.mission.start(2)
        flight.uav.mission.start()
        flight.wait_for(lambda: "our mission" in flight.uav.telemetry().state_reason, "the mission")
        with pytest.raises(WrongStateError, match="would begin it anew"):
            flight.uav.mission.pause()
        flight.uav.abort()
    finally:
        flight.uav.close()


def is_entered_on_ground(told: Telemetry) -> bool:
    """Returns whether the autopilot is in the mode of its mission, and has not lifted off."""
    is_its_mode = told.flight_mode in ("AUTO.MISSION", "AUTO")
    return told.task is not None and is_its_mode and told.state is State.LANDED_ARMED


@pytest.mark.parametrize("how", ["abort", "cancel", "lease"])
def test_one_that_ends_before_it_lifts_off_stays_on_the_ground(flight: Flight, how: str) -> None:
    """Its task had ended, by a cancel that was accepted, and the autopilot took off and flew all of it."""
    ends: dict[str, Callable[[str], object]] = {
        "abort": lambda _: flight.uav.abort(),
        "cancel": lambda task_id: flight.uav.task(task_id).cancel(),
        "lease": lambda _: flight.uav.lease("another"),
    }
    stand_armed(flight)

    def end() -> None:
        told = flight.uav.telemetry().task
        assert told is not None
        ends[how](told.id)

    def end_and_take_off() -> None:
        with pytest.raises(WrongStateError, match="take_off: the autopilot flies a mission; stop it first"):
            flight.uav.take_off(3.0, blocking=False)
        end()

    flight.when(is_entered_on_ground, end_and_take_off)
    task = flight.uav.task(start(flight, [TakeOff(6.0), at(flight, FAR_M, 0)]))
    with pytest.raises(TaskAbortedError):
        task.wait(LIMIT_S)
    flight.let_pass(5.0)
    told = flight.uav.telemetry()
    if told.state is State.FLYING_AUTO:  # where the stop came so late that it lifted off, UAL holds it
        assert told.flight_mode in ("OFFBOARD", "GUIDED")
    else:
        assert told.flight_mode in ("AUTO.LOITER", "BRAKE")
    assert position_m(flight)[0] < 10.0


@pytest.mark.parametrize(
    ("flight", "when"),
    [("px4", State.LANDED_ARMED), ("ardupilot", State.LANDED_ARMED), ("px4", State.TAKING_OFF)],
    indirect=["flight"],
)
def test_a_second_abort_before_it_flies_is_accepted_and_changes_nothing(flight: Flight, when: State) -> None:
    """The first was accepted, and the second refused: it needed the state FLYING_AUTO."""
    stand_armed(flight)

    done: list[str] = []

    def abort_twice() -> None:
        for number in ("first", "second"):
            flight.uav.abort()
            done.append(number)

    is_lifting = when is State.TAKING_OFF
    flight.when(lambda told: told.state is when and (is_lifting or is_entered_on_ground(told)), abort_twice)
    task = flight.uav.task(start(flight, [TakeOff(6.0), at(flight, FAR_M, 0)]))
    with pytest.raises(TaskAbortedError, match="cancelled"):
        task.wait(LIMIT_S)
    flight.let_pass(1.0)
    assert done == ["first", "second"]
    if is_lifting:
        flight.wait_for(lambda: flight.uav.telemetry().flight_mode == "OFFBOARD", "the control")
    assert position_m(flight)[0] < 10.0


@pytest.mark.parametrize("flight", ["px4"], indirect=True)  # ArduPilot's hold on the ground stays there
@pytest.mark.parametrize("how", ["cancel", "lease"])
def test_one_that_is_stopped_as_it_lifts_off_is_held_by_ual(flight: Flight, how: str) -> None:
    """PX4 raises its thrust on in the hold: it hovered there, and UAL had let it go as a flight of others."""
    stand_armed(flight)
    flight.let_pass(1.0)  # the thrust rises at the earliest a second after arming: an upload may be quicker
    begun_s = flight.now_s
    autopilot = flight.autopilot
    assert isinstance(autopilot, Px4)
    stops: dict[str, Callable[[], object]] = {
        "cancel": lambda: flight.uav.task(flight.uav.mission.progress().task_id).cancel(),
        "lease": lambda: flight.uav.lease("another").release(),  # whose end must not end the stop
    }

    def stop() -> None:
        stops[how]()

    flight.when(lambda told: is_entered_on_ground(told) and autopilot._ramp_s > 0.5, stop)
    task = flight.uav.task(start(flight, [TakeOff(6.0), at(flight, FAR_M, 0)]))
    with pytest.raises(TaskAbortedError):
        task.wait(LIMIT_S)
    flight.wait_for_state(State.FLYING_AUTO)
    flight.wait_for(lambda: flight.uav.telemetry().flight_mode == "OFFBOARD", "the control")
    flight.let_pass(3.0)
    assert flight.states_since(begun_s) == [State.LANDED_ARMED, State.FLYING_AUTO]
    assert position_m(flight)[2] < 1.5


def test_one_whose_lease_ends_in_a_silence_on_the_ground_is_stopped_once_it_is_observed(flight: Flight) -> None:
    """The stop waited for the end of its take-off, and ended as that had not begun: all of it was flown."""
    stand_armed(flight)
    flight.when(is_entered_on_ground, lambda: setattr(flight.link, "down", SILENT))

    def take() -> None:
        flight.uav.lease("another")
        flight.link.down = Faults()

    flight.when(lambda told: told.state is State.UNINITIALIZED and told.task is not None, take)
    task = flight.uav.task(start(flight, [TakeOff(6.0), at(flight, FAR_M, 0)]))
    with pytest.raises(TaskAbortedError, match="lease"):
        task.wait(LIMIT_S)
    flight.wait_for(lambda: flight.uav.state() is not State.UNINITIALIZED, "it to be seen")
    held_modes = ("AUTO.LOITER", "BRAKE", "OFFBOARD", "GUIDED")
    flight.wait_for(lambda: flight.uav.telemetry().flight_mode in held_modes, "its stop")
    flight.let_pass(8.0)
    assert position_m(flight)[0] < 5.0


@pytest.mark.parametrize(
    ("flight", "command"), [("px4", "abort"), ("px4", "lease"), ("ardupilot", "go_to_waypoint")], indirect=["flight"]
)
def test_who_takes_it_just_before_a_command_keeps_it(flight: Flight, command: str) -> None:
    """While the cause was not known, the state was still that of the mission: the command took control from them."""
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)]))
    flight.wait_for(lambda: "our mission" in flight.uav.telemetry().state_reason, "the mission")
    flight.let_pass(2.0)
    uav, goal = flight.uav, flight.goal(-6.0, 0.0)
    calls: dict[str, Callable[[], Any]] = {
        "abort": uav.abort,
        "lease": lambda: uav.lease("another"),
        "go_to_waypoint": lambda: uav.go_to_waypoint(goal, blocking=False),
    }
    hold = "AUTO.LOITER" if isinstance(flight.autopilot, Px4) else "BRAKE"
    refused: list[str] = []

    def act() -> None:
        try:
            calls[command]()
        except WrongStateError as error:
            refused.append(str(error))

    flight.when(lambda told: told.flight_mode == hold, act)
    hold_by_a_station(flight)
    with pytest.raises(TaskAbortedError):
        task.wait(LIMIT_S)
    flight.let_pass(3.0)
    told = flight.uav.telemetry()
    assert (told.flight_mode, told.state) == (hold, State.FLYING_MANUAL)
    assert command == "lease" or "others have just chosen mode" in refused[0]


def hold_by_a_station(flight: Flight) -> None:
    """A ground station chooses the mode in which the autopilot holds."""
    flight.autopilot.request_custom_mode(LOITER.custom if isinstance(flight.autopilot, Px4) else BRAKE)


def require_taken_by_a_station(flight: Flight, task: Task) -> None:
    """A ground station takes the mission of a task, and keeps the UAV."""
    hold_by_a_station(flight)
    with pytest.raises(TaskAbortedError, match="took over"):
        task.wait(LIMIT_S)
    flight.let_pass(3.0)
    assert flight.uav.state() is State.FLYING_MANUAL


@pytest.mark.parametrize("how", ["abort", "cancel"])
def test_an_abort_in_the_moment_in_which_it_begins_stops_it(
    flight: Flight, how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a real PX4 it was refused: the autopilot flies a mission, stop it first (abort)."""
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)]))
    flight.wait_for(lambda: "our mission" in flight.uav.telemetry().state_reason, "the mission")
    commands = flight.uav.vehicle.commands
    judged, is_mission = list[bool](), commands._is_mission

    def judge_before_it_began(task_id: str) -> bool:
        judged.append(bool(judged) and is_mission(task_id))
        return judged[-1]

    monkeypatch.setattr(commands, "_is_mission", judge_before_it_began)
    monkeypatch.setattr(commands._flight, "is_following", lambda _: True)
    flight.uav.abort() if how == "abort" else task.cancel()
    monkeypatch.undo()
    assert judged == [False, True]
    flight.wait_for(lambda: flight.uav.telemetry().flight_mode in ("OFFBOARD", "GUIDED"), "the control")
    flight.wait_for_state(State.FLYING_AUTO)


def test_who_takes_it_as_it_jumps_back_from_its_last_item_keeps_it(flight: Flight) -> None:
    flight.take_off()
    items: list[Item] = [at(flight, 40, 0), at(flight, 40, 40), Jump(1, 2)]
    task = flight.uav.task(start(flight, items))
    flight.wait_for(lambda: flight.uav.mission.progress().item == 2, "its last item that moves it")
    flight.wait_for(lambda: flight.uav.mission.progress().item == 1, "its jump")
    require_taken_by_a_station(flight, task)


def test_who_takes_it_in_its_second_flight_keeps_it(flight: Flight) -> None:
    """PX4 holds in the mode that follows a mission. The last item had been reached in the flight before."""
    flight.take_off()
    items: list[Item] = [at(flight, 40, 0), at(flight, 40, 40)]
    flight.uav.task(start(flight, items)).wait(LIMIT_S)
    again = flight.uav.task(flight.uav.mission.start().id)
    flight.wait_for(lambda: position_m(flight)[1] < 30.0, "its way back to the first item")
    require_taken_by_a_station(flight, again)


def test_a_lease_that_is_taken_stops_it(flight: Flight) -> None:
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)]))
    flight.wait_for(lambda: flight.uav.velocity().twist.linear.norm() > 2.0, "its way")
    lease = flight.uav.lease("another")
    with pytest.raises(UalError, match="has acquired the lease"):
        task.wait(LIMIT_S)
    flight.wait_for(lambda: flight.uav.velocity().twist.linear.norm() < 0.1, "its rest")
    flight.wait_for_state(State.FLYING_AUTO)
    lease.release()


@pytest.mark.parametrize("how", ["abort", "cancel"])
def test_it_is_stopped_while_its_position_is_lost(flight: Flight, how: str) -> None:
    """Nobody could stop it then: both were refused, and it flew on."""
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)]))
    flight.wait_for(lambda: position_m(flight)[0] > 10.0, "its way")
    builders, message_id = flight.autopilot.builders, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED
    stopped_at: list[float] = []

    def stop() -> None:
        stopped_at.append(position_m(flight)[0])
        flight.uav.abort() if how == "abort" else task.cancel()

    flight.when(lambda told: "has not said its pose" in told.state_reason, stop)
    told = builders[message_id]
    builders[message_id] = lambda: None  # the autopilot itself has its position
    with pytest.raises(TaskAbortedError, match="cancelled"):
        task.wait(LIMIT_S)
    flight.wait_for(lambda: "has stopped its mission" in flight.uav.telemetry().state_reason, "its hold")
    flight.let_pass(20.0)
    assert position_m(flight)[0] < stopped_at[0] + 40.0
    builders[message_id] = told
    flight.wait_for(lambda: flight.uav.telemetry().flight_mode in ("OFFBOARD", "GUIDED"), "the control")
    flight.wait_for_state(State.FLYING_AUTO)


@pytest.mark.parametrize("flight", ["ardupilot"], indirect=True)  # PX4's failsafe comes before UAL knows of it
def test_an_autopilot_that_has_lost_its_position_and_cannot_hold_is_reported(flight: Flight) -> None:
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)]))
    flight.wait_for(lambda: position_m(flight)[0] > 10.0, "its way")
    flight.when(lambda told: told.state is State.UNINITIALIZED, task.cancel)
    flight.autopilot.lose_gps()
    with pytest.raises(TaskAbortedError, match="cancelled"):
        task.wait(LIMIT_S)
    flight.first_s(lambda told: "its mission may go on" in told.state_reason and "take over" in told.state_reason)
    flight.autopilot.find_gps()
    flight.wait_for(lambda: flight.uav.telemetry().flight_mode == "GUIDED", "the control")
    flight.wait_for_state(State.FLYING_AUTO)


def test_one_that_does_not_give_the_control_is_held_by_the_autopilot(
    flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M)]))
    flight.wait_for(lambda: position_m(flight)[0] > 10.0, "its way")
    autopilot: Any = flight.autopilot
    is_px4 = isinstance(autopilot, Px4)
    name, refused, holds = ("request_mode", OFFBOARD, "AUTO.LOITER") if is_px4 else ("set_mode", GUIDED, "BRAKE")
    enter = getattr(autopilot, name)
    monkeypatch.setattr(autopilot, name, lambda mode: mode != refused and enter(mode))
    flight.uav.abort()
    with pytest.raises(TaskAbortedError, match="cancelled"):
        task.wait(LIMIT_S)
    flight.wait_for(lambda: flight.uav.telemetry().flight_mode == holds, "its hold")
    flight.wait_for_state(State.FLYING_MANUAL)
    monkeypatch.undo()
    flight.uav.recover_from_manual()


def test_how_far_it_is_is_assessed_by_what_it_does(flight: Flight) -> None:
    """PX4 told ACTIVE after the abort of one that had been paused, and COMPLETE once disarmed, with one reached."""
    flight.take_off()
    start(flight, [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M), at(flight, 0, FAR_M)])
    flight.wait_for(lambda: position_m(flight)[0] > 5.0, "its way")
    flight.uav.mission.pause()
    flight.wait_for(lambda: flight.uav.mission.progress().stage is MissionStage.PAUSED, "its pause")
    on_way: list[MissionStage] = []
    flight.when(
        lambda told: told.flight_mode in ("AUTO.MISSION", "AUTO") and "flies our" in told.state_reason,
        lambda: on_way.append(flight.uav.mission.progress().stage),
    )
    flight.uav.mission.resume()
    flight.wait_for(lambda: position_m(flight)[0] > 15.0, "its way again")
    assert on_way == [MissionStage.ACTIVE]
    flight.uav.mission.jump_to(2)
    flight.uav.abort()
    flight.wait_for_state(State.FLYING_AUTO)
    flight.wait_for(lambda: flight.uav.telemetry().flight_mode in ("OFFBOARD", "GUIDED"), "the control")
    flight.let_pass(3.0)
    assert flight.uav.mission.progress().stage is MissionStage.PAUSED
    flight.land()
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.let_pass(3.0)
    assert flight.uav.mission.progress().stage is MissionStage.NOT_STARTED
    flight.uav.mission.upload(box(flight))
    stages = {flight.uav.mission.progress().stage}
    flight.uav.arm()
    for _ in range(30):
        stages.add(flight.uav.mission.progress().stage)
        flight.let_pass(0.1)
    assert stages == {MissionStage.NOT_STARTED}
    flight.uav.mission.clear()
    assert flight.uav.mission.progress().stage is MissionStage.NONE


def test_one_that_begins_with_a_speed_takes_off_and_flies_at_it(flight: Flight) -> None:
    """It was uploaded, and no start was possible but one that skipped the speed."""
    stand_armed(flight)
    task = flight.uav.task(start(flight, [Speed(2.0), TakeOff(6.0), at(flight, 30, 0), landing(flight, 30, 0)]))
    flight.wait_for(lambda: position_m(flight)[0] > 12.0, "its way")
    speed_m_s = flight.uav.velocity().twist.linear.norm()
    assert speed_m_s == pytest.approx(2.0, abs=0.4)
    assert task.wait(LIMIT_S).status is TaskStatus.SUCCEEDED


def test_a_start_in_the_middle_says_which_settings_it_skips(flight: Flight) -> None:
    flight.take_off()
    items = [Speed(2.0), at(flight, FAR_M, 0), Speed(3.0), at(flight, FAR_M, FAR_M), at(flight, 0, FAR_M)]
    task = flight.uav.task(start(flight, items, 4))
    assert "it begins with item 4, without item 3 (speed)" in task.info().description
    flight.uav.abort()
    flight.wait_for_state(State.FLYING_AUTO)
    again = flight.uav.task(flight.uav.mission.start(3).id)
    assert "it begins with item 3, without item 1 (speed)" in again.info().description
    flight.wait_for(lambda: flight.uav.mission.progress().item == 4, "its second waypoint")
    with pytest.raises(InvalidArgumentError, match="a jump leads to an item that flies"):
        flight.uav.mission.jump_to(3)
    flight.uav.abort()


def stand_in_pilots_mode(flight: Flight) -> None:
    """Stands armed in the mode that the pilot selects to take over."""
    stand_armed(flight)
    flight.autopilot.pilot_take_over()
    flight.wait_for(lambda: flight.uav.telemetry().flight_mode in PILOTS_MODES, "the pilot's mode")
    flight.let_pass(1.0)


def wait_until_taken(flight: Flight) -> None:
    """Starts a mission, and waits until it ends: by the safety pilot."""
    with pytest.raises(TaskAbortedError) as caught:
        flight.uav.task(flight.uav.mission.start().id).wait(LIMIT_S)
    assert caught.value.metadata["by"] == "safety pilot", caught.value
    assert flight.uav.telemetry().flight_mode in PILOTS_MODES


def test_a_pilot_who_takes_over_while_a_mission_is_read_for_its_start_on_the_ground_is_named(flight: Flight) -> None:
    """Its task had not begun yet, and began in spite of the pilot."""
    stand_armed(flight)
    flight.let_pass(0.5)
    flight.uav.mission.upload(box(flight))
    handlers = flight.autopilot._handlers
    send_list = handlers[mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST]

    def send_later(message: Message, sender: Sender) -> None:
        handlers[mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST] = send_list
        flight.autopilot.pilot_take_over()
        flight.autopilot.at(1.0, lambda: send_list(message, sender))

    handlers[mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST] = send_later
    wait_until_taken(flight)
    assert flight.uav.state() is State.LANDED_ARMED


@pytest.mark.parametrize("after_s", [0.05, 0.2, 0.45, 0.9])
@pytest.mark.parametrize("stand", [stand_armed, stand_in_pilots_mode])
def test_a_pilot_who_takes_over_just_after_the_start_of_a_mission_is_named(
    flight: Flight, stand: Callable[[Flight], None], after_s: float
) -> None:
    """Also in the mode from before. It said "accepted to fly the mission, but has not after 5 s".

    No step is made while the cause of a mode is open, so the mission's mode came and went unseen.
    """
    stand(flight)
    flight.uav.mission.upload(box(flight))
    taken_s: list[float] = []

    def take_over() -> None:
        taken_s.append(flight.now_s + after_s)
        flight.autopilot.at(after_s, flight.autopilot.pilot_take_over)

    flight.when(lambda told: told.flight_mode in ("AUTO", "AUTO.MISSION"), take_over)
    wait_until_taken(flight)
    ended_s = flight.first_s(lambda told: told.task is None, taken_s[0])
    assert ended_s - taken_s[0] < 1.0


# --- A hold that the autopilot begins by itself ----------------------------------------------------------------------


def order(flight: Flight, what: str) -> None:
    """Gives an order about the mission that is flown."""
    if what == "jump":
        flight.uav.vehicle.missions.jump(3)
    elif what == "resume":
        flight.uav.mission.pause()
        flight.wait_for(lambda: "holds on our mission" in flight.uav.telemetry().state_reason, "its hold")
        flight.let_pass(8.0)  # a hold of ours counts for 5 s
        flight.uav.mission.resume()


def hide_progress(flight: Flight, monkeypatch: pytest.MonkeyPatch) -> None:
    """MISSION_CURRENT and MISSION_ITEM_REACHED are lost from now on."""
    send = flight.link.send

    def send_others(data: bytes, now_s: float) -> None:
        if data[7] | data[8] << 8 | data[9] << 16 not in (42, 46):
            send(data, now_s)

    monkeypatch.setattr(flight.link, "send", send_others)


def three_far(flight: Flight) -> list[Item]:
    return [at(flight, FAR_M, 0), at(flight, FAR_M, FAR_M), at(flight, 0, FAR_M)]


@pytest.mark.parametrize("flight", ["px4"], indirect=True)
@pytest.mark.parametrize("is_told", [True, False])
@pytest.mark.parametrize(
    ("what", "after_s", "by"),
    [
        ("jump", 0.0, "autopilot"),
        ("jump", 0.1, "autopilot"),
        ("jump", 0.5, "autopilot"),
        ("jump", 3.0, "ground station"),
        ("start", 0.2, "autopilot"),
        ("start", 3.0, "ground station"),
        ("resume", 0.2, "autopilot"),
        ("resume", 3.0, "ground station"),
    ],
)
def test_who_holds_after_an_order_of_ours_is_named(
    flight: Flight, monkeypatch: pytest.MonkeyPatch, what: str, after_s: float, by: str, *, is_told: bool
) -> None:
    """A real PX4 held by itself just after a jump (campaign, 1630000000018): a ground station was named."""
    if what == "jump" and not is_told:
        by = "autopilot"  # it is repeated until it is reported
    flight.take_off()
    mission, ordered_s = flight.autopilot.mission, list[float]()
    begin, choose = mission.begin, mission.choose

    begins = list[float]()

    def on_begin(hold: Any) -> None:
        begin(hold)
        begins.append(flight.now_s)
        if what == ("start", "resume")[len(begins) - 1]:
            ordered_s.append(flight.now_s)
            if not is_told:
                hide_progress(flight, monkeypatch)

    def on_choose(seq: int) -> bool:
        if what == "jump" and seq == 2 and not ordered_s:
            ordered_s.append(flight.now_s)
        return choose(seq)

    def is_due(_: Telemetry) -> bool:
        return bool(ordered_s) and flight.now_s >= ordered_s[0] + after_s

    monkeypatch.setattr(mission, "begin", on_begin)
    monkeypatch.setattr(mission, "choose", on_choose)
    flight.when(is_due, lambda: hold_by_a_station(flight))
    task = flight.uav.task(start(flight, three_far(flight)))
    if what != "start":
        flight.wait_for(lambda: position_m(flight)[0] > 10.0, "its way")
    if what == "jump" and not is_told:
        hide_progress(flight, monkeypatch)
    order(flight, what)
    with pytest.raises(TaskAbortedError) as caught:
        task.wait(LIMIT_S)
    assert caught.value.metadata["by"] == by, caught.value
    flight.wait_for_state(State.FLYING_MANUAL)
    health = flight.uav.telemetry().health
    assert health is not None
    assert health.held_by == by


@pytest.mark.parametrize("flight", ["px4"], indirect=True)
@pytest.mark.parametrize("after_s", [0.0, 0.1, 0.3, 0.6, 0.9])
def test_a_mission_that_ends_just_after_a_jump_to_its_last_item_has_succeeded(
    flight: Flight, monkeypatch: pytest.MonkeyPatch, after_s: float
) -> None:
    """PX4 may report the mode before the item, and that before the end."""
    flight.take_off()
    mission, ended = flight.autopilot.mission, list[float]()
    choose = mission.choose

    def on_choose(seq: int) -> bool:
        if seq == 2 and not ended:
            ended.append(flight.now_s + after_s)
        return choose(seq)

    def end() -> None:
        mission.state = COMPLETE

    monkeypatch.setattr(mission, "choose", on_choose)
    flight.when(lambda _: bool(ended) and flight.now_s >= ended[0], end)
    task = flight.uav.task(start(flight, three_far(flight)))
    flight.wait_for(lambda: position_m(flight)[0] > 10.0, "its way")
    flight.uav.vehicle.missions.jump(3)
    assert task.wait(LIMIT_S).status is TaskStatus.SUCCEEDED


@pytest.mark.parametrize("flight", ["px4"], indirect=True)
@pytest.mark.parametrize("is_told_first", [True, False])
def test_a_mission_that_px4_ends_before_its_landing_names_no_ground_station(
    flight: Flight, *, is_told_first: bool
) -> None:
    """A real PX4 reports the end up to 1 s before it holds. Reported after 0.4 s, it corrects the holder only."""
    flight.take_off()
    task = flight.uav.task(start(flight, [at(flight, FAR_M, 0), landing(flight, FAR_M, FAR_M)]))
    flight.wait_for(lambda: position_m(flight)[0] > 10.0, "its way")

    def end() -> None:
        flight.autopilot.mission.state = COMPLETE
        if is_told_first:
            flight.autopilot._request(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, flight.autopilot.channels[0])

    flight.when(lambda _: True, end)
    with pytest.raises(TaskAbortedError) as caught:
        task.wait(LIMIT_S)
    if is_told_first:
        assert "the autopilot holds by itself, as after a mission" in caught.value.message
        assert caught.value.metadata["by"] == "autopilot"
    flight.wait_for_state(State.FLYING_MANUAL)
    flight.let_pass(3.0)
    health = flight.uav.telemetry().health
    assert health is not None
    assert health.held_by == "autopilot"
