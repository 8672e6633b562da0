"""Poses of a UAV's frames in `map`. Pure; draws nothing."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ual.geometry import Transform
from ual.types import Frame

_ROOT = "map"
_MOST_LEVELS = 64


def in_map(frames: Iterable[Frame]) -> dict[str, Transform]:
    """Returns the transform from each frame to `map`, without those of which one is not known."""
    known = {frame.frame_id: frame for frame in frames}
    found = ((frame_id, _chain(frame_id, known)) for frame_id in known)
    return {frame_id: transform for frame_id, transform in found if transform is not None}


def _chain(frame_id: str, known: Mapping[str, Frame]) -> Transform | None:
    total = Transform()
    for _ in range(_MOST_LEVELS):
        if frame_id == _ROOT:
            return total
        frame = known.get(frame_id)
        if frame is None or frame.transform is None:
            return None
        total, frame_id = frame.transform.compose(total), frame.parent_frame_id
    return None
