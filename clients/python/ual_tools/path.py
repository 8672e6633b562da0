"""``ual path`` flies through waypoints; ``ual waypoints fly`` uses the same functions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

import click

from ual.geometry import PointStamped, Pose, PoseStamped, Vector3
from ual.routes import Route
from ual.types import AltitudeReference, PathHeading
from ual_tools import manoeuvre, options, values
from ual_tools.app import command
from ual_tools.session import CommandSession, note, pass_session


class PathArguments(TypedDict):
    """The arguments that `follow_path` and its dry run share."""

    corner_radius_m: float
    max_speed_m_s: float | None
    leg_speeds_m_s: Sequence[float]
    heading: PathHeading
    point_of_interest: PointStamped | None
    holds_s: Sequence[float]


@dataclass(frozen=True)
class PathOptions:
    """Options of a path; see `ual.interface.Uav.follow_path`."""

    corner_radius_m: float = 0.0
    max_speed_m_s: float | None = None
    leg_speeds_m_s: Sequence[float] = ()
    heading: PathHeading = PathHeading.WAYPOINTS
    point_of_interest: PointStamped | None = None
    dry_run: bool = False
    plot: Path | None = None
    holds_s: Sequence[float] = ()

    def arguments(self, route: Route) -> PathArguments:
        """Returns the arguments of `follow_path`, which its dry run has, too."""
        return {
            "corner_radius_m": self.corner_radius_m,
            "max_speed_m_s": self.max_speed_m_s,
            "leg_speeds_m_s": self.leg_speeds_m_s or route.leg_speeds_m_s,
            "heading": self.heading,
            "point_of_interest": self.point_of_interest,
            "holds_s": self.holds_s or route.holds_s,
        }


@command("path", "ual path 10,0,5 10,10,5 0,10,5 --corner-radius 2", "ual path --file mission.plan --dry-run")
@click.argument("waypoints", type=values.waypoint, nargs=-1, metavar="X,Y,Z[,YAW] ...")
@click.option(
    "--file",
    type=click.Path(path_type=Path),
    help="Read the waypoints from a file: .plan, .waypoints, .kml, .kmz, .gpx, .geojson, or waypoints a line (-: "
    "standard input).",
)
@options.altitude
@options.altitude_reference
@options.corner_radius
@options.max_speed
@click.option(
    "--speeds",
    "leg_speeds_m_s",
    type=values.numbers,
    default="",
    metavar="M_S,M_S,...",
    help="The highest speed (m/s) on the leg to each waypoint; 0: as --max-speed says.",
)
@click.option(
    "--holds",
    "holds_s",
    type=values.numbers,
    default="",
    metavar="S,S,...",
    help="How long to stop and hold at each waypoint (s); 0: no stop for that.",
)
@click.option(
    "--heading",
    type=values.path_heading,
    default="waypoints",
    show_default=True,
    metavar="waypoints|fixed|along-path|X,Y,Z",
    help="Where the nose points: as the waypoints say, as now, along the path, or at X,Y,Z.",
)
@options.frame
@options.dry_run
@options.plot
@pass_session
def path(
    session: CommandSession,
    waypoints: tuple[Pose, ...],
    file: Path | None,
    altitude_m: float | None,
    altitude_reference: AltitudeReference | None,
    corner_radius_m: float,
    max_speed_m_s: float | None,
    leg_speeds_m_s: list[float],
    holds_s: list[float],
    heading: PathHeading | Vector3,
    frame_id: str,
    dry_run: bool,
    plot: Path | None,
) -> None:
    """Fly through waypoints, X,Y,Z or X,Y,Z,YAW, or those of a file.

    Ctrl-C cancels: the UAV holds its position.

    X, Y and Z are metres, in <ns>/odom east, north and up from its origin. YAW is the heading there, counter-clockwise
    from x (0 is east, 90deg north): 90deg, 1.57rad or 1.57.
    """
    if bool(waypoints) is (file is not None):
        raise click.UsageError("give either waypoints or --file")
    route = Route([PoseStamped(each, frame_id) for each in waypoints])
    if file is not None:
        route = values.read_route(file, frame_id, altitude_m, altitude_reference)
    elif altitude_m is not None or altitude_reference is not None:
        raise click.UsageError("--altitude and --reference are for a --file")
    if isinstance(heading, Vector3):
        kind, point = PathHeading.POINT_OF_INTEREST, PointStamped(heading, frame_id)
    else:
        kind, point = heading, None
    how = PathOptions(corner_radius_m, max_speed_m_s, leg_speeds_m_s, kind, point, dry_run, plot, holds_s)
    fly_path(session, route, how)


def fly_path(session: CommandSession, route: Route, how: PathOptions) -> None:
    """Flies through the waypoints of a route and prints how it ended."""
    for each in route.left_out:
        note(f"ual: not flown: {each}")
    path = how.arguments(route)
    with session.connect() as uav:
        if how.dry_run:
            manoeuvre.print_plan(session, uav.dry_run.follow_path(route.waypoints, **path))
            return
        manoeuvre.wait_for(
            session,
            uav,
            lambda: uav.follow_path(route.waypoints, **path, timeout_s=session.timeout_s),
            how.plot,
        )


COMMANDS = (path,)
