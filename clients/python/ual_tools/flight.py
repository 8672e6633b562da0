"""Commands that fly."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import click

from ual.discovery import HOME
from ual.errors import UalError, UalTimeoutError
from ual.geometry import Pose, PoseStamped, Twist, TwistStamped, Vector3
from ual.interface import Uav
from ual.types import AltitudeReference, Limits, State
from ual_tools import manoeuvre, options, values
from ual_tools.app import Multi, command
from ual_tools.help import Section
from ual_tools.interruption import interruption
from ual_tools.session import CommandSession, note, pass_session

F = TypeVar("F", bound=Callable[..., Any])

_VELOCITY_PERIOD_S = 0.05
_LONGEST_STANDSTILL_S = 2.0
"""Seconds without a velocity, as by Ctrl-Z, after which none is sent any more. The daemon has stopped the UAV after
0.5 s, and others may fly it by then.
"""
_now_s = partial(time.clock_gettime, time.CLOCK_BOOTTIME) if hasattr(time, "CLOCK_BOOTTIME") else time.monotonic
"""Linux' other monotonic clock stands still while the computer sleeps."""
_TELEMETRY_WAIT_S, _POLL_PERIOD_S = 1.0, 0.02
"""Patience for the sample after a new home, and the pause between two looks."""
_SAME_HEIGHT_M = 0.5
"""An estimate of the ground wanders by as much."""
_GOES_ON = "goes on if it has begun: ual abort ends it only where there is no safety pilot"


@command("arm", "ual arm", multi=Multi.EACH)
@pass_session
def arm(session: CommandSession) -> None:
    """Arm the motors (where the daemon permits it)."""
    with session.connect() as uav, manoeuvre.already_done(session, "arm", [State.LANDED_ARMED]):
        uav.arm(timeout_s=session.timeout_s)
        session.emit({"done": "arm"}, "armed")


@command("disarm", "ual disarm", multi=Multi.EACH)
@pass_session
def disarm(session: CommandSession) -> None:
    """Disarm the motors (where the daemon permits it)."""
    with session.connect() as uav, manoeuvre.already_done(session, "disarm", [State.LANDED_DISARMED]):
        uav.disarm(timeout_s=session.timeout_s)
        session.emit({"done": "disarm"}, "disarmed")


def _force(help_text: str) -> Callable[[F], F]:
    return click.option("--force", is_flag=True, help=help_text)


@command("takeoff", "ual takeoff 3", multi=Multi.EACH)
@click.argument("height_m", type=values.number, metavar="HEIGHT")
@_force("Although a failsafe is active.")
@options.dry_run
@pass_session
def takeoff(session: CommandSession, height_m: float, force: bool, dry_run: bool) -> None:
    """Take off to HEIGHT metres above the ground it stands on.

    HEIGHT must not be above the ceiling of the daemon's configuration (ceiling_m, 120 m).
    """
    with session.connect() as uav:
        if dry_run:
            manoeuvre.print_plan(session, uav.dry_run.take_off(height_m, force=force))
            return
        manoeuvre.wait_for(
            session,
            uav,
            lambda: uav.take_off(height_m, force=force, timeout_s=session.timeout_s),
            interrupted=f"the take-off {_GOES_ON}",
        )


@command("land", "ual land", multi=Multi.REACHABLE)
@options.dry_run
@pass_session
def land(session: CommandSession, dry_run: bool) -> None:
    """Land where it is."""
    with session.connect() as uav, manoeuvre.standing_is_done(session, "land"):
        if dry_run:
            manoeuvre.print_plan(session, uav.dry_run.land())
            return
        manoeuvre.wait_for(
            session, uav, lambda: uav.land(timeout_s=session.timeout_s), interrupted=f"the landing {_GOES_ON}"
        )


@command(
    "goto", "ual goto 4 2 3 --yaw 90deg", "ual goto 1 0 0 --frame uav_1/base_link --max-speed 0.5", multi=Multi.EACH
)
@click.argument("x", type=values.number)
@click.argument("y", type=values.number)
@click.argument("z", type=values.number)
@options.yaw
@options.frame
@options.max_speed
@options.dry_run
@options.plot
@pass_session
def goto(
    session: CommandSession,
    x: float,
    y: float,
    z: float,
    yaw: float | None,
    frame_id: str,
    max_speed_m_s: float | None,
    dry_run: bool,
    plot: Path | None,
) -> None:
    """Fly straight to X Y Z (metres). Ctrl-C cancels: the UAV holds its position.

    In <ns>/odom, X is to the east, Y to the north and Z up, from its origin; `ual home` sets the origin. In
    <ns>/base_link, X is ahead, Y to the left and Z up, from the UAV. Z is up: a negative Z in <ns>/odom is below its
    origin.
    """
    goal = PoseStamped(Pose.at(x, y, z, yaw), frame_id)
    with session.connect() as uav:
        if dry_run:
            manoeuvre.print_plan(session, uav.dry_run.go_to_waypoint(goal, max_speed_m_s=max_speed_m_s))
            return
        manoeuvre.wait_for(
            session,
            uav,
            lambda: uav.go_to_waypoint(goal, max_speed_m_s=max_speed_m_s, timeout_s=session.timeout_s),
            plot,
        )


@command("goto-geo", "ual goto-geo 37.4122 -5.9984 20", "ual goto-geo 37.4122 -5.9984 120 --reference amsl")
@click.argument("latitude_deg", type=values.number, metavar="LAT")
@click.argument("longitude_deg", type=values.number, metavar="LON")
@click.argument("altitude_m", type=values.number, metavar="ALT")
@click.option(
    "--reference",
    type=click.Choice([reference.name.lower() for reference in AltitudeReference], case_sensitive=False),
    default=AltitudeReference.HOME.name.lower(),
    show_default=True,
    help="What the altitude is measured from.",
)
@options.yaw
@options.max_speed
@options.dry_run
@pass_session
def goto_geo(
    session: CommandSession,
    latitude_deg: float,
    longitude_deg: float,
    altitude_m: float,
    reference: str,
    yaw: float | None,
    max_speed_m_s: float | None,
    dry_run: bool,
) -> None:
    """Fly straight to LAT LON (degrees) at ALT (metres). Ctrl-C cancels: the UAV holds its position.

    LAT is positive to the north, LON to the east, ALT upwards.
    """
    where = (latitude_deg, longitude_deg, altitude_m, AltitudeReference[reference.upper()])
    with session.connect() as uav:
        if dry_run:
            plan = uav.dry_run.go_to_waypoint_geo(*where, yaw_rad=yaw, max_speed_m_s=max_speed_m_s)
            manoeuvre.print_plan(session, plan)
            return
        manoeuvre.wait_for(
            session,
            uav,
            lambda: uav.go_to_waypoint_geo(
                *where, yaw_rad=yaw, max_speed_m_s=max_speed_m_s, timeout_s=session.timeout_s
            ),
        )


@command("velocity", "ual velocity 1 0 0 --for 2", "ual velocity 0 0 0 --yaw-rate 30deg --for 3", multi=Multi.EACH)
@click.argument("vx", type=values.number)
@click.argument("vy", type=values.number)
@click.argument("vz", type=values.number)
@click.option(
    "--yaw-rate",
    "yaw_rate",
    type=values.angle,
    default="0",
    help="Yaw rate, counter-clockwise (to the left), for each second: 30deg, 0.5rad or 0.5.",
)
@click.option("--for", "duration_s", type=values.Number(min=0.0), required=True, help="For how many seconds.")
@options.frame
@options.dry_run
@pass_session
def velocity(
    session: CommandSession,
    vx: float,
    vy: float,
    vz: float,
    yaw_rate: float,
    duration_s: float,
    frame_id: str,
    dry_run: bool,
) -> None:
    """Fly with VX VY VZ (m/s) for a while, then stop. Ctrl-C stops at once.

    In <ns>/odom, VX is to the east, VY to the north and VZ up; in <ns>/base_link, VX is ahead, VY to the left and VZ
    up. A velocity beyond the UAV's limits is scaled down, its direction kept.
    """
    wanted = TwistStamped(Twist(Vector3(vx, vy, vz), Vector3(0.0, 0.0, yaw_rate)), frame_id)
    with session.connect() as uav:
        _note_scaling(uav, wanted.twist)
        if dry_run:
            manoeuvre.print_plan(session, uav.dry_run.set_velocity(wanted))
            return
        try:
            _repeat(session, uav, wanted, duration_s)
        except KeyboardInterrupt:
            _stop(uav)
            manoeuvre.interrupt("interrupted: the UAV stops")
        _stop(uav)
    session.emit({"done": "velocity", "duration_s": duration_s}, f"flew for {duration_s:g} s, stopped")


def _note_scaling(uav: Uav, wanted: Twist) -> None:
    """Notes what the daemon will scale down. Without an answer the velocity is flown all the same."""
    with contextlib.suppress(UalError):
        limits, yaw_rate_rad_s = uav.info().limits, wanted.angular.z
        excess = _excess(wanted.linear, limits)
        if excess > 1.0:
            v = wanted.linear / excess
            note(f"ual: beyond the UAV's limits (ual info): scaled down to {v.x:.2f} {v.y:.2f} {v.z:.2f} m/s")
        if math.isfinite(yaw_rate_rad_s) and abs(yaw_rate_rad_s) > limits.yaw_rate_rad_s:
            turns_rad_s = math.copysign(limits.yaw_rate_rad_s, yaw_rate_rad_s)
            note(f"ual: beyond the UAV's limits (ual info): turns at {turns_rad_s:.2f} rad/s")


def _excess(velocity: Vector3, limits: Limits) -> float:
    """Returns the velocity as a share of the limits."""
    vertical_m_s = limits.climb_speed_m_s if velocity.z > 0.0 else limits.descent_speed_m_s
    return max(velocity.horizontal_norm() / limits.horizontal_speed_m_s, abs(velocity.z) / vertical_m_s)


def _repeat(session: CommandSession, uav: Uav, wanted: TwistStamped, duration_s: float) -> None:
    sent_s = _now_s()
    end_s = sent_s + duration_s
    noted = interruption() if session.member is None else nullcontext(session.member.interrupted)
    with noted as interrupted:
        while (now_s := _now_s()) < end_s or now_s - sent_s > _LONGEST_STANDSTILL_S:
            if now_s - sent_s > _LONGEST_STANDSTILL_S:
                stood = f"velocity: this program stood still for {now_s - sent_s:.1f} s"
                raise UalTimeoutError(f"{stood}, so the UAV has stopped by itself: nothing more is sent")
            uav.set_velocity(wanted)
            sent_s = _now_s()
            if interrupted.wait(max(0.0, min(_VELOCITY_PERIOD_S, end_s - sent_s))):
                raise KeyboardInterrupt


def _stop(uav: Uav) -> None:
    """Stops by `abort`, which the daemon answers. It would not answer a last velocity, which is sent by a stream."""
    try:
        uav.abort()
    except UalError as error:
        raise type(error)(f"the UAV could not be stopped: {error.message}", error.metadata) from None


@command("pose", "ual pose 1 1 3", multi=Multi.EACH)
@click.argument("x", type=values.number)
@click.argument("y", type=values.number)
@click.argument("z", type=values.number)
@options.yaw
@options.frame
@options.dry_run
@pass_session
def pose(
    session: CommandSession, x: float, y: float, z: float, yaw: float | None, frame_id: str, dry_run: bool
) -> None:
    """Send X Y Z (metres) as the reference, without a trajectory.

    Returns at once. X, Y and Z are those of `ual goto`: in <ns>/odom east, north and up from its origin.
    """
    wanted = PoseStamped(Pose.at(x, y, z, yaw), frame_id)
    with session.connect() as uav:
        if dry_run:
            manoeuvre.print_plan(session, uav.dry_run.set_pose(wanted))
            return
        uav.set_pose(wanted)
    session.emit({"done": "pose"}, "reference set")


@command("recover", "ual recover", section=Section.TASKS, multi=Multi.EACH)
@_force("Although a failsafe is active or flies: ends its return or landing.")
@options.dry_run
@pass_session
def recover(session: CommandSession, force: bool, dry_run: bool) -> None:
    """Take control back from the safety pilot and hold the pose.

    On the ground, after others have flown, it moves nothing and allows a take-off again.
    """
    with session.connect() as uav:
        if dry_run:
            manoeuvre.print_plan(session, uav.dry_run.recover_from_manual(force=force))
            return
        uav.recover_from_manual(force=force, timeout_s=session.timeout_s)
    session.emit({"done": "recover"}, "recovered")


@command("home", "ual home --set-z", section=Section.FRAMES, multi=Multi.EACH)
@click.option("--set-z", is_flag=True, help="Set the height, too.")
@pass_session
def home(session: CommandSession, set_z: bool) -> None:
    """Make the present position the origin of <ns>/odom.

    Without --set-z, z counts from where it did before: it says how high the ground is in <ns>/odom.
    """
    with session.connect() as uav:
        uav.set_home(set_z)
        # That of now may have been made before home was written.
        why = _why_not_kept(uav, uav.telemetry().sequence)
        ground_m = uav.transform(odom := f"{uav.ns}/odom").translation.z
    height = "" if abs(ground_m) < _SAME_HEIGHT_M else f": {_home_height(ground_m, odom)}"
    session.emit({"done": "home", "ground_z_m": round(ground_m, 2), "is_saved": not why}, f"home set{height}")
    if why:
        session.tell(f"until the daemon ends: {why}")


def _why_not_kept(uav: Uav, sequence: int) -> str:
    """Returns why the daemon cannot save home, as a sample after that of a number tells; empty where it has."""
    end_s = time.monotonic() + _TELEMETRY_WAIT_S
    while (telemetry := uav.telemetry()).sequence == sequence and time.monotonic() < end_s:
        time.sleep(_POLL_PERIOD_S)
    checks = () if telemetry.health is None else telemetry.health.failing_checks
    return next((each for each in checks if each.startswith(f"daemon: {HOME} ")), "")


def _home_height(ground_m: float, odom: str) -> str:
    """Says what a z means where home has kept another height than that of the ground."""
    goal_m = 5.0
    return (
        f"the UAV stands at z = {ground_m:.1f} m in {odom}, so that a go-to to z = {goal_m:g} leads "
        f"{goal_m - ground_m:.1f} m above this ground; with --set-z the ground is z = 0"
    )


@command("abort", "ual abort", "ual abort --freeze", section=Section.TASKS, multi=Multi.REACHABLE)
@click.option("--freeze", is_flag=True, help="Hold the position it has now, instead of braking.")
@pass_session
def abort(session: CommandSession, freeze: bool) -> None:
    """Cancel the running task; the UAV stops and holds its position."""
    with session.connect() as uav, manoeuvre.standing_is_done(session, "abort"):
        uav.abort(freeze)
        session.emit({"done": "abort"}, "aborted")


COMMANDS = (arm, disarm, takeoff, land, goto, goto_geo, velocity, pose, recover, home, abort)
