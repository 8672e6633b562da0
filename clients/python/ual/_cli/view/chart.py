"""The chart of a page: height, speed and distance to the reference over the last minute."""

from __future__ import annotations

import math

import numpy as np
import viser
from numpy.typing import NDArray
from viser import uplot

from ual._cli.view.track import CHART_S, Sample, Track

_EVERY_S = 0.5
_STEPS = (1.0, 2.0, 5.0)
Columns = tuple[NDArray[np.float64], ...]
Range = tuple[float, float]


def _series(label: str, colour: str) -> uplot.Series:
    """Returns a series of points, not of a line: viser's uPlot would draw a line across what is not known."""
    points = uplot.Series_Points(show=True, size=3, width=0, fill=colour)
    # A width of 0 would take the colour out of the legend.
    return uplot.Series(label=label, stroke=colour, width=0.001, points=points)


_SERIES = (
    uplot.Series(label="s"),
    _series("height (m)", "#1f77b4"),
    _series("speed (m/s)", "#2ca02c"),
    _series("off reference (m)", "#d62728"),
)


class Chart:
    """The chart. It is drawn twice a second, and not at all while no single UAV is looked at."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._drawn_s = 0.0
        self._limits = limits(columns([]))
        self._handle = gui.add_uplot(
            columns([]),
            _SERIES,
            scales=_scales(self._limits),
            legend=uplot.Legend(show=True),
            padding=(10, 24, 0, 0),
            height=200,
            visible=False,
        )

    def update(self, track: Track | None, now_s: float) -> None:
        """Shows the last minute of a UAV, or nothing."""
        if self._handle.visible != (track is not None):
            self._handle.visible = track is not None
        if track is not None and now_s - self._drawn_s >= _EVERY_S:
            self._drawn_s = now_s
            self._draw(columns(track.chart(now_s)))

    def _draw(self, data: Columns) -> None:
        new = limits(data)
        if new != self._limits:
            self._limits = new
            self._handle.scales = _scales(new)
        self._handle.data = data


def columns(samples: list[Sample]) -> Columns:
    """Returns the columns of the chart. It always has two ends, so that it has an axis without samples, too."""
    rows = [(each.time_s, each.height_m, each.speed_m_s, each.off_reference_m) for each in samples]
    table = np.array([(-CHART_S, *[np.nan] * 3), *rows, (0.0, *[np.nan] * 3)], np.float64)
    return tuple(np.ascontiguousarray(column) for column in table.T)


def limits(data: Columns) -> Range:
    """Returns the range of the values, to steps of 1, 2 and 5, so that it seldom changes.

    uPlot would find its own one, but not with values that are not numbers.
    """
    values = np.concatenate(data[1:])
    known = values[np.isfinite(values)]
    lowest, highest = float(np.min(known, initial=0.0)), float(np.max(known, initial=1.0))
    return -_round_up(-lowest), _round_up(highest)


def _round_up(value: float) -> float:
    """Returns the next of 1, 2, 5, 10, 20, ...; 0 for 0."""
    if value <= 0.0:
        return 0.0
    power = 10.0 ** math.floor(math.log10(value))
    return next((step * power for step in _STEPS if value <= step * power), 10.0 * power)


def _scales(values: Range) -> dict[str, uplot.Scale]:
    return {
        "x": uplot.Scale(time=False, auto=False, range=(-CHART_S, 0.0)),
        "y": uplot.Scale(auto=False, range=values),
    }
