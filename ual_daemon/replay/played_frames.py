"""The recorded frames of a UAV, in the tree of frames of the one that plays it."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

from ual.errors import UalError
from ual.geometry import Transform
from ual.types import Frame
from ual_daemon import logs
from ual_daemon.backends.base import Clock
from ual_daemon.frames.tree import FrameTree

_log = logging.getLogger(__name__)


class PlayedFrames:
    """Adds, moves and removes frames as it was recorded. Belongs to the player's thread.

    What this daemon has by itself stays: ``map``, ``<ns>/odom``, the body, and what its configuration adds.
    """

    def __init__(self, tree: FrameTree, clock: Clock) -> None:
        self._tree = tree
        self._clock = clock
        self._played: dict[str, Transform] = {}
        """Frames that were added, parents first."""
        self._why_not = ""

    def take(self, frames: Sequence[Frame]) -> None:
        """Has the tree show recorded frames."""
        transforms = {
            frame.frame_id: replace(frame.transform, frame_id=frame.parent_frame_id, child_frame_id=frame.frame_id)
            for frame in frames
            if frame.transform is not None and frame.parent_frame_id and not self._tree.is_fixed(frame.frame_id)
        }
        try:
            self._show(transforms)
        except UalError as error:  # a program has hung its own frame below one of them
            if self._why_not != error.message:
                logs.event(_log, logging.WARNING, "frames_not_replayed", why=error)
            self._why_not = error.message

    def _show(self, transforms: dict[str, Transform]) -> None:
        parents = {name: each.frame_id for name, each in transforms.items()}
        if any(parents.get(name) != each.frame_id for name, each in self._played.items()):
            for name in list(reversed(self._played)):
                self._tree.remove(name)
                del self._played[name]
        left = {name: each for name, each in transforms.items() if self._played.get(name) != each}
        while ready := [name for name in left if left[name].frame_id in self._tree.links or parents[name] == "map"]:
            for name in ready:
                self._tree.add(left[name], self._clock.now_s())
                self._played[name] = left.pop(name)
