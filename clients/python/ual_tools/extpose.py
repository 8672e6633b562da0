"""``ual extpose`` gives poses of a file as poses from outside, to try what a motion capture would do."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import click

from ual import routes
from ual.errors import InvalidArgumentError
from ual.geometry import KEEP_HEADING, Pose, PoseStamped, Quaternion, Vector3
from ual.shared.numbers import parse_number
from ual.shared.text import decoded, rows_of
from ual_tools import complete, values
from ual_tools.app import command
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session

_ORIENTED_FIELDS = 7


@command("extpose", "ual extpose --file poses.csv --rate 50", section=Section.AUTOPILOT)
@click.option(
    "--file",
    type=click.Path(path_type=Path),
    required=True,
    help="One pose a line: X,Y,Z,YAW or X,Y,Z,QX,QY,QZ,QW (-: standard input, as the lines come).",
)
@click.option("--rate", "rate_hz", type=values.number, default=50.0, show_default=True, help="Poses a second.")
@click.option(
    "--frame", "frame_id", default="map", show_default=True, help="Their frame.", shell_complete=complete.frames
)
@click.option("--std-dev", "std_dev_m", type=values.number, help="The standard deviation of their positions (m).")
@click.option("--repeat", is_flag=True, help="Begin again at the end of the file, until Ctrl-C.")
@pass_session
def extpose(
    session: CommandSession, file: Path, rate_hz: float, frame_id: str, std_dev_m: float | None, repeat: bool
) -> None:
    """Give the autopilot poses from outside, out of a file.

    That is what a motion capture or a camera would do, through `set_external_pose`. Ends with the file.
    """
    if not 0.0 < rate_hz <= 1000.0:
        raise InvalidArgumentError(f"rate: {rate_hz:g} is not above 0 and at most 1000", {"field": "rate"})
    sent_count = 0
    due_s = time.monotonic()
    with session.connect() as uav:
        for pose in _poses(file, repeat=repeat):
            uav.set_external_pose(PoseStamped(pose, frame_id), position_std_dev_m=std_dev_m)
            sent_count += 1
            due_s = max(due_s + 1.0 / rate_hz, time.monotonic() - 1.0 / rate_hz)
            threading.Event().wait(max(0.0, due_s - time.monotonic()))
    session.emit({"done": "extpose", "sent_count": sent_count}, f"{sent_count} poses given")


def _poses(file: Path, *, repeat: bool) -> Iterator[Pose]:
    if str(file) == "-":
        yield from _parsed((_text(line, "standard input") for line in sys.stdin.buffer), "standard input")
        return
    try:
        data = file.read_bytes()
    except OSError as error:
        raise InvalidArgumentError(f"cannot read {file}: {error.strerror}", {"field": "file"}) from None
    poses = list(_parsed(rows_of(_text(data, str(file))), str(file)))
    if not poses:
        raise InvalidArgumentError(f"{file} has no poses", {"field": "file"})
    yield from poses
    while repeat:
        yield from poses


def _text(data: bytes, name: str) -> str:
    try:
        return decoded(data)
    except ValueError as error:
        raise InvalidArgumentError(f"{name} {error}", {"field": "file"}) from None


def _parsed(lines: Iterable[str], name: str) -> Iterator[Pose]:
    for number, line in enumerate(lines, 1):
        text = line.partition("#")[0].strip()
        if text:
            try:
                yield parse_pose(text)
            except ValueError as error:
                raise InvalidArgumentError(
                    f"{name}, line {number}: {text!r} is neither X,Y,Z,YAW nor X,Y,Z,QX,QY,QZ,QW ({error})",
                    {"field": "file"},
                ) from None


def parse_pose(text: str) -> Pose:
    """Parses ``X,Y,Z,YAW`` or ``X,Y,Z,QX,QY,QZ,QW``. Raises `ValueError`."""
    parts = text.split(",")
    if len(parts) == _ORIENTED_FIELDS:
        x, y, z, *rotation = map(parse_number, parts)
        return Pose(Vector3(x, y, z), Quaternion(*rotation))
    pose = routes.parse_waypoint(text)
    if pose.orientation == KEEP_HEADING:
        raise ValueError("no orientation")
    return pose


COMMANDS = (extpose,)
