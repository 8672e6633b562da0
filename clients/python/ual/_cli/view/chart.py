"""The chart of a page: height, speed and distance to the reference over the last minute."""

from __future__ import annotations

import numpy as np
import viser
from numpy.typing import NDArray
from viser import uplot

from ual._cli.view.track import CHART_S, Sample, Track

_EVERY_S = 0.5
_SERIES = (
    uplot.Series(label="s"),
    uplot.Series(label="height (m)", stroke="#1f77b4", width=2, spanGaps=False),
    uplot.Series(label="speed (m/s)", stroke="#2ca02c", width=2, spanGaps=False),
    uplot.Series(label="off reference (m)", stroke="#d62728", width=2, spanGaps=False),
)


class Chart:
    """The chart. It is drawn twice a second, and not at all while no single UAV is looked at."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._drawn_s = 0.0
        self._handle = gui.add_uplot(
            columns([]),
            _SERIES,
            scales={"x": uplot.Scale(time=False, auto=False, range=(-CHART_S, 0.0)), "y": uplot.Scale(auto=True)},
            legend=uplot.Legend(show=True),
            height=200,
            visible=False,
        )

    def update(self, track: Track | None, now_s: float) -> None:
        """Shows the last minute of a UAV, or nothing."""
        if self._handle.visible != (track is not None):
            self._handle.visible = track is not None
        if track is not None and now_s - self._drawn_s >= _EVERY_S:
            self._drawn_s = now_s
            self._handle.data = columns(track.chart(now_s))


def columns(samples: list[Sample]) -> tuple[NDArray[np.float64], ...]:
    """Returns the columns of the chart. It always has two ends, so that it has an axis without samples, too."""
    rows = [(each.time_s, each.height_m, each.speed_m_s, each.off_reference_m) for each in samples]
    table = np.array([(-CHART_S, *[np.nan] * 3), *rows, (0.0, *[np.nan] * 3)], np.float64)
    return tuple(np.ascontiguousarray(column) for column in table.T)
