"""The conformance checks find what is wrong: each with a UAV that is sabotaged so."""

from __future__ import annotations

import importlib
import math
import pkgutil
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, cast

import pytest

from tests.waiting import until_state
from ual import conformance
from ual.conformance import Check, CheckFailedError, Flight, Outcome, Tolerances
from ual.conformance.flight import CannotRunError
from ual.conformance.runner import LONGEST_TELEMETRY_GAP_S
from ual.errors import PermissionDeniedError, UalError, WrongStateError
from ual.geometry import Pose, PoseStamped, Twist, TwistStamped, Vector3
from ual.interface import Task, Uav
from ual.types import Capability, Geofence, Plan, State, Telemetry
from ual_daemon import UAL

CHECKS = {check.name: check for check in conformance.CHECKS}
SPEED_FACTOR = 5.0
REPEAT_S = 0.02


class Sabotaged:
    """A UAV of which a test replaces members."""

    def __init__(self, uav: UAL) -> None:
        self.uav = uav
        self.replaced: dict[str, Any] = {}
        self.undo: Callable[[], None] = lambda: None

    def __getattr__(self, name: str) -> Any:
        return self.replaced.get(name) or getattr(self.uav, name)


@pytest.fixture(scope="module")
def uav() -> Iterator[UAL]:
    with UAL("light", "uav_1", backend_settings={"speed_factor": SPEED_FACTOR}) as uav:
        yield uav


@pytest.fixture
def sabotaged(uav: UAL) -> Sabotaged:
    return Sabotaged(uav)


EXACT, REAL = replace(Tolerances.of_simulation(), patience=1.0), replace(Tolerances(), patience=1.0)


def run(sabotaged: Sabotaged, name: str, tolerances: Tolerances = EXACT) -> None:
    conformance.run_check(Flight(cast("Uav", sabotaged), tolerances), CHECKS[name])


def plain(pose: PoseStamped | Pose) -> Pose:
    return pose if isinstance(pose, Pose) else pose.pose


# --- Each a lie or a fault, and the check that must see it ------------------------------------------------------------


def says_it_is_somewhere_else(sabotaged: Sabotaged) -> None:
    def subscribe(callback: Callable[[Telemetry], None], rate_hz: float = 0.0) -> object:
        def shifted(sample: Telemetry) -> None:
            assert sample.pose is not None
            elsewhere = Pose(sample.pose.position + Vector3(0.5, 0.0, 0.0), sample.pose.orientation)
            callback(replace(sample, pose=elsewhere))

        return sabotaged.uav.subscribe(shifted, rate_hz)

    sabotaged.replaced["subscribe"] = subscribe


def mixes_up_north_and_east(sabotaged: Sabotaged) -> None:
    def set_velocity(velocity: TwistStamped | Twist) -> None:
        twist = velocity if isinstance(velocity, Twist) else velocity.twist
        v = twist.linear
        sabotaged.uav.set_velocity(Twist(Vector3(v.y, v.x, -v.z), twist.angular))

    sabotaged.replaced["set_velocity"] = set_velocity


def flies_around_the_corner(sabotaged: Sabotaged) -> None:
    def go_to_waypoint(waypoint: PoseStamped | Pose, **how: Any) -> object:
        goal = plain(waypoint)
        here = sabotaged.uav.pose().pose.position
        sabotaged.uav.follow_path([Pose.at(goal.position.x, here.y, here.z), goal])
        return sabotaged.uav.go_to_waypoint(waypoint, **how)

    sabotaged.replaced["go_to_waypoint"] = go_to_waypoint


def stops_short_of_the_goal(sabotaged: Sabotaged) -> None:
    def go_to_waypoint(waypoint: PoseStamped | Pose, **how: Any) -> object:
        if isinstance(waypoint, Pose):
            return sabotaged.uav.go_to_waypoint(waypoint, **how)
        short = replace(waypoint.pose, position=waypoint.pose.position * 0.8)
        return sabotaged.uav.go_to_waypoint(replace(waypoint, pose=short), **how)

    sabotaged.replaced["go_to_waypoint"] = go_to_waypoint


def flies_as_fast_as_it_can(sabotaged: Sabotaged) -> None:
    def go_to_waypoint(waypoint: PoseStamped | Pose, **how: Any) -> object:
        return sabotaged.uav.go_to_waypoint(waypoint, **{**how, "max_speed_m_s": None})

    sabotaged.replaced["go_to_waypoint"] = go_to_waypoint


def takes_nan_for_nothing(sabotaged: Sabotaged) -> None:
    def set_pose(pose: PoseStamped | Pose) -> None:
        if not math.isnan(plain(pose).position.x):
            sabotaged.uav.set_pose(pose)

    sabotaged.replaced["set_pose"] = set_pose


def repeats_the_last_velocity_for_ever(sabotaged: Sabotaged) -> None:
    given = repeating(sabotaged)

    def set_velocity(velocity: TwistStamped | Twist) -> None:
        given.append(velocity)
        sabotaged.uav.set_velocity(velocity)

    sabotaged.replaced["set_velocity"] = set_velocity


def drifts_after_an_abort(sabotaged: Sabotaged) -> None:
    given = repeating(sabotaged)

    def abort(**_: Any) -> None:
        sabotaged.uav.abort()
        given.append(Twist(Vector3(-0.7, 0.0, 0.0)))

    sabotaged.replaced["abort"] = abort


def repeating(sabotaged: Sabotaged) -> list[TwistStamped | Twist]:
    """Returns a list whose last element is flown, again and again: simulated time then passes only between two of
    them.
    """
    given: list[TwistStamped | Twist] = []
    is_over = threading.Event()
    simulation = sabotaged.uav.simulation

    def repeat() -> None:
        while not is_over.wait(REPEAT_S / SPEED_FACTOR):
            if given:
                simulation.set_speed_factor(0.0)
                sabotaged.uav.set_velocity(given[-1])
                simulation.step(REPEAT_S)

    thread = threading.Thread(target=repeat)
    thread.start()

    def end() -> None:
        is_over.set()
        thread.join()
        simulation.set_speed_factor(SPEED_FACTOR)

    sabotaged.undo = end
    return given


def forgets_to_cancel(sabotaged: Sabotaged) -> None:
    sabotaged.replaced["abort"] = lambda **_: None


def lets_a_take_off_be_aborted(sabotaged: Sabotaged) -> None:
    sabotaged.replaced["abort"] = lambda **_: None


class EndsFirst:
    """A task that is cancelled only when it has ended, as on a busy computer."""

    def __init__(self, task: Task) -> None:
        self.task = task

    def cancel(self) -> None:
        self.task.wait()
        self.task.cancel()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.task, name)


def is_cancelled_too_late(sabotaged: Sabotaged) -> None:
    def take_off(height_m: float, **how: Any) -> EndsFirst:
        return EndsFirst(sabotaged.uav.take_off(height_m, **how))

    def land(**how: Any) -> EndsFirst:
        return EndsFirst(sabotaged.uav.land(**how))

    sabotaged.replaced.update(take_off=take_off, land=land)


def refuses_without_naming_the_state(sabotaged: Sabotaged) -> None:
    def land(**how: Any) -> object:
        if sabotaged.uav.state() is State.FLYING_AUTO:
            return sabotaged.uav.land(**how)
        raise WrongStateError("no")

    sabotaged.replaced["land"] = land


def invents_another_error(sabotaged: Sabotaged) -> None:
    def transform(target_frame_id: str = "", source_frame_id: str = "") -> object:
        try:
            return sabotaged.uav.transform(target_frame_id, source_frame_id)
        except UalError as error:
            raise UalError("something is wrong") from error

    sabotaged.replaced["transform"] = transform


class DryRunThatFlies:
    """A dry run that does what it is only asked about."""

    def __init__(self, uav: UAL) -> None:
        self.uav = uav

    def __getattr__(self, name: str) -> Any:
        def fly(*args: Any, **how: Any) -> Plan:
            plan: Plan = getattr(self.uav.dry_run, name)(*args, **how)
            if name == "go_to_waypoint":
                self.uav.go_to_waypoint(*args, blocking=False, **how)
            return plan

        return fly


def flies_dry_runs(sabotaged: Sabotaged) -> None:
    sabotaged.replaced["dry_run"] = DryRunThatFlies(sabotaged.uav)


def accepts_any_dry_run(sabotaged: Sabotaged) -> None:
    class Yes:
        def __getattr__(self, name: str) -> Any:
            return lambda *_, **__: Plan()

    sabotaged.replaced["dry_run"] = Yes()


@pytest.mark.parametrize(
    ("sabotage", "name", "why"),
    [
        (flies_dry_runs, "a_dry_run_moves_nothing", "a task runs"),
        (accepts_any_dry_run, "a_dry_run_refuses_what_is_refused", "was accepted"),
        (says_it_is_somewhere_else, "telemetry_agrees_with_itself", "pose and odometry differ"),
        (mixes_up_north_and_east, "flies_a_velocity_and_stops_without", "3.5 m ahead"),
        (flies_around_the_corner, "goes_straight_to_a_waypoint", "beside the line"),
        (stops_short_of_the_goal, "goes_to_a_waypoint_in_map", "from the goal"),
        (flies_as_fast_as_it_can, "keeps_below_a_speed", "the limit was 0.5"),
        (takes_nan_for_nothing, "bad_poses_are_refused", "but it was accepted"),
        (repeats_the_last_velocity_for_ever, "flies_a_velocity_and_stops_without", "stop without a new velocity"),
        (forgets_to_cancel, "an_abort_stops", "expected TaskAbortedError"),
        (lets_a_take_off_be_aborted, "a_take_off_is_not_aborted", "aborting in a take-off"),
        (refuses_without_naming_the_state, "flies_nothing_on_the_ground", "metadata says None"),
        (invents_another_error, "bad_frames_are_refused", "expected UnknownFrameError, got INTERNAL"),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_a_check_finds_what_is_wrong(
    sabotaged: Sabotaged, sabotage: Callable[[Sabotaged], None], name: str, why: str
) -> None:
    sabotage(sabotaged)
    try:
        with pytest.raises(CheckFailedError, match=why):
            run(sabotaged, name)
    finally:
        sabotaged.undo()


@pytest.mark.parametrize(
    ("sabotage", "name", "why"),
    [
        (mixes_up_north_and_east, "flies_a_velocity_and_stops_without", "3.5 m ahead"),
        (flies_around_the_corner, "goes_straight_to_a_waypoint", "beside the line"),
        (repeats_the_last_velocity_for_ever, "flies_a_velocity_and_stops_without", "stop without a new velocity"),
        (flies_as_fast_as_it_can, "keeps_below_a_speed", "the limit was 0.5"),
        (drifts_after_an_abort, "an_abort_stops", "m from its position"),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_a_check_of_a_real_uav_whose_estimate_wanders_finds_it_too(
    sabotaged: Sabotaged, sabotage: Callable[[Sabotaged], None], name: str, why: str
) -> None:
    sabotage(sabotaged)
    try:
        with pytest.raises(CheckFailedError, match=why):
            run(sabotaged, name, REAL)
    finally:
        sabotaged.undo()


@pytest.mark.parametrize("name", ["a_take_off_is_not_aborted", "lands"])
def test_what_meets_the_end_of_a_take_off_or_landing_may_be_accepted(sabotaged: Sabotaged, name: str) -> None:
    is_cancelled_too_late(sabotaged)
    run(sabotaged, name)


# --- The runner -------------------------------------------------------------------------------------------------------


def test_a_check_that_cannot_run_is_skipped_and_says_why(sabotaged: Sabotaged) -> None:
    flight = Flight(cast("Uav", sabotaged))
    flight.info = replace(flight.info, capabilities=frozenset({Capability.VELOCITY}))
    with pytest.raises(CannotRunError, match="this UAV cannot GEO"):
        conformance.run_check(flight, CHECKS["goes_to_a_geographic_waypoint"])
    with pytest.raises(CannotRunError, match="needs that the UAV may move"):
        conformance.run_check(flight, CHECKS["turns_with_a_rate"], may_move=False)
    flight.has_pilot = False
    with pytest.raises(CannotRunError, match="needs a simulated safety pilot"):
        conformance.run_check(flight, CHECKS["the_pilot_takes_over"])


def test_an_error_fails_the_check_and_the_run_goes_on(sabotaged: Sabotaged) -> None:
    def fail() -> None:
        raise UalError("lost")

    sabotaged.replaced["frames"] = fail
    checks = [CHECKS["frames_form_a_tree"], CHECKS["says_who_it_is"]]
    results = list(conformance.run(Flight(cast("Uav", sabotaged)), checks))
    assert [result.outcome for result in results] == [Outcome.FAILED, Outcome.PASSED]
    assert results[0].why.startswith("INTERNAL: lost")


def test_a_check_that_saw_too_little_says_so(sabotaged: Sabotaged) -> None:
    """The first sample comes, then none for longer than a check can do without."""

    def subscribe(callback: Callable[[Telemetry], None], rate_hz: float = 0.0) -> object:
        first: list[float] = []

        def late(sample: Telemetry) -> None:
            first.append(sample.stamp_s)
            if not 0.0 < sample.stamp_s - first[0] < LONGEST_TELEMETRY_GAP_S + 0.1:
                callback(sample)

        return sabotaged.uav.subscribe(late, rate_hz)

    sabotaged.replaced["subscribe"] = subscribe
    sabotaged.replaced["abort"] = lambda **_: None
    [result] = conformance.run(Flight(cast("Uav", sabotaged)), [CHECKS["an_abort_stops"]])
    assert result.outcome is Outcome.FAILED
    assert "expected TaskAbortedError" in result.why
    assert "(without telemetry or an answer for " in result.why


def test_a_command_that_takes_long_to_arrive_counts_as_silence(sabotaged: Sabotaged) -> None:
    flight = Flight(cast("Uav", sabotaged))
    with flight.observing():
        seen = flight.wait(lambda _: True, "a sample")
        flight.give_at_once(lambda: flight.let_pass(2 * LONGEST_TELEMETRY_GAP_S), seen)
    assert flight.longest_silence_s >= 2 * LONGEST_TELEMETRY_GAP_S


def test_without_leave_to_move_nothing_moves(sabotaged: Sabotaged) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("it moved")

    for name in ("arm", "take_off", "land", "set_velocity", "set_pose", "go_to_waypoint", "follow_path"):
        sabotaged.replaced[name] = refuse
    if sabotaged.uav.state() is State.FLYING_AUTO:
        sabotaged.uav.land()
    results = list(
        conformance.run(Flight(cast("Uav", sabotaged)), [c for c in conformance.CHECKS if c.moves], may_move=False)
    )
    assert {result.outcome for result in results} == {Outcome.SKIPPED}


def test_an_operator_is_requested_to_arm_what_nobody_else_may(sabotaged: Sabotaged) -> None:
    asked: list[str] = []

    def ask(what: str) -> None:
        asked.append(what)
        sabotaged.uav.simulation.pilot_arm()

    if sabotaged.uav.state() is State.FLYING_AUTO:
        sabotaged.uav.land()
    if sabotaged.uav.state() is State.LANDED_ARMED:
        sabotaged.uav.simulation.pilot_disarm()
        until_state(sabotaged.uav, State.LANDED_DISARMED)
    flight = Flight(cast("Uav", sabotaged), ask_operator=ask)
    flight.has_pilot, flight.info = False, replace(flight.info, is_arming_allowed=False)
    conformance.run_check(flight, CHECKS["bad_heights_are_refused"])
    assert asked == ["arm the UAV"]


def test_each_check_that_is_defined_is_in_the_list() -> None:
    modules = [
        importlib.import_module(f"ual.conformance.{each.name}") for each in pkgutil.iter_modules(conformance.__path__)
    ]
    defined = {each.name for module in modules for each in vars(module).values() if isinstance(each, Check)}
    assert defined == CHECKS.keys()


@pytest.mark.parametrize("wrong", [Geofence("odom"), Geofence("map", min_z_m=3.0, max_z_m=2.0)])
def test_a_geofence_that_makes_no_sense_is_found(sabotaged: Sabotaged, wrong: Geofence) -> None:
    sabotaged.replaced["geofence"] = lambda: wrong
    with pytest.raises(CheckFailedError, match="geofence"):
        run(sabotaged, "the_geofence_is_reported")


def test_checks_have_names_and_descriptions_of_their_own() -> None:
    assert len(CHECKS) == len(conformance.CHECKS)
    assert all(check.description.endswith(".") for check in conformance.CHECKS)


def test_a_real_safety_pilot_who_takes_over_ends_the_run(sabotaged: Sabotaged) -> None:
    flight = Flight(cast("Uav", sabotaged))
    with flight.observing():
        flight.bring_to([State.FLYING_AUTO])
    flight.has_pilot = False
    sabotaged.uav.simulation.pilot_take_over()
    results = list(conformance.run(flight, [CHECKS["keeps_the_heading"], CHECKS["says_who_it_is"]]))
    assert [result.outcome for result in results] == [Outcome.FAILED, Outcome.SKIPPED]
    assert "the safety pilot" in results[0].why
    assert results[1].why == "nothing is flown after keeps_the_heading"
    assert sabotaged.uav.state() is State.FLYING_MANUAL
    sabotaged.uav.simulation.pilot_give_back()


def test_a_daemon_that_may_not_arm_must_say_so(sabotaged: Sabotaged) -> None:
    def refuse() -> None:
        raise PermissionDeniedError("arming belongs to the safety pilot")

    flight = Flight(cast("Uav", sabotaged))
    flight.info = replace(flight.info, is_arming_allowed=False)
    with pytest.raises(CheckFailedError, match="but it was accepted"):
        conformance.run_check(flight, CHECKS["arming_belongs_to_the_pilot"])
    sabotaged.replaced["arm"] = refuse
    conformance.run_check(flight, CHECKS["arming_belongs_to_the_pilot"])
