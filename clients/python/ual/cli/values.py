"""Values as they are typed: angles, waypoints, vectors."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable
from pathlib import Path

import click

from ual.geometry import Pose, PoseStamped, Vector3


def angle(text: str) -> float:
    """``90deg``, ``1.57rad`` or ``1.57``, in radians."""
    try:
        return _angle(text)
    except ValueError:
        raise click.BadParameter(f"{text!r} is no angle: write 90deg, 1.57rad or 1.57") from None


def waypoint(text: str) -> Pose:
    """``X,Y,Z`` or ``X,Y,Z,YAW``."""
    try:
        return _waypoint(text)
    except ValueError:
        raise click.BadParameter(f"{text!r} is no waypoint: write X,Y,Z or X,Y,Z,YAW") from None


def vector(text: str) -> Vector3:
    """``X,Y,Z``."""
    try:
        x, y, z = map(float, text.split(","))
    except ValueError:
        raise click.BadParameter(f"{text!r} is no vector: write X,Y,Z") from None
    return Vector3(x, y, z)


def read_waypoints(file: Path, frame_id: str) -> list[PoseStamped]:
    """The waypoints of a file (``-``: standard input): JSON objects or ``X,Y,Z[,YAW]``, one a line.

    A line without a frame is in `frame_id`.
    """
    try:
        text = sys.stdin.read() if str(file) == "-" else file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise click.ClickException(f"cannot read {file}: {error}") from None
    return list(_parse(text.splitlines(), str(file), frame_id))


def _parse(lines: Iterable[str], name: str, frame_id: str) -> Iterable[PoseStamped]:
    for number, raw in enumerate(lines, start=1):
        line = raw.partition("#")[0].strip()
        if not line:
            continue
        try:
            yield _from_json(line, frame_id) if line.startswith("{") else PoseStamped(_waypoint(line), frame_id)
        except (ValueError, KeyError, TypeError, AttributeError):
            raise click.ClickException(
                f'{name}, line {number}: {line!r} is no waypoint: write X,Y,Z[,YAW] or {{"x": .., "y": .., "z": ..}}'
            ) from None


def _from_json(line: str, frame_id: str) -> PoseStamped:
    values = json.loads(line)
    yaw_rad = values.get("yaw_rad")
    pose = Pose.at(
        float(values["x"]), float(values["y"]), float(values["z"]), None if yaw_rad is None else float(yaw_rad)
    )
    return PoseStamped(pose, str(values.get("frame_id") or frame_id))


def _waypoint(text: str) -> Pose:
    x, y, z, *yaw = text.split(",")
    if len(yaw) > 1:
        raise ValueError("more than four numbers")
    return Pose.at(float(x), float(y), float(z), _angle(yaw[0]) if yaw else None)


def _angle(text: str) -> float:
    text = text.strip()
    if text.endswith("deg"):
        return math.radians(float(text.removesuffix("deg")))
    return float(text.removesuffix("rad"))
