"""The chart of a page: what UAVs did over the last minute."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import viser
from numpy.typing import NDArray
from viser import uplot

from ual_tools.view.palette import Colour, css
from ual_tools.view.track import CHART_S, ChartSample, Track

_DRAW_PERIOD_S = 0.5
_MOST_UAVS = 10
_HEIGHT_PX = 240
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
    """The chart: of one UAV height, speed and distance to the reference; of several the height of each.

    It is drawn twice a second.
    """

    def __init__(self, gui: viser.GuiApi, tab: viser.GuiTabHandle) -> None:
        self._gui = gui
        self._tab = tab
        self._drawn_s = 0.0
        self._shown: tuple[str, ...] = ()
        self._limits = limits(columns([]))
        self._handle = self._made(_SERIES, columns([]))

    def update(self, tracks: Mapping[str, Track], marks: Mapping[str, Colour], now_s: float) -> None:
        """Shows the last minute of some UAVs, of the first ones where they are many."""
        if now_s - self._drawn_s < _DRAW_PERIOD_S and tuple(tracks) == self._shown:
            return
        self._drawn_s = now_s
        if len(tracks) <= 1:
            samples = [each for track in tracks.values() for each in track.chart(now_s)]
            self._draw(tuple(tracks), _SERIES, columns(samples))
            return
        names = tuple(tracks)[:_MOST_UAVS]
        series = (_SERIES[0], *(_series(f"{ns} (m)", css(marks[ns])) for ns in names))
        self._draw(tuple(tracks), series, heights([tracks[ns].chart(now_s) for ns in names]))

    def _draw(self, shown: tuple[str, ...], series: tuple[uplot.Series, ...], data: Columns) -> None:
        if shown != self._shown:
            self._handle.remove()
            self._limits = limits(data)
            self._handle = self._made(series, data)
            self._shown = shown
            return
        new = limits(data)
        if new != self._limits:
            self._limits = new
            self._handle.scales = _scales(new)
        self._handle.data = data

    def _made(self, series: tuple[uplot.Series, ...], data: Columns) -> viser.GuiUplotHandle:
        """Returns a new one: it has other lines."""
        with self._tab:
            return self._gui.add_uplot(
                data,
                series,
                scales=_scales(self._limits),
                legend=uplot.Legend(show=True),
                padding=(10, 24, 0, 0),
                height=_HEIGHT_PX,
            )


def heights(samples: Sequence[Sequence[ChartSample]]) -> Columns:
    """Returns the columns of a chart with the heights of several UAVs."""
    times = sorted({-CHART_S, 0.0, *(each.time_s for of_one in samples for each in of_one)})
    found = [{each.time_s: each.height_m for each in of_one} for of_one in samples]
    lines = [np.array([of_one.get(time_s, np.nan) for time_s in times], np.float64) for of_one in found]
    return np.array(times, np.float64), *lines


def columns(samples: list[ChartSample]) -> Columns:
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
