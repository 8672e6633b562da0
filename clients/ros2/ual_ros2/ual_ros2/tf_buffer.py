"""The newest transforms of tf, and how they lead from one frame to another. It needs no ROS.

tf2's own buffer also keeps what was, and interpolates. Here only the present counts: a goal is followed to where its
frame is now. So this stays small, and Python's listener of tf2, which costs more than the whole node, is not needed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Container
from datetime import datetime, timezone
from typing import NamedTuple

import ual
from ual_ros2.lateness import steady_s

MOST_LEVELS = 64
"""A chain that is longer is a loop: two programs publish a frame with different parents."""
UNIT_TOLERANCE = 0.01
"""Tolerance of the norm of a rotation around 1, as in tf2."""


class FrameReport(NamedTuple):
    """Last message about a frame, and its time (the buffer's clock). Of static ones the time is infinite: they never
    age.
    """

    at_s: float = math.inf
    frame_id: str = ""


class FoundTransform(NamedTuple):
    """A transform, how often tf has told what it was made of, and which part of it was heard of the longest ago.

    By the count, one that is told again is seen.
    """

    link: ual.Transform
    told_count: int = 0
    oldest: FrameReport = FrameReport()


class TfBuffer:
    """The newest transform of each frame to its parent.

    Args:
        tolerance_s: How old a transform that is not static may be.
        clock: In seconds. The stamps of tf are not read: they may be of a clock that is not UTC.

    """

    def __init__(self, tolerance_s: float = math.inf, clock: Callable[[], float] = steady_s) -> None:
        self._tolerance_s = tolerance_s
        self._clock = clock
        self._newest: dict[str, FoundTransform] = {}

    def put(self, link: ual.Transform, *, is_static: bool = False) -> None:
        """Takes the transform of a frame to its parent. One that is none (not finite, no rotation) is left out."""
        if not _is_usable(link):
            return
        before = self._newest.get(link.child_frame_id)
        heard = FrameReport() if is_static else FrameReport(self._clock(), link.child_frame_id)
        self._newest[link.child_frame_id] = FoundTransform(link, 1 if before is None else before.told_count + 1, heard)

    def forget(self, frame_id: str) -> None:
        """Forgets where a frame was, until tf tells it again."""
        self._newest.pop(frame_id, None)

    def require_fresh(self, frame_id: str, found: FoundTransform) -> None:
        """Requires that tf still tells where a frame is.

        Raises:
            FrameLostError: A part of it was not heard of for longer than the tolerance.

        """
        age_s = self._clock() - found.oldest.at_s
        if age_s <= self._tolerance_s:
            return
        stale = found.oldest.frame_id
        remedy = f"start what publishes {stale} on /tf, or set transform_tolerance"
        since = datetime.fromtimestamp(time.time() - age_s, timezone.utc).isoformat(timespec="seconds")
        raise ual.FrameLostError(
            f"it is not known where {frame_id} is: {stale} was not on /tf for {self._tolerance_s:g} s: {remedy}",
            {"frame_id": frame_id, "since": since, "remedy": remedy},
        )

    def to_known(self, frame_id: str, known: Container[str]) -> FoundTransform | None:
        """Returns the transform from a frame to the nearest one above it that is known; else to ``map``.

        None where tf does not lead there (yet).
        """
        for each in self._upwards(frame_id)[1:]:
            if each.link.frame_id in known:
                return each
        return self._between("map", frame_id)

    def _between(self, target: str, source: str) -> FoundTransform | None:
        from_target = {each.link.frame_id: each for each in self._upwards(target)}
        for each in self._upwards(source):
            down = from_target.get(each.link.frame_id)
            if down is not None:
                return _joined(down.link.inverse(), down, each)
        return None

    def _upwards(self, frame_id: str) -> list[FoundTransform]:
        """The transforms from a frame to itself, its parent, the parent of that, and so on."""
        way = [FoundTransform(ual.Transform(frame_id=frame_id, child_frame_id=frame_id))]
        while (above := self._newest.get(way[-1].link.frame_id)) is not None and len(way) < MOST_LEVELS:
            way.append(_joined(above.link, above, way[-1]))
        return way


def _joined(link: ual.Transform, above: FoundTransform, below: FoundTransform) -> FoundTransform:
    """Returns `link`, which is made of what is above, after what is below."""
    return FoundTransform(
        link.compose(below.link), above.told_count + below.told_count, min(above.oldest, below.oldest)
    )


def _is_usable(link: ual.Transform) -> bool:
    """Returns whether tf2 takes it, too."""
    there, turned = link.translation, link.rotation
    norm = math.hypot(turned.x, turned.y, turned.z, turned.w)
    return (
        all(map(math.isfinite, (there.x, there.y, there.z)))
        and abs(norm - 1.0) <= UNIT_TOLERANCE
        and link.child_frame_id not in ("", link.frame_id)
        and bool(link.frame_id)
    )
