"""The newest transforms of tf, and how they lead from one frame to another. It needs no ROS.

tf2's own buffer also keeps what was, and interpolates. Here only the present counts: a goal is followed to where its
frame is now. So this stays small, and Python's listener of tf2, which costs more than the whole node, is not needed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container
from typing import NamedTuple

import ual

MOST_LEVELS = 64
"""A chain that is longer is a loop: two programs publish a frame with different parents."""


class Found(NamedTuple):
    """A transform, and how often tf has told what it was made of: so one that is told again is seen."""

    link: ual.Transform
    told_count: int


class TfBuffer:
    """The newest transform of each frame to its parent."""

    def __init__(self) -> None:
        self._links: dict[str, ual.Transform] = {}
        self._told: Counter[str] = Counter()

    def put(self, link: ual.Transform) -> None:
        """Takes the transform of a frame to its parent."""
        self._links[link.child_frame_id] = link
        self._told[link.child_frame_id] += 1

    def to_known(self, frame_id: str, known: Container[str]) -> Found | None:
        """Returns the transform from a frame to the nearest one above it that is known; else to ``map``.

        None where tf does not lead there (yet).
        """
        for each in self._upwards(frame_id)[1:]:
            if each.link.frame_id in known:
                return each
        return self._between("map", frame_id)

    def _between(self, target: str, source: str) -> Found | None:
        from_target = {each.link.frame_id: each for each in self._upwards(target)}
        for each in self._upwards(source):
            down = from_target.get(each.link.frame_id)
            if down is not None:
                return Found(down.link.inverse().compose(each.link), down.told_count + each.told_count)
        return None

    def _upwards(self, frame_id: str) -> list[Found]:
        """The transforms from a frame to itself, its parent, the parent of that, and so on."""
        way = [Found(ual.Transform(frame_id=frame_id, child_frame_id=frame_id), 0)]
        while (link := self._links.get(way[-1].link.frame_id)) is not None and len(way) < MOST_LEVELS:
            below = way[-1]
            way.append(Found(link.compose(below.link), below.told_count + self._told[link.child_frame_id]))
        return way
