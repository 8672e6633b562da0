"""Commands that are prepared and then begun, or not (dry runs), and their speeds. In stepped time."""

from __future__ import annotations

import itertools
import logging
import math
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import Any

import pytest

from tests.ual_daemon.stepped import STEP_S, Stepped, at, stepped
from ual.errors import (
    InvalidArgumentError,
    NotSupportedError,
    ResourceExhaustedError,
    TaskAbortedError,
    UalError,
    UnknownFrameError,
    WrongStateError,
)
from ual.geometry import PointStamped, Pose, PoseStamped, Quaternion, Transform, Twist, TwistStamped, Vector3
from ual.types import AltitudeReference, Capability, GeoWaypoint, Limits, PathHeading, Plan, State, TaskStatus
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.light.physics import FlightMode
from ual_daemon.frames.resolver import FrameResolver, Goal
from ual_daemon.tracker import limits
from ual_daemon.vehicle.prepared import Prepared


def velocity(x: float, y: float = 0.0, frame_id: str = "") -> TwistStamped:
    return TwistStamped(Twist(Vector3(x, y, 0.0)), frame_id)


@dataclass(frozen=True)
class Case:
    """A command, and the state that it is allowed in."""

    prepare: Callable[[Stepped], Prepared[Any]]
    state: State = State.FLYING_AUTO


def reference(uav: Stepped, setpoint: PoseStamped | TwistStamped) -> Prepared[None]:
    """A setpoint as a command that may begin."""
    setpoints = uav.vehicle.commands.setpoints
    if isinstance(setpoint, TwistStamped):
        return Prepared(setpoints.plan_velocity(setpoint), lambda: setpoints.set_velocity(setpoint))
    return Prepared(setpoints.plan_pose(setpoint), lambda: setpoints.set_pose(setpoint))


MOTIONS = {
    "take_off": Case(lambda uav: uav.prepare.take_off(3.0), State.LANDED_ARMED),
    "land": Case(lambda uav: uav.prepare.land()),
    "go_to_waypoint": Case(lambda uav: uav.prepare.go_to_waypoint(at(3, 4, 3))),
    "go_to_waypoint_geo": Case(lambda uav: uav.prepare.go_to_waypoint_geo(*near(uav), AltitudeReference.AMSL)),
    "follow_path": Case(lambda uav: uav.prepare.follow_path([at(2, 0, 3), at(2, 2, 3)])),
    "set_pose": Case(lambda uav: reference(uav, at(1, 1, 3))),
    "set_velocity": Case(lambda uav: reference(uav, velocity(1.0))),
    "recover_from_manual": Case(lambda uav: uav.vehicle.commands.recover_from_manual(), State.FLYING_MANUAL),
}


def near(uav: Stepped) -> tuple[float, float, float]:
    """3 m to the east, 4 m to the north and 3 m above the origin of the local frame."""
    projection = uav.vehicle.backend.snapshot().earth.projection
    assert projection is not None
    point = projection.to_geo(Vector3(3, 4, 3))
    assert point.altitude_amsl_m is not None
    return point.latitude_deg, point.longitude_deg, point.altitude_amsl_m


def test_a_pilot_who_chooses_another_mode_in_the_moment_of_a_recovery_keeps_it() -> None:
    with stepped() as uav:
        bring_to(uav, State.FLYING_MANUAL)
        judged = uav.vehicle.commands.recover_from_manual()
        backend = uav.vehicle.backend
        assert isinstance(backend, LightBackend)
        backend.pilot_switch(FlightMode.ALTITUDE)
        uav.run(STEP_S)
        recovery = judged.begin()
        with pytest.raises(TaskAbortedError, match="took over"):
            uav.end(recovery)
        uav.run(1.0)
        assert uav.state is State.FLYING_MANUAL
        assert backend.snapshot().control.mode_name == "ALTITUDE"


def test_a_pilot_who_takes_over_in_the_moment_of_the_shutdown_keeps_the_uav(monkeypatch: pytest.MonkeyPatch) -> None:
    with stepped() as uav:
        bring_to(uav, State.FLYING_AUTO)
        hold = uav.vehicle.backend.hold

        def hold_too_late() -> Future[None]:
            uav.sim.pilot_take_over()
            return hold()

        monkeypatch.setattr(uav.vehicle.backend, "hold", hold_too_late)
        ended = uav.vehicle.prepare_shutdown()
        uav.end(ended)
        assert uav.vehicle.telemetry().flight_mode == "MANUAL"


def test_after_a_shutdown_the_hold_is_reported_as_that_of_ual() -> None:
    """The last state of a daemon named nobody."""
    with stepped() as uav:
        bring_to(uav, State.FLYING_AUTO)
        uav.end(uav.vehicle.prepare_shutdown())
        uav.run(1.0)
        told = uav.vehicle.telemetry()
        assert told.state is State.FLYING_MANUAL
        assert told.state_reason.endswith("; UAL has had the autopilot hold by itself")


def bring_to(uav: Stepped, state: State) -> None:
    uav.arm()
    if state is not State.LANDED_ARMED:
        uav.end(uav.prepare.take_off(3.0).begin().future)
    if state is State.FLYING_MANUAL:
        uav.sim.pilot_take_over()
        uav.run(STEP_S)
    assert uav.state is state


class Recorder:
    """Records what is sent to the autopilot."""

    def __init__(self, uav: Stepped, monkeypatch: pytest.MonkeyPatch) -> None:
        self.sent: list[str] = []
        for name in ("send", "take_off", "land", "take_control", "hold", "arm", "disarm"):
            monkeypatch.setattr(uav.vehicle.backend, name, self._recording(name, getattr(uav.vehicle.backend, name)))

    def _recording(self, name: str, method: Callable[..., Any]) -> Callable[..., Any]:
        def record(*args: Any) -> Any:
            self.sent.append(name)
            return method(*args)

        return record


# --- Between the checks and the beginning -----------------------------------------------------------------------------


def test_a_path_does_not_begin_if_another_command_came_while_it_was_planned(flying: Stepped) -> None:
    prepared = flying.prepare.follow_path([at(5, 0, 3), at(5, 5, 3)])
    flying.vehicle.commands.abort()  # by another thread, while the path is planned
    with pytest.raises(TaskAbortedError, match="replaced by abort"):
        prepared.begin()
    flying.run(2.0)
    assert flying.vehicle.telemetry().task is None
    assert flying.pose.position.x < 0.1


def test_a_path_does_not_begin_if_the_uav_flew_on_while_it_was_planned(flying: Stepped) -> None:
    task = flying.prepare.go_to_waypoint(at(9, 0, 3)).begin()
    flying.run(2.0)
    prepared = flying.prepare.follow_path([at(9, 0, 3), at(9, 9, 3)])
    flying.run(2.0)
    with pytest.raises(WrongStateError, match="flew on by"):
        prepared.begin()
    assert task.info().status is TaskStatus.RUNNING


def test_a_path_does_not_begin_if_the_safety_pilot_took_over_while_it_was_planned(flying: Stepped) -> None:
    prepared = flying.prepare.go_to_waypoint(at(9, 0, 3))
    flying.sim.pilot_take_over()
    with pytest.raises(WrongStateError, match="FLYING_MANUAL"):
        prepared.begin()


# --- Setpoints: sent, or as a dry run ---------------------------------------------------------------------------------


REFUSED_POSES = {
    "not a number": PoseStamped(Pose(Vector3(math.nan, 0.0, 3.0))),
    "far": at(2e7, 0, 3),
    "unknown frame": at(1, 1, 3, None, "nowhere"),
    "a velocity": velocity(1.0),
    "nothing": None,
}
REFUSED_VELOCITIES = {
    "not a number": velocity(math.nan),
    "fast": velocity(1001.0),
    "unknown frame": velocity(1.0, frame_id="nowhere"),
    "a pose": at(5, 0, 3),
    "nothing": None,
}


def refusal(begin: Callable[[], object], caplog: pytest.LogCaptureFixture) -> tuple[type[UalError], str, list[str]]:
    """Returns the error by which a setpoint is refused, and its log lines."""
    caplog.clear()
    with pytest.raises(UalError) as refused, caplog.at_level(logging.WARNING, "ual_daemon"):
        begin()
    return type(refused.value), str(refused.value), [vars(record).get("ual_event", "") for record in caplog.records]


def both_directions(uav: Stepped, name: str, setpoint: Any) -> tuple[Callable[[], object], Callable[[], object]]:
    """Returns the setpoint as a dry run, and as a command."""
    setpoints = uav.vehicle.commands.setpoints
    if name == "set_pose":
        return lambda: setpoints.plan_pose(setpoint), lambda: setpoints.set_pose(setpoint)
    return lambda: setpoints.plan_velocity(setpoint), lambda: setpoints.set_velocity(setpoint)


@pytest.mark.parametrize(
    ("name", "what"),
    [*(("set_pose", each) for each in REFUSED_POSES), *(("set_velocity", each) for each in REFUSED_VELOCITIES)],
)
def test_a_setpoint_is_refused_as_its_dry_run_is_and_nothing_is_sent(
    flying: Stepped, name: str, what: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    setpoint = (REFUSED_POSES if name == "set_pose" else REFUSED_VELOCITIES)[what]
    recorder = Recorder(flying, monkeypatch)
    dry_run, send = both_directions(flying, name, setpoint)
    kind, text, events = refusal(dry_run, caplog)
    monkeypatch.setattr(flying.vehicle.commands._preconditions, "_last_refusal", ("", 0.0))
    assert refusal(send, caplog) == (kind, text, events)
    assert events == ["refused"]
    assert recorder.sent == []


@pytest.mark.parametrize("state", [State.LANDED_ARMED, State.FLYING_MANUAL])
@pytest.mark.parametrize(("name", "setpoint"), [("set_pose", at(1, 1, 3)), ("set_velocity", velocity(1.0))])
def test_no_setpoint_is_sent_unless_the_uav_is_ours(
    uav: Stepped, name: str, setpoint: Any, state: State, monkeypatch: pytest.MonkeyPatch
) -> None:
    bring_to(uav, state)
    recorder = Recorder(uav, monkeypatch)
    for begin in both_directions(uav, name, setpoint):
        with pytest.raises(WrongStateError, match=f"{name} needs the state FLYING_AUTO") as refused:
            begin()
        assert refused.value.message.endswith("; take off first") == (state is State.LANDED_ARMED)
    uav.run(1.0)
    assert recorder.sent == []


@pytest.mark.parametrize(
    ("state", "way_out"),
    [(State.LANDED_ARMED, "; take off first"), (State.LANDED_DISARMED, "; arm and take off first")],
)
def test_a_motion_on_the_ground_learns_what_comes_first_and_a_landing_is_not(
    uav: Stepped, state: State, way_out: str
) -> None:
    if state is State.LANDED_ARMED:
        uav.arm()
    assert uav.state is state
    motions = [name for name, motion in MOTIONS.items() if motion.state is State.FLYING_AUTO]
    for name in motions:
        with pytest.raises(WrongStateError) as refused:
            MOTIONS[name].prepare(uav)
        assert refused.value.message.endswith(way_out) == (name != "land"), name


# --- Dry runs ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MOTIONS)
def test_a_prepared_command_sends_nothing(uav: Stepped, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    bring_to(uav, MOTIONS[name].state)
    before = uav.vehicle.telemetry()
    recorder = Recorder(uav, monkeypatch)
    MOTIONS[name].prepare(uav)
    assert recorder.sent == []
    assert uav.vehicle.telemetry() == before
    uav.run(2.0)
    assert uav.state is MOTIONS[name].state
    assert uav.vehicle.telemetry().task is None
    assert before.pose is not None
    assert (uav.pose.position - before.pose.position).norm() < 0.05


@pytest.mark.parametrize("name", MOTIONS)
def test_a_begun_command_sends_something(uav: Stepped, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    bring_to(uav, MOTIONS[name].state)
    recorder = Recorder(uav, monkeypatch)
    MOTIONS[name].prepare(uav).begin()
    uav.run(2 * STEP_S)
    assert recorder.sent != []


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("state", [State.LANDED_ARMED, State.FLYING_AUTO, State.FLYING_MANUAL])
def test_a_dry_run_is_refused_in_the_same_states_as_the_command(uav: Stepped, name: str, state: State) -> None:
    bring_to(uav, state)
    if state is MOTIONS[name].state:
        MOTIONS[name].prepare(uav)
        return
    with pytest.raises(WrongStateError) as refused:
        MOTIONS[name].prepare(uav)
    assert refused.value.metadata["command"] == name


def test_a_dry_run_leaves_the_running_task_alone(flying: Stepped) -> None:
    task = flying.prepare.go_to_waypoint(at(5, 0, 3)).begin()
    flying.run(1.0)
    for name in ("land", "go_to_waypoint", "follow_path", "set_pose", "set_velocity"):
        MOTIONS[name].prepare(flying)
    assert task.info().status is TaskStatus.RUNNING
    flying.end(task.future)
    assert (flying.pose.position - Vector3(5, 0, 3)).norm() < 0.05


@pytest.mark.parametrize("name", [name for name, case in MOTIONS.items() if case.state is State.FLYING_AUTO])
def test_a_dry_run_is_refused_while_a_landing_cannot_be_replaced(flying: Stepped, name: str) -> None:
    flying.prepare.land().begin()
    with pytest.raises(WrongStateError) as refused:
        MOTIONS[name].prepare(flying)
    assert "land" in str(refused.value).lower()


@pytest.mark.parametrize("name", ["set_pose", "set_velocity", "go_to_waypoint", "follow_path"])
def test_a_dry_run_is_refused_while_a_manoeuvre_cannot_be_replaced(
    flying: Stepped, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def not_now(command: str) -> None:
        raise WrongStateError(f"{command}: not now")

    monkeypatch.setattr(flying.vehicle._flight, "require_replaceable", not_now)
    with pytest.raises(WrongStateError, match=f"{name}: not now"):
        MOTIONS[name].prepare(flying)


@pytest.mark.parametrize("name", MOTIONS)
def test_a_dry_run_is_refused_if_the_backend_cannot_do_it(
    uav: Stepped, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bring_to(uav, MOTIONS[name].state)
    less = replace(uav.vehicle.backend.info(), capabilities=frozenset({Capability.ARM}))
    monkeypatch.setattr(uav.vehicle.backend, "info", lambda: less)
    with pytest.raises(NotSupportedError, match=name):
        MOTIONS[name].prepare(uav)


@pytest.mark.parametrize(
    ("prepare", "kind"),
    [
        (lambda uav: uav.prepare.go_to_waypoint(at(math.nan, 0, 3)), InvalidArgumentError),
        (lambda uav: uav.prepare.go_to_waypoint(at(0, 0, 3, None, "nowhere")), UnknownFrameError),
        (lambda uav: uav.prepare.go_to_waypoint_geo(91.0, 0.0, 3.0), InvalidArgumentError),
        (lambda uav: uav.prepare.follow_path([]), InvalidArgumentError),
        (lambda uav: reference(uav, at(0, 2e7, 3)), InvalidArgumentError),
        (lambda uav: reference(uav, velocity(math.inf)), InvalidArgumentError),
        (lambda uav: uav.prepare.take_off(0.0), InvalidArgumentError),
    ],
)
def test_a_dry_run_is_refused_for_invalid_values(
    flying: Stepped, prepare: Callable[[Stepped], object], kind: type[UalError]
) -> None:
    with pytest.raises(kind):
        prepare(flying)


# --- Plans ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["take_off", "go_to_waypoint", "go_to_waypoint_geo", "follow_path"])
def test_the_flight_agrees_with_the_plan(uav: Stepped, name: str) -> None:
    bring_to(uav, MOTIONS[name].state)
    begin_position, begin_s = uav.pose.position, uav.vehicle.telemetry().stamp_s
    prepared = MOTIONS[name].prepare(uav)
    task = prepared.begin()
    assert prepared.plan.length_m is not None
    assert prepared.plan.duration_s is not None
    positions = [begin_position]
    while not task.future.done():
        uav.run(STEP_S)
        positions.append(uav.pose.position)
    took_s = uav.vehicle.telemetry().stamp_s - begin_s
    flown_m = sum((b - a).norm() for a, b in itertools.pairwise(positions))
    assert prepared.plan.length_m == pytest.approx(flown_m, rel=0.05)
    # A take-off ends a little below the top. The others settle at their ends, a path at its stop, too: this adds time.
    assert 0.8 * prepared.plan.duration_s <= took_s <= prepared.plan.duration_s + 4.0


def test_a_plan_leaves_out_what_is_not_known(flying: Stepped) -> None:
    for name in ("land", "set_pose", "set_velocity"):
        assert MOTIONS[name].prepare(flying).plan == Plan()


def test_a_climb_that_the_autopilot_flies_has_no_known_duration(uav: Stepped, monkeypatch: pytest.MonkeyPatch) -> None:
    bring_to(uav, State.LANDED_ARMED)
    by_itself = replace(uav.vehicle.backend.info(), flies_takeoff_on_setpoints=False)
    monkeypatch.setattr(uav.vehicle.backend, "info", lambda: by_itself)
    assert uav.prepare.take_off(3.0).plan == Plan(length_m=3.0)


# --- Speeds -----------------------------------------------------------------------------------------------------------


def fastest(uav: Stepped) -> float:
    return max(sample.velocity.linear.norm() for sample in uav.samples if sample.velocity is not None)


@pytest.mark.parametrize("goal", [(6, 0, 3), (0, -6, 3), (0, 0, 8), (0, 0, 1), (4, 3, 6)])
def test_a_go_to_keeps_its_maximum_speed(flying: Stepped, goal: tuple[float, float, float]) -> None:
    flying.keep_samples()
    slow = flying.prepare.go_to_waypoint(at(*goal), max_speed_m_s=0.5)
    quick = flying.prepare.go_to_waypoint(at(*goal))
    assert slow.plan.duration_s is not None
    assert quick.plan.duration_s is not None
    assert slow.plan.duration_s > 1.2 * quick.plan.duration_s
    flying.end(slow.begin().future)
    assert (flying.pose.position - Vector3(*goal)).norm() < 0.05
    assert 0.4 < fastest(flying) < 0.52


def test_a_speed_beyond_the_limits_changes_nothing(flying: Stepped) -> None:
    prepare = flying.prepare
    assert prepare.go_to_waypoint(at(6, 0, 3), max_speed_m_s=900.0).plan == prepare.go_to_waypoint(at(6, 0, 3)).plan


def test_a_geographic_go_to_and_a_path_keep_their_maximum_speed(flying: Stepped) -> None:
    flying.keep_samples()
    prepare = flying.prepare
    flying.end(prepare.go_to_waypoint_geo(*near(flying), AltitudeReference.AMSL, max_speed_m_s=0.6).begin().future)
    flying.end(prepare.follow_path([at(3, 0, 3), at(0, 0, 4)], max_speed_m_s=0.6).begin().future)
    assert 0.5 < fastest(flying) < 0.63


@pytest.mark.parametrize("speed_m_s", [0.0, 1e-9, -1.0, math.nan, math.inf, 1001.0, "fast"])
def test_invalid_speeds_are_refused(flying: Stepped, speed_m_s: float) -> None:
    prepare = flying.prepare
    calls: list[Callable[[], object]] = [
        lambda: prepare.go_to_waypoint(at(1, 0, 3), max_speed_m_s=speed_m_s),
        lambda: prepare.go_to_waypoint_geo(0.0, 0.0, 3.0, max_speed_m_s=speed_m_s),
        lambda: prepare.follow_path([at(1, 0, 3)], max_speed_m_s=speed_m_s),
    ]
    for call in calls:
        with pytest.raises(InvalidArgumentError, match="max_speed_m_s") as refused:
            call()
        assert refused.value.metadata["field"] == "max_speed_m_s"


def test_the_maximum_speed_narrows_the_limits_that_are_above_it() -> None:
    own = Limits(5.0, 3.0, 1.0, 2.0, 1.5, 1.0)
    assert limits.at_most(own, None) is own
    assert limits.at_most(own, 2.0) == Limits(2.0, 2.0, 1.0, 2.0, 1.5, 1.0)


# --- Paths ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"leg_speeds_m_s": [1.0]}, "leg_speeds_m_s"),
        ({"leg_speeds_m_s": [1.0, 1.0, 1.0]}, "leg_speeds_m_s"),
        ({"leg_speeds_m_s": [1.0, -1.0]}, "leg_speeds_m_s[1]"),
        ({"leg_speeds_m_s": [math.nan, 1.0]}, "leg_speeds_m_s[0]"),
        ({"heading": "north"}, "heading"),
        ({"heading": PathHeading.POINT_OF_INTEREST}, "point_of_interest"),
        ({"point_of_interest": PointStamped()}, "point_of_interest"),
        (
            {
                "heading": PathHeading.POINT_OF_INTEREST,
                "point_of_interest": PointStamped(Vector3(math.nan, 0, 0)),
            },
            "point_of_interest.point.x",
        ),
        (
            {"heading": PathHeading.POINT_OF_INTEREST, "point_of_interest": (1, 2, 3)},
            "point_of_interest",
        ),
    ],
)
def test_invalid_path_options_are_refused(flying: Stepped, options: dict[str, Any], field: str) -> None:
    with pytest.raises(InvalidArgumentError) as refused:
        flying.prepare.follow_path([at(1, 0, 3), at(2, 0, 3)], **options)
    assert refused.value.metadata["field"] == field


def test_each_leg_has_the_smaller_of_its_speeds(flying: Stepped) -> None:
    goals = [at(3, 0, 3), at(3, 3, 3), at(0, 3, 3)]
    task = flying.prepare.follow_path(goals, max_speed_m_s=0.8, leg_speeds_m_s=[0.4, 0.0, 900.0]).begin()
    fastest_m_s = [0.0, 0.0, 0.0]
    while not task.future.done():
        flying.run(STEP_S)
        leg = task.info().waypoint_index
        if leg is not None:
            fastest_m_s[leg] = max(fastest_m_s[leg], flying.speed)
    assert fastest_m_s[0] == pytest.approx(0.4, abs=0.03)
    assert fastest_m_s[1:] == pytest.approx([0.8, 0.8], abs=0.05)


def test_a_path_faces_a_point_in_any_frame(flying: Stepped) -> None:
    flying.vehicle.frame_editor.add(Transform(Vector3(4, 0, 0), Quaternion.from_yaw(1.0), "map", "tower"))
    task = flying.prepare.follow_path(
        [at(0, 4, 3)],
        heading=PathHeading.POINT_OF_INTEREST,
        point_of_interest=PointStamped(Vector3(), "tower"),
    ).begin()
    flying.end(task.future)
    assert flying.pose.yaw_rad == pytest.approx(-math.pi / 4, abs=0.03)


@pytest.mark.parametrize(("heading", "yaw_rad"), [(PathHeading.FIXED, 0.0), (PathHeading.ALONG_PATH, math.pi / 2)])
def test_the_heading_of_the_request_wins_over_those_of_the_waypoints(
    flying: Stepped, heading: PathHeading, yaw_rad: float
) -> None:
    flying.end(flying.prepare.follow_path([at(0, 4, 3, 2.5)], heading=heading).begin().future)
    assert flying.pose.yaw_rad == pytest.approx(yaw_rad, abs=0.03)


def test_a_point_of_interest_in_an_unknown_frame_is_refused(flying: Stepped) -> None:
    with pytest.raises(UnknownFrameError):
        flying.prepare.follow_path(
            [at(1, 0, 3)],
            heading=PathHeading.POINT_OF_INTEREST,
            point_of_interest=PointStamped(Vector3(), "nowhere"),
        )


def test_a_path_of_geographic_waypoints_is_executed_where_they_are(flying: Stepped) -> None:
    latitude_deg, longitude_deg, altitude_m = near(flying)
    waypoints = [
        GeoWaypoint(latitude_deg, longitude_deg, altitude_m, AltitudeReference.AMSL),
        GeoWaypoint(latitude_deg, longitude_deg, 5.0, yaw_rad=1.0),
    ]
    flying.end(flying.prepare.follow_path(waypoints).begin().future)
    assert (flying.pose.position - Vector3(3, 4, 5)).norm() < 0.05
    assert flying.pose.yaw_rad == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("waypoints", "field"),
    [
        ([at(1, 0, 3), GeoWaypoint(37.0, -6.0, 3.0)], "waypoints"),
        ([GeoWaypoint(37.0, -6.0, 3.0), GeoWaypoint(91.0, -6.0, 3.0)], "geo_waypoints[1].latitude_deg"),
        ([GeoWaypoint(37.0, 181.0, 3.0)], "geo_waypoints[0].longitude_deg"),
        ([GeoWaypoint(37.0, -6.0, math.nan)], "geo_waypoints[0].altitude_m"),
        ([GeoWaypoint(37.0, -6.0, 3.0, yaw_rad=math.inf)], "geo_waypoints[0].yaw_rad"),
    ],
)
def test_invalid_geographic_waypoints_are_refused(
    flying: Stepped, waypoints: list[PoseStamped | GeoWaypoint], field: str
) -> None:
    with pytest.raises(InvalidArgumentError) as refused:
        flying.prepare.follow_path(waypoints)  # type: ignore[arg-type]
    assert refused.value.metadata["field"] == field


# --- Frames that a client moves ---------------------------------------------------------------------------------------


def test_the_number_of_waypoints_has_a_limit(flying: Stepped) -> None:
    flying.prepare.follow_path([at(0.1 * (i % 10), 0, 3) for i in range(20)])
    with pytest.raises(ResourceExhaustedError, match="waypoints: 10001 are more than the limit of 10000") as caught:
        flying.prepare.follow_path([at(1, 0, 3)] * 10_001)
    assert dict(caught.value.metadata) == {"field": "waypoints", "limit": "10000"}


def test_another_uavs_frame_is_moved_often_with_its_stamp(uav: Stepped, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        for i in range(50):
            point = Vector3(0.1 * i, 0.0, 2.0)
            uav.vehicle.frame_editor.add(Transform(point, Quaternion(), "map", "car/base_link", 1000.0 + 0.02 * i))
    added = [record for record in caplog.records if vars(record).get("ual_event") == "command"]
    assert len(added) == 1
    (found,) = [frame for frame in uav.vehicle.frames() if frame.frame_id == "car/base_link"]
    assert found.transform is not None
    assert found.transform.translation == Vector3(0.1 * 49, 0.0, 2.0)
    assert found.transform.stamp_s == 1000.0 + 0.02 * 49


@pytest.mark.parametrize("stamp_s", [math.nan, -1.0, math.inf, 1e300])
def test_an_invalid_stamp_is_refused(uav: Stepped, stamp_s: float) -> None:
    with pytest.raises(InvalidArgumentError, match=r"transform\.header\.stamp"):
        uav.vehicle.frame_editor.add(Transform(Vector3(), Quaternion(), "map", "car/base_link", stamp_s))


def test_a_command_that_comes_while_waypoints_are_read_is_newer_than_the_path(
    flying: Stepped, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = FrameResolver.goal

    def read_meanwhile(resolver: FrameResolver, goal: PoseStamped, field: str) -> Goal:
        if field == "waypoints[1]":
            flying.vehicle.commands.abort()
        return read(resolver, goal, field)

    monkeypatch.setattr(FrameResolver, "goal", read_meanwhile)
    path = flying.prepare.follow_path([at(1.0, 0.0, 3.0), at(2.0, 0.0, 3.0)])
    with pytest.raises(TaskAbortedError, match="replaced by abort"):
        path.begin()


def test_a_go_to_that_replaces_another_at_once_begins_with_its_reference() -> None:
    with stepped(light={"response_s": 1.0}) as uav:  # the UAV lags
        uav.fly()
        uav.update_each_step()
        uav.prepare.go_to_waypoint(at(10.0, 0.0, 3.0)).begin()
        uav.run(0.7)
        before = uav.vehicle.telemetry().reference_pose
        for _ in range(3):
            uav.prepare.go_to_waypoint(at(10.0, 0.0, 3.0)).begin()
        uav.run(STEP_S)
        after = uav.vehicle.telemetry().reference_pose
        assert before is not None
        assert after is not None
        assert after.position.x - before.position.x == pytest.approx(1.02 * STEP_S, abs=0.002)
