"""``ual waypoints`` saves poses of the UAV, and flies through them."""

from __future__ import annotations

import json
from pathlib import Path

import click

from ual.errors import InvalidArgumentError
from ual.geometry import Pose, PoseStamped
from ual.shared import whole_file
from ual.types import AltitudeReference
from ual_tools import complete, options, values
from ual_tools.app import UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.output import pose_json, pose_text
from ual_tools.path import PathOptions, fly_path
from ual_tools.session import CommandSession, pass_session


@click.group(
    "waypoints",
    cls=UalGroup,
    section=Section.FRAMES,
    examples=("ual waypoints save here.jsonl", "ual waypoints fly here.jsonl"),
)
def waypoints() -> None:
    """Save poses to a file and fly through them. The file has one JSON object a line."""


@waypoints.command("save", cls=UalCommand, examples=("ual waypoints save here.jsonl --frame map",))
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--frame",
    "frame_id",
    default="",
    help="The frame to save it in; that of the telemetry when not given.",
    shell_complete=complete.frames,
)
@pass_session
def save(session: CommandSession, file: Path, frame_id: str) -> None:
    """Append the present pose to FILE."""
    with session.connect() as uav:
        if frame_id:
            transform = uav.transform(frame_id)
            here = PoseStamped(Pose(transform.translation, transform.rotation), frame_id, transform.stamp_s)
        else:
            here = uav.pose()
    line = json.dumps(pose_json(here))
    try:
        before = file.read_bytes() if file.is_file() else b""
        whole_file.write(file, before + f"{line}\n".encode())
    except OSError as error:
        raise InvalidArgumentError(f"cannot write {file}: {error.strerror}", {"field": "file"}) from None
    session.emit_written(pose_json(here), f"{pose_text(here.pose)} in {here.frame_id} saved to {file}")


@waypoints.command("fly", cls=UalCommand, examples=("ual waypoints fly here.jsonl --max-speed 2 --dry-run",))
@click.argument("file", type=click.Path(path_type=Path))
@options.corner_radius
@options.max_speed
@options.altitude
@options.altitude_reference
@options.dry_run
@options.plot
@pass_session
def fly(
    session: CommandSession,
    file: Path,
    corner_radius_m: float,
    max_speed_m_s: float | None,
    altitude_m: float | None,
    altitude_reference: AltitudeReference | None,
    dry_run: bool,
    plot: Path | None,
) -> None:
    """Fly through the waypoints of FILE.

    FILE is as saved, or a .plan, .waypoints, .kml, .kmz, .gpx or .geojson. Ctrl-C cancels: the UAV holds its position.
    """
    how = PathOptions(corner_radius_m, max_speed_m_s, dry_run=dry_run, plot=plot)
    fly_path(session, values.read_route(file, "", altitude_m, altitude_reference), how)


COMMANDS = (waypoints,)
