"""A flight whose autopilot flies a mission, and is set by a test: what takes it, also unobserved, and what stops it."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, cast

import pytest

from tests.snapshots import changed
from tests.ual_daemon.flight.hand_made import STEP_S, Autopilot
from tests.ual_daemon.flight.manoeuvres.test_autopilot_mission import KEPT, Missions
from ual.errors import RejectedByAutopilotError, TaskAbortedError, WrongStateError
from ual.geometry import Twist, Vector3
from ual.missions import ReturnToLaunch, Waypoint
from ual.missions.plan import MissionStage
from ual.types import State, TaskKind
from ual_daemon.backends.base import Backend, BackendOptions
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.offers.missions import KeptMission, MissionReport
from ual_daemon.backends.offers.parameters import UndecidedError
from ual_daemon.backends.values import Cause, Control, LandedState, Setpoint, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.flight import CommandOrigin, Flight
from ual_daemon.flight.manoeuvres.autopilot_mission import AutopilotMission
from ual_daemon.flight.manoeuvres.land import LandManoeuvre
from ual_daemon.flight.manoeuvres.manoeuvre import Handover
from ual_daemon.flight.manoeuvres.recover import RecoverFirst
from ual_daemon.flight.policy.authority import LONGEST_LINK_GAP_S
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.settings import LimitSettings, VehicleSettings
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.tracker.references import Hold, Reference, Velocity

NO_POSITION = ("pose", "velocity")


class Wire:
    """A backend over an autopilot that is set by hand. `hidden` are the values that are not known now."""

    def __init__(self, landed: LandedState) -> None:
        self._light = LightBackend(BackendOptions("uav_1", settings={"speed_factor": 0}))
        self.autopilot = Autopilot(control=Control.OTHER, landed=landed, mode="MISSION")
        self.hidden: tuple[str, ...] = ()
        self.asked: list[str] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._light, name)

    def snapshot(self) -> Snapshot:
        now_s = self.autopilot.time_s - self.autopilot.silent_s
        known = changed(self.autopilot.snapshot(), updated_s=now_s)
        return changed(known, **dict.fromkeys(self.hidden))

    def send(self, setpoint: Setpoint) -> None:
        """Takes any."""

    def hold(self) -> Future[None]:
        return self._ask("hold")

    def take_control(self) -> Future[None]:
        return self._ask("take")

    def _ask(self, what: str) -> Future[None]:
        self.asked.append(what)
        self._newest = Future[None]()
        return self._newest

    def answer(self) -> None:
        """The autopilot accepts the newest command."""
        self._newest.set_result(None)

    def refuse(self, why: str) -> None:
        self._newest.set_exception(RejectedByAutopilotError(why))


class World:
    """A flight in which the autopilot flies a mission of UAL."""

    def __init__(self, landed: LandedState = LandedState.IN_AIR, kept: KeptMission = KEPT) -> None:
        self.wire = Wire(landed)
        backend = cast("Backend", self.wire)
        self.limits = CurrentLimits(backend, LimitSettings())
        geofence = GeofencePolicy(None, FrameResolver("uav_1", VehicleSettings()))
        self.flight = Flight(backend, self.limits, geofence)
        self.autopilot = self.wire.autopilot
        task, ends = self.autopilot.task(TaskKind.MISSION), lambda _: pytest.fail("it has not ended")
        mission = AutopilotMission(task, backend, Missions(), kept, 1, None, ends, self.flight.authority.begin)
        self.flight.begin(mission, CommandOrigin())
        self.mission, self.offer = mission, cast("Missions", mission._offer)
        self.run(0.5)
        assert self.flight.is_on_mission

    def run(self, duration_s: float) -> None:
        """Lets time pass."""
        for _ in range(round(duration_s / STEP_S)):
            self.autopilot.time_s += STEP_S
            self.flight.step(self.wire.snapshot())

    @property
    def state(self) -> State:
        return self.flight.estimate(self.wire.snapshot()).state

    @property
    def reason(self) -> str:
        return self.flight.estimate(self.wire.snapshot()).why

    def recover_first(self) -> RecoverFirst:
        """Begins a task that takes the control back from the mission first."""
        snapshot = self.wire.snapshot()
        task = self.autopilot.task(TaskKind.GO_TO_WAYPOINT)
        command = AutopilotCommand("take our references")
        recover = RecoverFirst(
            task,
            "go_to_waypoint",
            command,
            self.wire.take_control,
            lambda _: None,
            lambda now: pytest.fail(f"it has not recovered at {now.time_s}"),
        )
        self.flight.begin(recover, CommandOrigin(), snapshot)
        recover.send(snapshot)
        return recover


@pytest.fixture
def world() -> World:
    made = World()
    assert made.state is State.FLYING_AUTO
    return made


def abort(world: World, judged: Snapshot) -> None:
    """As `Commands.abort` does, by a snapshot in which the state was FLYING_AUTO."""
    stop = world.flight.mission_stop("abort", judged)
    assert stop is not None
    world.flight.begin(stop.manoeuvre, CommandOrigin(), judged)
    stop.begin()


def take_over(world: World) -> None:
    """The pilot does."""
    world.autopilot.mode = "POSCTL"


@pytest.mark.parametrize("hidden", [NO_POSITION, ("mode",)])
def test_a_pilot_who_takes_it_while_its_position_or_mode_is_lost_keeps_it_though_a_lease_ends(
    world: World, hidden: tuple[str, ...]
) -> None:
    """A lost position is when a pilot takes over. The stop for the lease took that mode for the one it began in."""
    world.wire.hidden = hidden
    take_over(world)
    world.run(1.0)
    world.flight.stop_for_lease("its program has released the lease")
    world.run(1.0)
    world.wire.hidden = ()
    world.run(2.0)
    assert world.wire.asked == []
    assert world.state is State.FLYING_MANUAL


@pytest.mark.parametrize("is_known_late", [False, True])
@pytest.mark.parametrize("by", [None, Cause.SAFETY_PILOT])
def test_a_pilot_who_stops_the_motors_and_takes_over_at_once_is_not_overruled(
    world: World, by: Cause | None, is_known_late: bool
) -> None:
    """PX4 goes to POSCTL by the gesture that stops the motors; UAL asked for OFFBOARD 0.06 s later, and streamed."""
    take_over(world)
    world.autopilot.failsafe, world.autopilot.climb_m_s = Cause.TERMINATION, -3.0
    if is_known_late:
        world.autopilot.held_by = Cause.OPEN
        world.run(0.4)
    world.autopilot.held_by = by
    world.run(3.0)
    assert world.wire.asked == []
    error = world.mission.future.exception(0.0)
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "safety pilot"
    assert "stopped its motors" in world.reason


def test_no_item_is_chosen_again_once_others_have_chosen_a_mode(world: World) -> None:
    """PX4, a ground station's LAND: MISSION_SET_CURRENT was repeated 0.16 s later, as no step judges an open cause."""
    world.mission.jump(2, lambda: None)
    assert world.offer.why_not() is None
    world.autopilot.mode, world.autopilot.held_by = "LAND", Cause.OPEN
    assert isinstance(world.offer.why_not(), UndecidedError)
    world.run(0.3)
    assert isinstance(world.offer.why_not(), UndecidedError)
    world.autopilot.held_by = Cause.GROUND_STATION  # told in a moment in which no step has judged it
    error = world.offer.why_not()
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "ground station"
    world.run(0.1)
    assert "has ended" in str(world.offer.why_not())


@pytest.mark.parametrize("stage", [MissionStage.COMPLETE, MissionStage.ACTIVE])
def test_a_switch_to_the_mode_in_which_a_mission_ends_is_the_pilots(world: World, stage: MissionStage) -> None:
    """PX4 holds in one mode after a mission and by the pilot's switch: UAL must not take back the control."""
    last = len(KEPT.items)
    world.offer.told = MissionReport(stage, last, last, world.autopilot.time_s + 0.1, 5, world.autopilot.time_s + 0.1)
    world.autopilot.mode, world.autopilot.held_by = world.offer.done_mode, Cause.SAFETY_PILOT
    world.run(3.0)
    assert world.wire.asked == []
    error = world.mission.future.exception(0.0)
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "safety pilot"


def test_motors_that_are_stopped_in_the_mode_of_our_mission_are_answered_by_taking_it_out_of_that(
    world: World,
) -> None:
    world.autopilot.failsafe, world.autopilot.climb_m_s = Cause.TERMINATION, -3.0
    world.run(1.0)
    assert world.wire.asked == ["take"]


@pytest.mark.parametrize("steps", range(12))
def test_a_landing_that_is_a_fall_fails_whenever_its_mode_comes(steps: int) -> None:
    """In the update that found the fall its own mode was taken for one of others, and the landing SUCCEEDED."""
    world = World()
    world.autopilot.control, world.autopilot.mode = Control.REFERENCES, "GUIDED"
    world.run(0.5)
    task, snapshot = world.autopilot.task(TaskKind.LAND), world.wire.snapshot()
    world.flight.begin(
        LandManoeuvre(task, AutopilotCommand("land"), Hold(Vector3(z=world.autopilot.z), 0.0), snapshot),
        CommandOrigin(),
    )
    world.run(0.5)
    for step in range(round(1.0 / STEP_S)):
        if step == steps:
            world.autopilot.control, world.autopilot.mode = Control.LAND, "LAND"
        world.autopilot.climb_m_s -= 9.81 * STEP_S
        world.autopilot.z += world.autopilot.climb_m_s * STEP_S
        world.run(STEP_S)
    assert task.future.done()
    assert isinstance(task.future.exception(0.0), TaskAbortedError)


@pytest.mark.parametrize("held_by", [None, Cause.OPEN])
def test_others_who_start_a_mission_just_after_it_was_held_on_the_ground_keep_it(held_by: Cause | None) -> None:
    """Also where they do so before it is known what has chosen the mode in which it holds."""
    world = World(LandedState.ON_GROUND)
    world.flight.stop_for_lease("its program has released the lease")
    world.run(0.5)
    world.wire.answer()
    world.autopilot.mode, world.autopilot.held_by = world.offer.pause_mode, held_by
    world.run(0.2)
    world.autopilot.mode, world.autopilot.held_by = world.offer.mode, Cause.GROUND_STATION
    world.run(5.0)
    assert world.wire.asked == ["hold"]
    assert not world.flight.is_stopping_mission


def fall(world: World, act: Callable[[int], None], duration_s: float = 2.0) -> None:
    """Falls. `act` is called with the number of each update before it comes."""
    for step in range(round(duration_s / STEP_S)):
        act(step)
        world.autopilot.climb_m_s -= 9.81 * STEP_S
        world.autopilot.z += world.autopilot.climb_m_s * STEP_S
        world.run(STEP_S)


@pytest.mark.parametrize("steps", range(12))
def test_the_mode_of_a_landing_that_is_withdrawn_in_a_fall_is_left_whenever_it_comes(steps: int) -> None:
    """After the fall was found its mode was taken for one of others. PX4 climbs back to where its landing began."""
    world = World()
    world.autopilot.control, world.autopilot.mode, world.autopilot.z = Control.REFERENCES, "GUIDED", 100.0
    world.run(0.5)
    task, snapshot = world.autopilot.task(TaskKind.LAND), world.wire.snapshot()
    reference = Hold(Vector3(z=world.autopilot.z), 0.0)
    world.flight.begin(LandManoeuvre(task, AutopilotCommand("land"), reference, snapshot), CommandOrigin())
    world.run(0.5)

    def act(step: int) -> None:
        if step == steps:
            world.autopilot.control, world.autopilot.mode = Control.LAND, "LAND"

    fall(world, act)
    assert isinstance(task.future.exception(0.0), TaskAbortedError)
    assert world.wire.asked == ["take"]


@pytest.mark.parametrize("by", [Cause.SAFETY_PILOT, Cause.GROUND_STATION])
@pytest.mark.parametrize("steps", range(12))
def test_the_landing_of_others_in_a_fall_is_left_to_them_whenever_it_comes(steps: int, by: Cause) -> None:
    world = World()
    world.autopilot.control, world.autopilot.mode, world.autopilot.z = Control.REFERENCES, "GUIDED", 100.0
    world.run(0.5)
    task, snapshot = world.autopilot.task(TaskKind.LAND), world.wire.snapshot()
    reference = Hold(Vector3(z=world.autopilot.z), 0.0)
    world.flight.begin(LandManoeuvre(task, AutopilotCommand("land"), reference, snapshot), CommandOrigin())
    world.run(0.5)

    def act(step: int) -> None:
        if step == steps:
            world.autopilot.control, world.autopilot.mode, world.autopilot.held_by = Control.OTHER, "ALTCTL", by

    fall(world, act)
    assert world.wire.asked == []


@pytest.mark.parametrize("is_refused", [False, True])
@pytest.mark.parametrize("steps", range(12))
def test_a_fall_as_a_mission_begins_to_land_by_itself_is_answered_in_each_update(steps: int, is_refused: bool) -> None:
    """Its own return was taken for the mode of others, in the update that shows it after the fall was found."""
    world = World(kept=KEPT._replace(items=(*KEPT.items, ReturnToLaunch())))
    world.autopilot.z = 100.0
    landings: list[Snapshot] = []
    refused: list[int] = []

    def land(now: Snapshot) -> Handover:
        landings.append(now)
        task = world.autopilot.task(TaskKind.LAND)
        return Handover(LandManoeuvre(task, AutopilotCommand("land"), None, now))

    world.flight.land_here = land
    item = len(KEPT.items) + 1
    world.offer.told = MissionReport(MissionStage.ACTIVE, item, item, world.autopilot.time_s, 5)
    world.run(0.3)

    def act(step: int) -> None:
        if step == 5:
            world.autopilot.failsafe = Cause.TERMINATION
        if step == steps:
            world.autopilot.control, world.autopilot.mode = Control.LAND, world.offer.return_mode
        if step >= steps and is_refused and len(world.wire.asked) == 1 and not refused:
            refused.append(step)
            world.wire.refuse("not now")

    fall(world, act)
    assert world.flight.following.why
    assert world.wire.asked
    is_taken_anew = world.wire.asked == ["take", "take"] or (world.wire.asked == ["take"] and not is_refused)
    assert landings or is_taken_anew
    assert world.flight.manoeuvre is not None


@pytest.mark.parametrize("by", [None, Cause.SAFETY_PILOT, Cause.GROUND_STATION])
@pytest.mark.parametrize("is_paused", [False, True])
def test_who_takes_it_while_its_position_is_lost_ends_the_task_at_once(
    world: World, is_paused: bool, by: Cause | None
) -> None:
    """It was told as flown by the autopilot for as long as the position was lost, though the mode was heard."""
    if is_paused:
        world.flight.pause()
        world.run(0.2)
        world.autopilot.mode = world.offer.pause_mode
        world.run(0.2)
    world.wire.hidden = NO_POSITION
    world.run(1.0)
    assert world.flight.is_on_mission
    take_over(world)
    world.autopilot.held_by = Cause.OPEN
    world.run(0.5)
    assert world.flight.is_on_mission
    world.autopilot.held_by = by
    world.run(0.1)
    error = world.mission.future.exception(0.0)
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == (by or Cause.SAFETY_PILOT).value


@pytest.mark.parametrize("hidden", [NO_POSITION, ("mode",)])
@pytest.mark.parametrize("is_silent", [False, True])
def test_a_mission_that_is_not_known_to_be_taken_goes_on_unseen(
    world: World, hidden: tuple[str, ...], is_silent: bool
) -> None:
    world.wire.hidden = hidden
    world.autopilot.silent_s = 100.0 if is_silent else 0.0
    world.autopilot.mode, world.autopilot.held_by = "DESCEND", Cause.POSITION
    world.run(5.0)
    world.offer.told = MissionReport(MissionStage.COMPLETE, 1, 1, world.autopilot.time_s + 0.1, 5)
    world.autopilot.mode, world.autopilot.held_by = world.offer.done_mode, None
    world.run(20.0)
    assert world.flight.manoeuvre is world.mission


@pytest.mark.parametrize(("hidden", "before"), [(NO_POSITION, ["hold"]), (("mode",), [])])
def test_a_mission_that_goes_on_unseen_is_stopped_for_a_lease_once_it_is_observed(
    world: World, hidden: tuple[str, ...], before: list[str]
) -> None:
    world.wire.hidden = hidden
    world.run(1.0)
    world.flight.stop_for_lease("its program has released the lease")
    world.run(1.0)
    assert world.wire.asked == before
    world.wire.hidden = ()
    world.run(0.5)
    assert world.wire.asked == [*before, "take"]


def be_silent(world: World) -> None:
    """Nothing is heard for so long that the flight may be another's by then."""
    while world.autopilot.silent_s < LONGEST_LINK_GAP_S + 2.0:
        world.autopilot.silent_s += STEP_S
        world.run(STEP_S)
    world.autopilot.silent_s = 0.0
    world.run(0.3)
    assert not world.flight.authority.is_ours
    assert not world.mission.future.done()


@pytest.mark.parametrize("is_ours", [True, False])
def test_a_lease_that_ends_while_the_mission_is_read_after_a_silence_stops_it_if_it_is_ours(
    world: World, is_ours: bool
) -> None:
    """It was flown on for a program that had lost its lease."""
    be_silent(world)
    world.flight.stop_for_lease("its program has released the lease")
    world.run(0.2)
    assert world.wire.asked == []
    world.offer.read.set_result(KEPT if is_ours else KEPT._replace(digest="2"))
    world.run(0.5)
    error = world.mission.future.exception(0.0)
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == ("lease" if is_ours else "ground station")
    assert world.wire.asked == (["take"] if is_ours else [])


def test_a_command_after_such_an_end_of_the_lease_is_not_stopped(world: World) -> None:
    be_silent(world)
    world.flight.stop_for_lease("its program has released the lease")
    recover = world.recover_first()
    world.run(0.2)
    assert world.flight.manoeuvre is recover


def test_a_mission_that_goes_on_after_a_silence_in_its_pause_ends_with_the_lease(world: World) -> None:
    """The silence had given the flight up, and it stayed so: the end of the lease did not stop it."""
    world.flight.pause()
    world.run(0.2)
    world.autopilot.mode = world.offer.pause_mode
    world.run(0.2)
    be_silent(world)
    world.flight.resume()
    world.run(0.2)
    world.offer.read.set_result(KEPT)
    world.run(0.3)
    world.autopilot.mode = world.offer.mode
    world.run(0.3)
    world.flight.stop_for_lease("its program has released the lease")
    world.run(0.2)
    assert world.wire.asked == ["hold", "take"]


def stop_without_position(world: World) -> None:
    world.wire.hidden = NO_POSITION
    world.run(1.0)
    world.flight.stop_for_lease("its program has released the lease")
    world.run(0.2)


def test_without_a_position_the_autopilot_holds_until_ual_takes_it_back(world: World) -> None:
    """It may last: its mode is received all the time."""
    stop_without_position(world)
    world.wire.answer()
    world.autopilot.mode = world.offer.pause_mode
    world.run(30.0)
    assert "UAL has stopped its mission: the autopilot holds" in world.reason
    world.wire.hidden = ()
    world.run(0.5)
    assert world.wire.asked == ["hold", "take"]
    assert world.state is State.FLYING_AUTO


def test_a_hold_without_a_position_that_is_refused_is_reported_with_what_to_do(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    stop_without_position(world)
    assert "the autopilot is to hold" in world.reason
    world.wire.refuse("no position")
    world.run(1.0)
    assert "its mission may go on: no position; take over by hand, or select another mode" in world.reason
    assert [getattr(each, "ual_event", "") for each in caplog.records].count("mission_not_stopped") == 1
    world.autopilot.mode, world.autopilot.held_by = "DESCEND", Cause.POSITION
    world.run(1.0)
    assert "its mission was not stopped (no position), but DESCEND has replaced it: take over by hand" in world.reason
    world.autopilot.mode, world.autopilot.held_by = "MISSION", None
    world.run(1.0)
    assert "its mission may go on: no position; take over by hand, or select another mode" in world.reason
    world.wire.hidden = ()
    world.run(0.5)
    assert world.wire.asked == ["hold", "take"]


@pytest.mark.parametrize("is_held", [True, False])
def test_a_shutdown_waits_for_a_stop_without_a_position_only_until_the_autopilot_holds(
    world: World, is_held: bool
) -> None:
    """It lasted 60 s: the position may never come back."""
    stop_without_position(world)
    ended = world.flight.prepare_shutdown()
    world.run(4.8)
    assert not ended.done()
    if is_held:
        world.wire.answer()
        world.autopilot.mode = world.offer.pause_mode
    world.run(0.5)
    error = ended.exception(0.0)
    assert world.flight.manoeuvre is None
    assert (error is None) is is_held
    if not is_held:
        assert "the autopilot has not said its pose; it is in the air, in mode MISSION; its mission may go on: " in str(
            error
        )


def test_a_shutdown_waits_for_a_stop_that_is_observed_again_in_time(world: World) -> None:
    stop_without_position(world)
    ended = world.flight.prepare_shutdown()
    world.run(4.0)
    world.wire.hidden = ()
    world.run(2.0)
    assert not ended.done()
    assert world.wire.asked == ["hold", "take"]
    world.autopilot.mode, world.autopilot.control = "OFFBOARD", Control.REFERENCES
    world.run(0.5)
    assert world.wire.asked == ["hold", "take", "hold"]


@pytest.mark.parametrize("landed", [LandedState.LANDING, LandedState.TAKING_OFF])
def test_without_a_position_a_landing_or_a_take_off_goes_on(world: World, landed: LandedState) -> None:
    world.autopilot.landed = landed
    stop_without_position(world)
    assert world.wire.asked == []


@pytest.mark.parametrize("is_after_hold", [False, True])
def test_a_pilot_who_takes_it_after_a_stop_without_a_position_keeps_it(world: World, is_after_hold: bool) -> None:
    stop_without_position(world)
    if is_after_hold:
        world.wire.answer()
        world.autopilot.mode = world.offer.pause_mode
        world.run(0.5)
    world.autopilot.mode, world.autopilot.held_by = "MISSION" if is_after_hold else "POSCTL", Cause.GROUND_STATION
    world.run(0.5)
    assert world.flight.manoeuvre is None
    world.wire.hidden = ()
    world.run(2.0)
    assert world.wire.asked == ["hold"]
    assert world.state is State.FLYING_MANUAL


def test_a_hold_of_others_after_a_stop_without_a_position_is_theirs(world: World) -> None:
    stop_without_position(world)
    world.autopilot.mode, world.autopilot.held_by = world.offer.pause_mode, Cause.SAFETY_PILOT
    world.run(0.5)
    assert world.flight.manoeuvre is None


def test_a_mission_that_ends_after_its_hold_was_refused_is_none_of_others(world: World) -> None:
    """PX4 holds at the end in the mode of the hold; nobody of UAL has commanded that of late."""
    world.offer.pause_mode = world.offer.done_mode
    stop_without_position(world)
    world.wire.refuse("no position")
    world.run(1.0)
    world.offer.told = MissionReport(MissionStage.COMPLETE, 1, 1, world.autopilot.time_s + 0.1, 5)
    world.autopilot.mode, world.autopilot.held_by = world.offer.done_mode, Cause.GROUND_STATION
    world.run(5.0)
    world.wire.hidden = ()
    world.run(0.5)
    assert world.wire.asked == ["hold", "take"]


@pytest.mark.parametrize("goes_back", [True, False])
def test_a_failsafe_for_the_lost_position_is_not_overruled_but_its_mission_is_stopped_after_it(
    world: World, goes_back: bool
) -> None:
    """PX4 goes back to the mission once it has its position again: the stop was refused, or forgotten."""
    world.wire.hidden = NO_POSITION
    world.autopilot.mode, world.autopilot.held_by = "DESCEND", Cause.POSITION
    world.run(5.0)
    for _ in range(3):  # a caller that aborts repeats it
        stop = world.flight.mission_stop("abort", world.wire.snapshot())
        assert stop is not None
        world.flight.begin(stop.manoeuvre, CommandOrigin(), world.wire.snapshot())
        world.run(1.0)
    if goes_back:
        world.autopilot.mode, world.autopilot.held_by = "MISSION", None
    world.wire.hidden = ()
    world.run(0.5)
    assert world.wire.asked == (["take"] if goes_back else [])


@pytest.mark.parametrize("has_held", [False, True])
def test_a_pause_of_this_computer_does_not_let_a_mission_go_that_is_kept_on_the_ground(has_held: bool) -> None:
    """After one, all that was known is discarded: a mode that is not known is none that others have chosen."""
    world = World(LandedState.ON_GROUND)
    world.flight.stop_for_lease("its program has released the lease")
    world.run(0.5)
    if has_held:
        world.wire.answer()
        world.autopilot.mode = "PAUSE"
        world.run(1.0)
    world.wire.hidden = ("armed", "landed", "mode", "pose", "velocity")
    world.run(1.0)
    world.wire.hidden = ()
    world.run(1.0)
    assert world.wire.asked == ["hold", "hold"]
    assert world.flight.is_stopping_mission


@pytest.mark.parametrize("is_stopped", [True, False])
def test_a_command_as_the_control_comes_back_is_not_refused(world: World, is_stopped: bool) -> None:
    """UAL's own mode was told as one that others had just chosen over the mission."""
    if is_stopped:
        world.flight.stop_for_lease("its program has released the lease")
    else:
        world.recover_first()
    world.run(0.2)
    assert world.wire.asked == ["take"]
    world.autopilot.mode, world.autopilot.control = "OFFBOARD", Control.REFERENCES
    world.recover_first()


def test_a_command_as_the_pilot_takes_it_back_is_refused(world: World) -> None:
    world.recover_first()
    world.run(0.2)
    take_over(world)
    with pytest.raises(WrongStateError, match="others have just chosen mode POSCTL"):
        world.recover_first()


def test_what_replaces_a_stop_that_has_lifted_off_is_still_of_its_mission() -> None:
    """It was a recovery out of a flight of others, which no command could replace."""
    world = World(LandedState.ON_GROUND)
    world.flight.stop_for_lease("its program has released the lease")
    world.run(0.5)
    world.autopilot.landed = LandedState.IN_AIR
    recover = world.recover_first()
    assert recover.mission
    assert world.state is State.FLYING_AUTO


@pytest.mark.parametrize(("is_stopped", "text"), [(False, r"stop it first \(abort\)"), (True, "is being stopped")])
def test_a_reference_is_reported_whether_the_mission_is_executed_or_being_stopped(
    world: World, is_stopped: bool, text: str
) -> None:
    """Just after an abort the reason was that the mission had to be aborted."""
    if is_stopped:
        world.flight.stop_for_lease("its program has released the lease")
    snapshot = world.wire.snapshot()
    with pytest.raises(WrongStateError, match=text):
        world.flight.begin_reference(Hold(Vector3(0.0, 0.0, 5.0), 0.0), "set_pose", snapshot, CommandOrigin())


def starting(world: World) -> AutopilotMission:
    """A mission of which the first item is being chosen, in the mode in which UAL sends references."""
    assert world.mission.task is not None
    world.flight.drop_task(world.mission.task.id, "abort", "")
    world.autopilot.mode, world.autopilot.control = "OFFBOARD", Control.REFERENCES
    world.run(0.2)
    world.offer.chosen = Future()
    hold, task = Hold(Vector3(0.0, 0.0, 5.0), 0.0), world.autopilot.task(TaskKind.MISSION)
    backend, ends = cast("Backend", world.wire), lambda _: pytest.fail("it has not ended")
    return AutopilotMission(task, backend, world.offer, KEPT, 1, hold, ends, world.flight.authority.begin)


def test_a_pilot_who_goes_back_to_the_mode_in_which_it_began_on_the_ground_is_named() -> None:
    """A real PX4: the task ended 5 s later, as the autopilot "accepted to fly the mission, but has not"."""
    world = World(LandedState.ON_GROUND)
    assert world.mission.task is not None
    world.flight.drop_task(world.mission.task.id, "abort", "")
    world.autopilot.mode = "POSCTL"
    world.run(0.2)
    world.offer.fly = Future  # type: ignore[method-assign]  # it does not answer yet
    task, ends = world.autopilot.task(TaskKind.MISSION), lambda _: pytest.fail("it has not ended")
    backend = cast("Backend", world.wire)
    mission = AutopilotMission(task, backend, world.offer, KEPT, 1, None, ends, world.flight.authority.begin)
    world.flight.begin(mission, CommandOrigin())
    world.run(0.2)
    world.autopilot.mode = world.offer.mode
    world.run(0.2)
    world.autopilot.mode, world.autopilot.held_by = "POSCTL", Cause.SAFETY_PILOT
    world.run(0.2)
    with pytest.raises(TaskAbortedError, match="the safety pilot took over"):
        mission.future.result(0)


def test_the_hold_of_a_pause_that_shows_after_the_next_start_is_not_reported_as_others(world: World) -> None:
    """Three programs commanded on a real ArduCopter: "others have just chosen mode BRAKE over the mission"."""

    def begin() -> AutopilotMission:
        task, ends = world.autopilot.task(TaskKind.MISSION), lambda _: pytest.fail("it has not ended")
        backend = cast("Backend", world.wire)
        mission = AutopilotMission(task, backend, world.offer, KEPT, 1, None, ends, world.flight.authority.begin)
        world.flight.begin(mission, CommandOrigin())
        return mission

    world.flight.pause()
    world.run(0.2)
    assert world.wire.asked == ["hold"]
    world.offer.chosen = Future()
    begin()
    world.run(0.2)
    world.autopilot.mode = world.offer.pause_mode
    newest = begin()
    world.run(0.2)
    assert world.flight.manoeuvre is newest
    world.autopilot.mode = "POSCTL"
    with pytest.raises(WrongStateError, match="others have just chosen mode POSCTL"):
        begin()


@pytest.mark.parametrize("stream", ["set_velocity", "set_pose"])
def test_a_stream_does_not_replace_a_mission_that_is_being_started(world: World, stream: str) -> None:
    """On PX4 a stream that ran at the start replaced the mission just then."""
    mission, hold = starting(world), Hold(Vector3(0.0, 0.0, 5.0), 0.0)
    world.flight.begin(mission, CommandOrigin())
    world.run(0.2)
    with pytest.raises(WrongStateError, match=r"stop it first \(abort\)"):
        world.flight.begin_reference(hold, stream, world.wire.snapshot(), CommandOrigin())
    assert world.flight.manoeuvre is mission
    world.flight.begin_reference(hold, "abort", world.wire.snapshot(), CommandOrigin())
    with pytest.raises(TaskAbortedError, match="cancelled"):
        mission.future.result(0)


@pytest.mark.parametrize("before", ["velocity", "pose", "old velocity"])
def test_a_velocity_that_goes_on_is_no_command_after_the_start(world: World, before: str) -> None:
    """On ArduCopter, where the mission is read for 0.7 s first, the start was replaced by the stream that ran."""

    def send(reference: Reference, by: str) -> None:
        world.flight.begin_reference(reference, by, world.wire.snapshot(), CommandOrigin())

    def velocity() -> Velocity:
        return Velocity(Twist(), world.flight.drift, in_body=False, expires_s=world.autopilot.time_s + 0.5)

    mission = starting(world)
    send(*((Hold(Vector3(0.0, 0.0, 5.0), 0.0), "set_pose") if before == "pose" else (velocity(), "set_velocity")))
    if before == "old velocity":
        world.run(1.0)
    since = world.flight.last_command
    for _ in range(3):
        send(velocity(), "set_velocity")
    if before == "velocity":
        world.flight.begin(mission, CommandOrigin("", since))
        assert world.flight.manoeuvre is mission
    else:
        with pytest.raises(TaskAbortedError, match="replaced by set_velocity, while it was planned"):
            world.flight.begin(mission, CommandOrigin("", since))


@pytest.mark.parametrize("is_held", [True, False])
def test_a_mission_out_of_which_the_autopilot_does_not_give_the_control_is_held_by_itself(
    world: World, is_held: bool, caplog: pytest.LogCaptureFixture
) -> None:
    """The abort had been taken, and the mission was flown on, as one of others."""
    abort(world, world.wire.snapshot())
    world.wire.refuse("it takes no setpoints")
    world.run(0.3)
    assert world.wire.asked == ["take", "hold"]
    assert "the autopilot is to hold" in world.reason
    if is_held:
        world.wire.answer()
        world.autopilot.mode = world.offer.pause_mode
    else:
        world.wire.refuse("it does not hold")
    world.run(0.5)
    assert world.wire.asked == ["take", "hold"]
    assert world.flight.manoeuvre is None
    assert world.state is State.FLYING_MANUAL
    told = " ".join(str(getattr(each, "ual_fields", "")) for each in caplog.records)
    assert "it takes no setpoints" in told
    assert ("the autopilot holds its position by itself instead" in told) is is_held
    assert ("recover_from_manual tries again" in told) is not is_held


def test_a_pilot_who_takes_a_mission_that_is_to_hold_by_itself_keeps_it(world: World) -> None:
    abort(world, world.wire.snapshot())
    world.wire.refuse("it takes no setpoints")
    world.run(0.3)
    world.autopilot.mode, world.autopilot.held_by = "POSCTL", Cause.SAFETY_PILOT
    world.run(1.0)
    assert world.wire.asked == ["take", "hold"]
    assert world.flight.manoeuvre is None


def test_a_mission_that_is_to_hold_by_itself_is_stopped_unseen_too(world: World) -> None:
    abort(world, world.wire.snapshot())
    world.wire.refuse("it takes no setpoints")
    world.run(0.3)
    world.wire.hidden = NO_POSITION
    world.wire.answer()
    world.autopilot.mode = world.offer.pause_mode
    world.run(5.0)
    assert "has stopped its mission" in world.reason
    world.wire.hidden = ()
    world.run(0.5)
    assert world.wire.asked == ["take", "hold"]


# --- The instant in which its own return begins -----------------------------------------------------------------------


@pytest.fixture
def returning() -> World:
    """A mission whose last item is a return, which the autopilot flies in a mode of its own."""
    kept = KeptMission((Waypoint(47.0, 8.0, 5.0), ReturnToLaunch()), "1")
    return World(kept=kept)


def begin_return(world: World, held_by: Cause | None) -> None:
    world.autopilot.mode, world.autopilot.held_by = world.offer.return_mode, held_by


@pytest.mark.parametrize("is_judged_in_it", [True, False])
def test_an_abort_as_the_own_return_of_a_mission_begins_stops_it(returning: World, is_judged_in_it: bool) -> None:
    """It was told as a mode of others, or ended with the landing: PX4, which obeyed all the same, got no references."""
    judged = returning.wire.snapshot()
    begin_return(returning, Cause.OPEN)
    abort(returning, returning.wire.snapshot() if is_judged_in_it else judged)
    returning.run(0.3)
    returning.autopilot.held_by, returning.autopilot.landed = Cause.GROUND_STATION, LandedState.LANDING
    returning.run(0.5)
    assert returning.flight.is_stopping_mission
    assert returning.wire.asked[-1] == "take"
    returning.autopilot.mode, returning.autopilot.control = "OFFBOARD", Control.REFERENCES
    returning.autopilot.held_by, returning.autopilot.landed = None, LandedState.IN_AIR
    returning.run(0.5)
    assert returning.state is State.FLYING_AUTO
    error = returning.mission.future.exception(0.0)
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "abort"


@pytest.mark.parametrize("landed", [LandedState.IN_AIR, LandedState.LANDING])
def test_a_return_of_a_failsafe_at_the_last_item_is_not_overruled_by_an_abort(
    returning: World, landed: LandedState
) -> None:
    begin_return(returning, Cause.OPEN)
    abort(returning, returning.wire.snapshot())
    returning.run(0.3)
    returning.autopilot.held_by, returning.autopilot.landed = Cause.BATTERY, landed
    returning.run(1.0)
    assert returning.wire.asked == []
    assert returning.state in (State.FLYING_MANUAL, State.LANDING)


def test_an_abort_as_a_mission_begins_its_landing_stops_it(world: World) -> None:
    judged = world.wire.snapshot()
    abort(world, judged)
    world.autopilot.landed = LandedState.LANDING
    world.run(0.5)
    assert world.flight.is_stopping_mission
    world.autopilot.mode, world.autopilot.control = "OFFBOARD", Control.REFERENCES
    world.autopilot.landed = LandedState.IN_AIR
    world.run(0.5)
    assert world.state is State.FLYING_AUTO
    assert world.flight.is_in_control()
