"""``ual waypoints``: save where the UAV is, and fly there again."""

from __future__ import annotations

import json
from pathlib import Path

import click

from ual.cli import values
from ual.cli.app import Session, UalCommand, UalGroup, pass_session
from ual.cli.flight import fly_path
from ual.cli.output import pose_json, pose_text
from ual.geometry import Pose, PoseStamped


@click.group("waypoints", cls=UalGroup)
def waypoints() -> None:
    """Save poses to a file and fly through them. The file has one JSON object a line."""


@waypoints.command("save", cls=UalCommand)
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option("--frame", "frame_id", default="", help="Save it in this frame; in that of the telemetry when not given.")
@pass_session
def save(session: Session, file: Path, frame_id: str) -> None:
    """Append the present pose to FILE."""
    with session.connect() as uav:
        if frame_id:
            transform = uav.transform(frame_id)
            here = PoseStamped(Pose(transform.translation, transform.rotation), frame_id, transform.stamp_s)
        else:
            here = uav.pose()
    line = json.dumps(pose_json(here))
    try:
        with file.open("a", encoding="utf-8") as opened:
            opened.write(line + "\n")
    except OSError as error:
        raise click.ClickException(f"cannot write {file}: {error.strerror}") from None
    session.emit(pose_json(here), f"{pose_text(here.pose)} in {here.frame_id} saved to {file}")


@waypoints.command("fly", cls=UalCommand)
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--corner-radius", "corner_radius_m", type=float, default=0.0, show_default=True, help="Round the corners."
)
@pass_session
def fly(session: Session, file: Path, corner_radius_m: float) -> None:
    """Fly through the waypoints of FILE. Ctrl-C cancels: the UAV holds its position."""
    fly_path(session, values.read_waypoints(file, ""), corner_radius_m)


COMMANDS = (waypoints,)
