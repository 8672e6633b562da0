"""Options that several commands have."""

from __future__ import annotations

from pathlib import Path

import click

from ual._cli import values

yaw = click.option("--yaw", type=values.angle, help="Heading: 90deg, 1.57rad or 1.57. Kept when not given.")
frame = click.option("--frame", "frame_id", default="", help="The frame of the coordinates; <ns>/odom when not given.")
max_speed = click.option(
    "--max-speed",
    "max_speed_m_s",
    type=float,
    metavar="M_S",
    help="At most so fast (m/s), in any direction; only the UAV's limits when not given.",
)
corner_radius = click.option(
    "--corner-radius",
    "corner_radius_m",
    type=float,
    default=0.0,
    show_default=True,
    help="Round the corners within so many metres; 0 stops at each.",
)
altitude = click.option(
    "--altitude",
    "altitude_m",
    type=float,
    metavar="M",
    help="How high above home to fly a .kml line that lies on the ground.",
)
plot = click.option(
    "--plot",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Draw the flown line against the wanted one (.png, .svg, .pdf); needs ual-client[plot].",
)
dry_run = click.option("--dry-run", is_flag=True, help="Only say what would happen; nothing moves.")
