"""Parses values of the command line: angles, waypoints, vectors."""

from __future__ import annotations

import math
import re
import sys
from pathlib import Path
from typing import Any

import click
from typing_extensions import override

from ual import routes
from ual.errors import InvalidArgumentError
from ual.geometry import Pose, Vector3, wrap_angle
from ual.routes import Route, RouteError
from ual.shared.numbers import parse_number
from ual.types import AltitudeReference, PathHeading

_WORDS = {word: float(word) for word in ("inf", "-inf", "nan")}
"""Numbers that a command hands on as they are: the daemon says whether it takes them."""


class Number(click.FloatRange):
    """A number within a range. Refuses "nan", which click accepts for any range."""

    @override
    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        converted: float = super().convert(number(value), param, ctx)
        if math.isnan(converted):
            self.fail(f"{value!r} is not a number.", param, ctx)
        return converted


class Whole(click.IntRange):
    """A whole number within a range, in decimal digits. `int` also reads ``80_80``, and digits of other scripts."""

    @override
    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        if not re.fullmatch("[-+]?[0-9]+", str(value)):
            self.fail(f"{value!r} is not a whole number.", param, ctx)
        converted: int = super().convert(value, param, ctx)
        return converted


def number(value: str | float) -> float:
    """Parses a number without a unit. The daemon says which ones it takes."""
    text = str(value)
    try:
        return _WORDS[text] if text in _WORDS else parse_number(text)
    except ValueError:
        raise click.BadParameter(f"{text!r} is not a number{_how_to_write(text)}.") from None


def _how_to_write(word: str) -> str:
    """Returns what may have been meant: a number with its unit, or several numbers."""
    if re.fullmatch(r"[-+]?[\d.]+ ?[^\W\d][\w/²]*", word):
        return ": write it without a unit"
    return ": write spaces between numbers" if "," in word else ""


def angle(text: str) -> float:
    """Parses ``90deg``, ``1.57rad`` or ``1.57``; returns radians. Refuses ``90``, which is more than a full turn."""
    try:
        return _WORDS[text] if text in _WORDS else routes.parse_angle(text)
    except routes.BareAngleError as error:
        raise click.BadParameter(str(error)) from None
    except ValueError:
        raise click.BadParameter(f"{text!r} is not an angle: write 90deg, 1.57rad or 1.57") from None


def heading(text: str) -> float:
    """Parses an angle; with a unit it may be more than a full turn. Returns radians, -pi to pi."""
    angle_rad = angle(text)
    return wrap_angle(angle_rad) if math.isfinite(angle_rad) else angle_rad


def waypoint(text: str) -> Pose:
    """Parses ``X,Y,Z`` or ``X,Y,Z,YAW``."""
    try:
        return routes.parse_waypoint(text)
    except routes.BareAngleError as error:
        raise click.BadParameter(str(error)) from None
    except ValueError:
        raise click.BadParameter(f"{text!r} is not a waypoint: write X,Y,Z or X,Y,Z,YAW") from None


def vector(text: str) -> Vector3:
    """Parses ``X,Y,Z``."""
    try:
        x, y, z = map(parse_number, text.split(","))
    except ValueError:
        raise click.BadParameter(f"{text!r} is not a vector: write X,Y,Z") from None
    return Vector3(x, y, z)


def numbers(text: str) -> list[float]:
    """Parses ``A,B,...``; the text may be empty."""
    try:
        return [parse_number(each) for each in text.split(",")] if text else []
    except ValueError:
        raise click.BadParameter(f"{text!r} is not a list of numbers: write A,B,...") from None


def path_heading(text: str) -> PathHeading | Vector3:
    """Parses ``waypoints``, ``fixed``, ``along-path``, or the point to point at as ``X,Y,Z``."""
    known = {"waypoints": PathHeading.WAYPOINTS, "fixed": PathHeading.FIXED, "along-path": PathHeading.ALONG_PATH}
    if text in known:
        return known[text]
    try:
        return vector(text)
    except click.BadParameter:
        raise click.BadParameter(f"{text!r} is neither {', '.join(known)} nor X,Y,Z") from None


def altitude_reference(text: str) -> AltitudeReference:
    """Parses ``home``, ``amsl`` or ``ellipsoid``."""
    try:
        return AltitudeReference[text.upper()]
    except KeyError:
        known = ", ".join(reference.name.lower() for reference in AltitudeReference)
        raise click.BadParameter(f"{text!r} is none of {known}") from None


def read_route(
    file: Path,
    frame_id: str = "",
    altitude_m: float | None = None,
    reference: AltitudeReference | None = None,
) -> Route:
    """Reads the route of a file (``-``: standard input); see `ual.routes.read`."""
    try:
        if str(file) != "-":
            return routes.read(file, frame_id=frame_id, altitude_m=altitude_m, altitude_reference=reference)
        data = sys.stdin.buffer.read(routes.MOST_BYTES + 1)
        return routes.parse(
            data, "standard input", frame_id=frame_id, altitude_m=altitude_m, altitude_reference=reference
        )
    except RouteError as error:
        raise InvalidArgumentError(str(error), {"field": "file"}) from None
