"""Draws the flown path and the wanted one. Needs matplotlib (the extra ``plot``), which is imported only for this."""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ual.errors import InvalidArgumentError
from ual.geometry import Vector3
from ual.shared import extras, whole_file
from ual.types import Telemetry

if TYPE_CHECKING:
    from ual import Uav

_ENDINGS = (".pdf", ".png", ".svg")
_WINDOW_SAMPLES_COUNT = 100
"""Two seconds at 50 Hz. A UAV is rarely further behind its reference, because the reference waits for it."""


@dataclass(frozen=True, slots=True)
class PlotPoint:
    """Position of the UAV and of its reference at one time; metres, in the frame of the telemetry."""

    time_s: float
    measured: Vector3
    wanted: Vector3


@contextmanager
def drawn(uav: Uav, file: Path | None) -> Iterator[None]:
    """Draws the flight during the block into a file, however the block ends. Does nothing without a file."""
    if file is None:
        yield
        return
    _require_drawing(file)
    points: list[PlotPoint] = []

    def keep(telemetry: Telemetry) -> None:
        if telemetry.pose is not None and telemetry.reference_pose is not None:
            points.append(PlotPoint(telemetry.stamp_s, telemetry.pose.position, telemetry.reference_pose.position))

    try:
        with uav.subscribe(keep):
            yield
    finally:
        if points:
            draw(points, file, f"{uav.ns}, {uav.info().autopilot or uav.info().backend}")


def _require_drawing(file: Path) -> None:
    """Refuses before the flight if the drawing could not be made after it."""
    if file.suffix.lower() not in _ENDINGS:
        raise click.BadParameter(f"{file} ends in none of {', '.join(_ENDINGS)}", param_hint="--plot")
    if not (os.access(file, os.W_OK) or (os.access(file.parent, os.W_OK | os.X_OK) and not file.exists())):
        raise click.BadParameter(f"{file} cannot be written", param_hint="--plot")
    with extras.needs("--plot", "ual-tools[plot]"):
        import matplotlib as mpl  # noqa: F401


def draw(points: Sequence[PlotPoint], file: Path, title: str) -> None:
    """Draws the path from above, its height, and its distance from the wanted path."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 5), layout="constrained")
    FigureCanvasAgg(figure)
    above, height, error = figure.subplot_mosaic([["above", "height"], ["above", "error"]]).values()
    times = [point.time_s - points[0].time_s for point in points]
    lines = (("wanted", [p.wanted for p in points], "--"), ("flown", [p.measured for p in points], "-"))
    for name, line, style in lines:
        above.plot([p.x for p in line], [p.y for p in line], style, label=name)
        height.plot(times, [p.z for p in line], style, label=name)
    errors = cross_track_m(points)
    error.plot(times, errors)
    above.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", title=title)
    above.legend()
    height.set(ylabel="z (m)")
    rms = math.sqrt(math.fsum(e * e for e in errors) / len(errors))
    error.set(xlabel="time (s)", ylabel="off the line (m)", title=f"widest {max(errors):.2f} m, rms {rms:.2f} m")
    for axes in (above, height, error):
        axes.grid(alpha=0.3)
    try:
        with whole_file.writing(file) as part:
            figure.savefig(part, dpi=120)
    except OSError as failure:
        raise InvalidArgumentError(f"cannot write {file}: {failure.strerror}", {"field": "plot"}) from None


def cross_track_m(points: Sequence[PlotPoint]) -> list[float]:
    """Returns how far each flown place is from the nearest part of the wanted line, at whatever time that was wanted.

    The nearest part moves along the line with time, so it is searched near the one before.
    """
    wanted = [point.wanted for point in points]
    result, near = [], 0
    for point in points:
        window = range(max(0, near - _WINDOW_SAMPLES_COUNT), min(len(wanted), near + _WINDOW_SAMPLES_COUNT + 1))
        near = min(window, key=lambda index: (wanted[index] - point.measured).norm())
        neighbours = wanted[max(0, near - 1) : near + 2]
        result.append(
            min(
                (_distance(point.measured, a, b) for a, b in itertools.pairwise(neighbours)),
                default=(wanted[near] - point.measured).norm(),
            )
        )
    return result


def _distance(p: Vector3, a: Vector3, b: Vector3) -> float:
    """Returns the distance from a point to a segment."""
    segment = b - a
    length2 = segment.dot(segment)
    share = 0.0 if length2 == 0.0 else min(1.0, max(0.0, (p - a).dot(segment) / length2))
    return (p - (a + segment * share)).norm()
