"""Checks on the ground: arming, home, refusals, and the take-off."""

from __future__ import annotations

import functools
import math
from contextlib import suppress

from ual.conformance.check import LANDED, Need, check
from ual.conformance.flight import CEILING_M, HEIGHT_M, CannotRunError, Flight, position, require, speed
from ual.errors import (
    InvalidArgumentError,
    PermissionDeniedError,
    TaskAbortedError,
    UnknownFrameError,
    WrongStateError,
)
from ual.geometry import IDENTITY, KEEP_HEADING, Pose, PoseStamped, Twist, Vector3
from ual.types import Capability, State, TaskKind, TaskStatus

_TAKE_OFF = (Capability.TAKE_OFF,)
_STAMP_OFFSET_S = 10.0


@check(State.LANDED_DISARMED, needs=(Need.NO_ARMING,), capabilities=(Capability.ARM,))
def arming_belongs_to_the_pilot(flight: Flight) -> None:
    """A daemon without the permission refuses to arm."""
    flight.refuses(PermissionDeniedError, flight.uav.arm, "arming")
    require(flight.uav.state() is State.LANDED_DISARMED, "it armed all the same")


@check(State.LANDED_DISARMED, needs=(Need.ARMING, Need.MOTION), capabilities=(Capability.ARM,), moves="the propellers")
def arms_and_disarms(flight: Flight) -> None:
    """Arming and disarming end when the autopilot has done them; each is refused if it is done already."""
    uav = flight.uav
    _require_names_state(flight.refuses(WrongStateError, uav.disarm, "disarming again"), State.LANDED_DISARMED)
    uav.arm()
    flight.wait_for_state(State.LANDED_ARMED)
    _require_names_state(flight.refuses(WrongStateError, uav.arm, "arming again"), State.LANDED_ARMED)
    uav.disarm()
    flight.wait_for_state(State.LANDED_DISARMED)


@check(State.LANDED_DISARMED)
def takes_off_only_when_armed(flight: Flight) -> None:
    """A take-off while disarmed is refused, unless it waits for an automatic arming."""
    try:
        flight.uav.dry_run.take_off(HEIGHT_M)
    except WrongStateError:
        error = flight.refuses(WrongStateError, lambda: flight.uav.take_off(HEIGHT_M), "a take-off while disarmed")
        _require_names_state(error, State.LANDED_DISARMED)
        return
    raise CannotRunError("a simulated safety pilot arms it, and a take-off waits for that (--auto-arm)")


@check(*LANDED)
def flies_nothing_on_the_ground(flight: Flight) -> None:
    """Each flying command that it can fly is refused on the ground, and the refusal names the state."""
    uav = flight.uav
    state = uav.state()
    goal = Pose.at(0.0, 0.0, HEIGHT_M)
    for capability, action, what in (
        (Capability.LAND, uav.land, "landing"),
        (Capability.POSITION, lambda: uav.go_to_waypoint(goal), "a waypoint"),
        (Capability.GEO, lambda: uav.go_to_waypoint_geo(0.0, 0.0, HEIGHT_M), "a geographic waypoint"),
        (Capability.POSITION, lambda: uav.follow_path([goal]), "a path"),
        (Capability.POSITION, lambda: uav.set_pose(goal), "a pose"),
        (Capability.VELOCITY, lambda: uav.set_velocity(Twist(Vector3(0.0, 0.0, 1.0))), "a velocity"),
        (Capability.RECOVER, uav.recover_from_manual, "recovering"),
        (None, uav.abort, "aborting"),
    ):
        if capability is None or capability in flight.info.capabilities:
            _require_names_state(flight.refuses(WrongStateError, action, f"{what} on the ground"), state)
    require(uav.state() is state, "the state changed")


@check(State.LANDED_ARMED, capabilities=_TAKE_OFF, moves="the propellers")
def bad_heights_are_refused(flight: Flight) -> None:
    """Take-off heights that are not valid are refused, and it stays on the ground."""
    before = flight.position()
    for height_m in (math.nan, math.inf, -math.inf, -1.0, 0.0, 1e9):
        take_off = functools.partial(flight.uav.take_off, height_m)
        error = flight.refuses(InvalidArgumentError, take_off, f"a take-off to {height_m} m")
        require(error.metadata.get("field") == "height_m", "the field height_m is not named")
    require(flight.uav.is_idle(), "a task runs")
    moved_m = (flight.position() - before).norm()
    require(moved_m <= flight.tolerances.position_m, f"it moved by {moved_m:.2f} m")


@check(*LANDED)
def home_becomes_the_origin(flight: Flight) -> None:
    """Setting home makes the present position the origin of odom."""
    t = flight.tolerances
    flight.uav.set_home(set_z=False)
    here = flight.position()
    require(here.horizontal_norm() <= t.position_m, f"it is at {here.x:.2f} {here.y:.2f}")
    flight.uav.set_home(set_z=True)
    require(flight.position().norm() <= t.position_m, "its height is not 0")
    flight.remember_position()


@check(*LANDED, capabilities=(Capability.EXTERNAL_POSE,))
def bad_poses_from_outside_are_refused(flight: Flight) -> None:
    """Poses from outside that are old, in the future, not valid, or in an unknown frame or the body's are refused."""
    uav = flight.uav
    state, before, now_s = uav.state(), flight.position(), uav.telemetry().stamp_s
    here = Pose(before, IDENTITY)
    for pose, kind, what in (
        (PoseStamped(here, stamp_s=now_s - _STAMP_OFFSET_S), InvalidArgumentError, "that is old"),
        (PoseStamped(here, stamp_s=now_s + _STAMP_OFFSET_S), InvalidArgumentError, "of the future"),
        (PoseStamped(Pose(before, KEEP_HEADING)), InvalidArgumentError, "without an orientation"),
        (PoseStamped(Pose(Vector3(math.nan, 0.0, 0.0), IDENTITY)), InvalidArgumentError, "that is not finite"),
        (PoseStamped(here, f"{flight.info.namespace}/base_link"), InvalidArgumentError, "in its own body"),
        (PoseStamped(here, "no_such_frame"), UnknownFrameError, "in an unknown frame"),
    ):
        flight.refuses(kind, functools.partial(uav.set_external_pose, pose), f"a pose from outside {what}")
    for std_dev in (math.nan, -1.0, 0.0):
        give = functools.partial(uav.set_external_pose, PoseStamped(here), position_std_dev_m=std_dev)
        flight.refuses(InvalidArgumentError, give, f"a pose from outside with the standard deviation {std_dev}")
    require(uav.state() is state, "the state changed")


@check(State.LANDED_ARMED, capabilities=_TAKE_OFF, moves=f"straight up to {HEIGHT_M:g} m")
def takes_off(flight: Flight) -> None:
    """A take-off has the state TAKING_OFF, climbs straight to its height and ends there in FLYING_AUTO."""
    flight.remember_position()
    with flight.recording() as recorded:
        task = flight.uav.take_off(HEIGHT_M)
        samples = recorded()
    info = task.info()
    require(info.kind is TaskKind.TAKE_OFF and info.status is TaskStatus.SUCCEEDED, f"the task is {info}")
    require(any(sample.state is State.TAKING_OFF for sample in samples), "TAKING_OFF was not seen")
    end = flight.wait_for_state(State.FLYING_AUTO)
    climbed = position(end) - flight.ground
    allowed_m = max(0.1, 0.05 * HEIGHT_M) + flight.tolerances.position_m
    require(abs(climbed.z - HEIGHT_M) <= allowed_m, f"it is {climbed.z:.2f} m up")
    require(climbed.horizontal_norm() <= 2 * flight.tolerances.position_m, "it did not climb straight")
    require(speed(end) <= 2 * flight.tolerances.speed_m_s, "it is not slow")
    highest_m = max(position(sample).z for sample in samples) - flight.ground.z
    require(highest_m <= CEILING_M, f"it climbed to {highest_m:.2f} m")


@check(State.LANDED_ARMED, capabilities=_TAKE_OFF, moves=f"straight up to {HEIGHT_M:g} m")
def a_take_off_is_not_aborted(flight: Flight) -> None:
    """During a take-off all other commands are refused, and the take-off goes on. Only a safety pilot can end it, or,
    where there is none, a cancel.
    """
    uav = flight.uav
    flight.remember_position()
    task = uav.take_off(HEIGHT_M, blocking=False)
    flight.wait_for_state(State.TAKING_OFF)
    ends = ((task.cancel, "cancelling a take-off"), (uav.abort, "aborting in a take-off"))
    flight.refuses_during(
        task,
        (
            *(ends if uav.info().has_safety_pilot else ()),
            (uav.pause, "pausing in a take-off"),
            (lambda: uav.land(blocking=False), "landing in a take-off"),
            (lambda: uav.go_to_waypoint(flight.start, blocking=False), "a waypoint in a take-off"),
            (lambda: uav.set_velocity(Twist()), "a velocity in a take-off"),
            (lambda: uav.take_off(HEIGHT_M, blocking=False), "another take-off"),
        ),
    )
    if not uav.info().has_safety_pilot:
        task.cancel()
        with suppress(TaskAbortedError):
            task.wait()
        return
    require(task.wait().status is TaskStatus.SUCCEEDED, "it did not go on")


def _require_names_state(error: WrongStateError, state: State) -> None:
    require(error.state == state.name, f"metadata says {error.state}, the state is {state.name}")
    require(state.name in error.message, f"the message does not name the state: {error.message}")


CHECKS = (
    arming_belongs_to_the_pilot,
    arms_and_disarms,
    takes_off_only_when_armed,
    flies_nothing_on_the_ground,
    bad_heights_are_refused,
    home_becomes_the_origin,
    bad_poses_from_outside_are_refused,
    takes_off,
    a_take_off_is_not_aborted,
)
