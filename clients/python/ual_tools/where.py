"""Commands that tell where the UAV may fly, and which way it flies."""

from __future__ import annotations

from itertools import pairwise

import click

from ual.geometry import Vector3
from ual_tools.app import command
from ual_tools.help import Section
from ual_tools.output import vector_text
from ual_tools.session import CommandSession, pass_session
from ual_tools.tables import print_table


@command("geofence", "ual geofence", "ual --json geofence", section=Section.FRAMES)
@pass_session
def geofence(session: CommandSession) -> None:
    """Print where the UAV may fly: inside all of these at once.

    They are those of the configuration, the floor and the ceiling, and the limits of the autopilot's own fence around
    its home. Polygons and circles of that fence are refused, too, but not printed.
    """
    with session.connect() as uav:
        found = uav.geofence()
    if session.as_json:
        session.emit(found)
        return
    circle = found.circle
    rows = [
        ("in frame", found.frame_id),
        ("at least at", _height(found.min_z_m)),
        ("at most at", _height(found.max_z_m)),
        ("circle", "none" if circle is None else f"{circle.radius_m:.2f} m around {_flat(circle.center)}"),
    ]
    rows += [("corner", _flat(corner)) for corner in found.corners] or [("polygon", "none")]
    print_table(("", ""), rows)


@command("route", "ual route", "ual --json route", section=Section.TASKS)
@pass_session
def route(session: CommandSession) -> None:
    """Print the way that the UAV flies, as points."""
    with session.connect() as uav:
        found = uav.route()
    if session.as_json:
        session.emit({"route": found})
        return
    if found is None:
        click.echo("nothing is flown whose way is known")
        return
    length_m = sum((b - a).norm() for a, b in pairwise(found.points))
    moving = "; its goal moves" if found.is_goal_moving else ""
    click.echo(f"{found.task_id or 'a reference'}: {length_m:.2f} m, in {found.frame_id}{moving}")
    for point in found.points:
        click.echo(f"  {vector_text(point)}")


def _height(z_m: float | None) -> str:
    return "any height" if z_m is None else f"z = {z_m:.2f} m"


def _flat(position: Vector3) -> str:
    return f"{position.x:.2f} {position.y:.2f}"


COMMANDS = (geofence, route)
