"""`ual view`: the chart, without a page."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("viser", reason="NO VISER, the chart of `ual view` is NOT TESTED: pip install 'ual-tools[view]'")

from ual_tools.view.chart import Range, columns, limits
from ual_tools.view.track import CHART_S, ChartSample

NAN = math.nan


def test_a_chart_without_samples_has_its_axes() -> None:
    times, *values = columns([])
    assert list(times) == [-CHART_S, 0.0]
    assert all(math.isnan(each) for column in values for each in column)
    assert limits(columns([])) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("heights", "expected"),
    [
        ((0.2, 1.0), (0.0, 1.0)),
        ((0.2, 1.1), (0.0, 2.0)),
        ((2.1,), (0.0, 5.0)),
        ((5.1,), (0.0, 10.0)),
        ((10.1, 119.0), (0.0, 200.0)),
        ((-3.0, 1.0), (-5.0, 1.0)),
        ((NAN, 1.5, NAN), (0.0, 2.0)),
        ((math.inf, 1.5), (0.0, 2.0)),
    ],
)
def test_its_range_has_all_values_and_seldom_changes(heights: tuple[float, ...], expected: Range) -> None:
    samples = [ChartSample(-float(number), height_m, NAN, NAN) for number, height_m in enumerate(heights)]
    assert limits(columns(samples)) == expected
