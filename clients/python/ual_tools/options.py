"""Options that several commands have."""

from __future__ import annotations

from pathlib import Path

import click

from ual_tools import complete, values

yaw = click.option(
    "--yaw",
    type=values.heading,
    help="Heading, counter-clockwise from x (0 is east, 90deg north): 90deg, 1.57rad or 1.57. Kept when not given.",
)
frame = click.option(
    "--frame",
    "frame_id",
    default="",
    help="The frame of the coordinates; <ns>/odom when not given.",
    shell_complete=complete.frames,
)
max_speed = click.option(
    "--max-speed",
    "max_speed_m_s",
    type=values.number,
    metavar="M_S",
    help="The highest speed in any direction (m/s); the UAV's limits when not given.",
)
corner_radius = click.option(
    "--corner-radius",
    "corner_radius_m",
    type=values.number,
    default=0.0,
    show_default=True,
    help="Round each corner within this distance (m); 0 stops at each.",
)
altitude = click.option(
    "--altitude",
    "altitude_m",
    type=values.number,
    metavar="M",
    help="Fly all of a KML, KMZ, GPX or GeoJSON file at this altitude above home.",
)
altitude_reference = click.option(
    "--reference",
    "altitude_reference",
    type=values.altitude_reference,
    metavar="home|amsl|ellipsoid",
    help="What the altitudes of a GPX or GeoJSON file count from.",
)
plot = click.option(
    "--plot",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Draw the flown path and the wanted one (.png, .svg, .pdf); needs ual-tools[plot].",
)
dry_run = click.option("--dry-run", is_flag=True, help="Only print what would happen; nothing moves.")
