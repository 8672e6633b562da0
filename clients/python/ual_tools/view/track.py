"""Track of a UAV: its trail, and the values of the chart over the last minute. Pure; draws nothing."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from ual.geometry import Vector3
from ual_tools.view.shown import Shown

CHART_S = 60.0
_CHART_PERIOD_S = 0.2
_TRAIL_STEP_M = 0.2
_MOST_PIECES = 100
_LONGEST_PIECE_M = 10.0
_STRAIGHT_COSINE = math.cos(math.radians(5.0))
"""A step that turns by less goes on with the piece before: a browser draws few pieces faster."""
_JUMP_M = 20.0
"""Between two samples; a UAV that is farther away was set again, and no line joins the two."""


@dataclass(frozen=True, slots=True)
class ChartSample:
    """One point of the chart. What is not known is not a number."""

    time_s: float
    height_m: float
    speed_m_s: float
    off_reference_m: float


class Track:
    """The trail and the chart of one UAV."""

    def __init__(self) -> None:
        self._pieces: deque[tuple[Vector3, Vector3]] = deque(maxlen=_MOST_PIECES)
        self._last: Vector3 | None = None
        self._samples: deque[ChartSample] = deque()

    def add(self, now_s: float, uav: Shown) -> None:
        """Takes note of where the UAV is now. While it is lost there is a gap."""
        self._draw(uav)
        while self._samples and now_s - self._samples[0].time_s > CHART_S:
            self._samples.popleft()
        if not uav.is_lost and (not self._samples or now_s - self._samples[-1].time_s >= _CHART_PERIOD_S):
            self._samples.append(
                ChartSample(now_s, _number(uav.height_m), _number(uav.speed_m_s), _number(uav.off_reference_m))
            )

    def trail(self) -> list[tuple[Vector3, Vector3]]:
        """Returns the pieces of the trail, in `map`, the oldest first."""
        return list(self._pieces)

    def chart(self, now_s: float) -> list[ChartSample]:
        """Returns the samples of the last minute, their times in seconds before now (negative)."""
        return [
            ChartSample(each.time_s - now_s, each.height_m, each.speed_m_s, each.off_reference_m)
            for each in tuple(self._samples)
        ]

    def _draw(self, uav: Shown) -> None:
        here = None if uav.is_lost or uav.body is None else uav.body.position
        if here is None or self._last is None:
            self._last = here
            return
        step_m = (here - self._last).norm()
        if step_m < _TRAIL_STEP_M:
            return
        if step_m < _JUMP_M:
            self._append(self._last, here)
        self._last = here

    def _append(self, last: Vector3, here: Vector3) -> None:
        start = self._pieces.pop()[0] if self._goes_on(last, here) else last
        self._pieces.append((start, here))

    def _goes_on(self, last: Vector3, here: Vector3) -> bool:
        """Returns whether a step goes on straight from the last piece."""
        if not self._pieces or self._pieces[-1][1] != last:
            return False
        piece, step = last - self._pieces[-1][0], here - last
        is_straight = piece.dot(step) > _STRAIGHT_COSINE * piece.norm() * step.norm()
        return is_straight and piece.norm() < _LONGEST_PIECE_M


def _number(value: float | None) -> float:
    return math.nan if value is None else value
