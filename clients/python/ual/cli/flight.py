"""Commands that fly."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import click

from ual.cli import progress, values
from ual.cli.app import INTERRUPTED, Session, command, note, pass_session
from ual.cli.output import task_text
from ual.geometry import Pose, PoseStamped, Twist, TwistStamped, Vector3
from ual.interface import Task, Uav
from ual.types import AltitudeReference

_VELOCITY_PERIOD_S = 0.05

_yaw = click.option("--yaw", type=values.angle, help="Heading: 90deg, 1.57rad or 1.57. Kept when not given.")
_frame = click.option("--frame", "frame_id", default="", help="The frame of the coordinates; <ns>/odom when not given.")
_corner_radius = click.option(
    "--corner-radius",
    "corner_radius_m",
    type=float,
    default=0.0,
    show_default=True,
    help="Round the corners within so many metres; 0 stops at each.",
)


@command("arm")
@pass_session
def arm(session: Session) -> None:
    """Arm the motors (where the daemon permits it)."""
    with session.connect() as uav:
        uav.arm(timeout_s=session.timeout_s)
    session.emit({"done": "arm"}, "armed")


@command("disarm")
@pass_session
def disarm(session: Session) -> None:
    """Disarm the motors (where the daemon permits it)."""
    with session.connect() as uav:
        uav.disarm(timeout_s=session.timeout_s)
    session.emit({"done": "disarm"}, "disarmed")


@command("takeoff")
@click.argument("height_m", type=float, metavar="HEIGHT")
@pass_session
def takeoff(session: Session, height_m: float) -> None:
    """Take off to HEIGHT metres above the ground it stands on."""
    with session.connect() as uav:
        try:
            with progress.shown(uav):
                task = uav.take_off(height_m, timeout_s=session.timeout_s)
        except KeyboardInterrupt:
            _interrupted("the take-off goes on: only the safety pilot can abort it")
        _end(session, task)


@command("land")
@pass_session
def land(session: Session) -> None:
    """Land where it is."""
    with session.connect() as uav:
        try:
            with progress.shown(uav):
                task = uav.land(timeout_s=session.timeout_s)
        except KeyboardInterrupt:
            _interrupted("the landing goes on: only the safety pilot can abort it")
        _end(session, task)


@command("goto")
@click.argument("x", type=float)
@click.argument("y", type=float)
@click.argument("z", type=float)
@_yaw
@_frame
@pass_session
def goto(session: Session, x: float, y: float, z: float, yaw: float | None, frame_id: str) -> None:
    """Fly straight to X Y Z (metres). Ctrl-C cancels: the UAV holds its position."""
    with session.connect() as uav:
        try:
            with progress.shown(uav):
                task = uav.go_to_waypoint(PoseStamped(Pose.at(x, y, z, yaw), frame_id), timeout_s=session.timeout_s)
        except KeyboardInterrupt:
            _cancelled()
        _end(session, task)


@command("goto-geo")
@click.argument("latitude_deg", type=float, metavar="LAT")
@click.argument("longitude_deg", type=float, metavar="LON")
@click.argument("altitude_m", type=float, metavar="ALT")
@click.option(
    "--reference",
    type=click.Choice([reference.name.lower() for reference in AltitudeReference]),
    default=AltitudeReference.HOME.name.lower(),
    show_default=True,
    help="What the altitude is measured from.",
)
@_yaw
@pass_session
def goto_geo(
    session: Session,
    latitude_deg: float,
    longitude_deg: float,
    altitude_m: float,
    reference: str,
    yaw: float | None,
) -> None:
    """Fly straight to LAT LON (degrees) at ALT (metres). Ctrl-C cancels: the UAV holds its position."""
    with session.connect() as uav:
        try:
            with progress.shown(uav):
                task = uav.go_to_waypoint_geo(
                    latitude_deg,
                    longitude_deg,
                    altitude_m,
                    AltitudeReference[reference.upper()],
                    yaw_rad=yaw,
                    timeout_s=session.timeout_s,
                )
        except KeyboardInterrupt:
            _cancelled()
        _end(session, task)


@command("path")
@click.argument("waypoints", type=values.waypoint, nargs=-1, metavar="X,Y,Z[,YAW] ...")
@click.option("--file", type=click.Path(path_type=Path), help="Read the waypoints from a file (-: standard input).")
@_corner_radius
@_frame
@pass_session
def path(
    session: Session, waypoints: tuple[Pose, ...], file: Path | None, corner_radius_m: float, frame_id: str
) -> None:
    """Fly through waypoints, each X,Y,Z or X,Y,Z,YAW. Ctrl-C cancels: the UAV holds its position."""
    if bool(waypoints) is (file is not None):
        raise click.UsageError("give waypoints, or --file with some")
    poses = [PoseStamped(each, frame_id) for each in waypoints]
    if file is not None:
        poses = values.read_waypoints(file, frame_id)
    fly_path(session, poses, corner_radius_m)


def fly_path(session: Session, waypoints: list[PoseStamped], corner_radius_m: float) -> None:
    """Flies through waypoints and prints how that ended."""
    with session.connect() as uav:
        try:
            with progress.shown(uav):
                task = uav.follow_path(waypoints, corner_radius_m=corner_radius_m, timeout_s=session.timeout_s)
        except KeyboardInterrupt:
            _cancelled()
        _end(session, task)


@command("velocity")
@click.argument("vx", type=float)
@click.argument("vy", type=float)
@click.argument("vz", type=float)
@click.option("--yaw-rate", "yaw_rate", type=values.angle, default="0", help="Turn to the left, per second.")
@click.option("--for", "duration_s", type=click.FloatRange(min=0.0), required=True, help="For how many seconds.")
@_frame
@pass_session
def velocity(
    session: Session, vx: float, vy: float, vz: float, yaw_rate: float, duration_s: float, frame_id: str
) -> None:
    """Fly with VX VY VZ (m/s) for a while, then stop. Ctrl-C stops at once."""
    wanted = TwistStamped(Twist(Vector3(vx, vy, vz), Vector3(0.0, 0.0, yaw_rate)), frame_id)
    with session.connect() as uav:
        try:
            _repeat(uav, wanted, duration_s)
        except KeyboardInterrupt:
            uav.set_velocity(Twist())
            _interrupted("interrupted: the UAV stops")
        uav.set_velocity(Twist())
    session.emit({"done": "velocity", "duration_s": duration_s}, f"flew for {duration_s:g} s, stopped")


def _repeat(uav: Uav, wanted: TwistStamped, duration_s: float) -> None:
    end_s = time.monotonic() + duration_s
    pause = threading.Event()
    while time.monotonic() < end_s:
        uav.set_velocity(wanted)
        pause.wait(max(0.0, min(_VELOCITY_PERIOD_S, end_s - time.monotonic())))


@command("pose")
@click.argument("x", type=float)
@click.argument("y", type=float)
@click.argument("z", type=float)
@_yaw
@_frame
@pass_session
def pose(session: Session, x: float, y: float, z: float, yaw: float | None, frame_id: str) -> None:
    """Give the autopilot X Y Z (metres) as its reference, without a trajectory; returns at once."""
    with session.connect() as uav:
        uav.set_pose(PoseStamped(Pose.at(x, y, z, yaw), frame_id))
    session.emit({"done": "pose"}, "reference set")


@command("recover")
@pass_session
def recover(session: Session) -> None:
    """Take control back from the safety pilot and hold the pose it has."""
    with session.connect() as uav:
        uav.recover_from_manual(timeout_s=session.timeout_s)
    session.emit({"done": "recover"}, "recovered")


@command("home")
@click.option("--set-z", is_flag=True, help="The height, too.")
@pass_session
def home(session: Session, set_z: bool) -> None:
    """Make the present position the origin of <ns>/odom."""
    with session.connect() as uav:
        uav.set_home(set_z)
    session.emit({"done": "home"}, "home set")


@command("abort")
@click.option("--freeze", is_flag=True, help="Hold the position it has now, instead of braking.")
@pass_session
def abort(session: Session, freeze: bool) -> None:
    """Cancel what the UAV does; it stops and holds."""
    with session.connect() as uav:
        uav.abort(freeze)
    session.emit({"done": "abort"}, "aborted")


def _end(session: Session, task: Task) -> None:
    info = task.info()
    session.emit(info, task_text(info))


def _cancelled() -> None:
    _interrupted("cancelled: the UAV holds its position")


def _interrupted(text: str) -> None:
    note(f"ual: {text}")
    raise click.exceptions.Exit(INTERRUPTED)


COMMANDS = (arm, disarm, takeoff, land, goto, goto_geo, path, velocity, pose, recover, home, abort)
