"""The newest transforms of tf, and how they lead from one frame to another. It needs no ROS.

tf2's own buffer also keeps what was, and interpolates. Here only the present counts: a goal is followed to where its
frame is now. So this stays small, and Python's listener of tf2, which costs more than the whole node, is not needed.
"""

from __future__ import annotations

from collections.abc import Container

import ual

MOST_LEVELS = 64
"""A chain that is longer is a loop: two programs publish a frame with different parents."""


class TfBuffer:
    """The newest transform of each frame to its parent."""

    def __init__(self) -> None:
        self._links: dict[str, ual.Transform] = {}

    def put(self, link: ual.Transform) -> None:
        """Takes the transform of a frame to its parent."""
        self._links[link.child_frame_id] = link

    def to_known(self, frame_id: str, known: Container[str]) -> ual.Transform | None:
        """Returns the transform from a frame to the nearest one above it that is known; else to ``map``.

        None where tf does not lead there (yet).
        """
        way = self._upwards(frame_id)
        for each in way[1:]:
            if each.frame_id in known:
                return each
        return self._between("map", frame_id)

    def _between(self, target: str, source: str) -> ual.Transform | None:
        from_target = {each.frame_id: each for each in self._upwards(target)}
        for each in self._upwards(source):
            down = from_target.get(each.frame_id)
            if down is not None:
                return down.inverse().compose(each)
        return None

    def _upwards(self, frame_id: str) -> list[ual.Transform]:
        """The transforms from a frame to itself, its parent, the parent of that, and so on."""
        way = [ual.Transform(frame_id=frame_id, child_frame_id=frame_id)]
        while (link := self._links.get(way[-1].frame_id)) is not None and len(way) < MOST_LEVELS:
            way.append(link.compose(way[-1]))
        return way
