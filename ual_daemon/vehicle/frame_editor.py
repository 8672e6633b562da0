"""Adds and removes frames for callers. It moves nothing, so it needs no lease, and works in a recording, too."""

from __future__ import annotations

from ual.geometry import Transform
from ual_daemon import validation
from ual_daemon.backends.base import Clock
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.frames.tree import MAP
from ual_daemon.vehicle.refusal_log import RefusalLog, accepted


class FrameEditor:
    """Changes the frames of one UAV. Any thread may call; see `ual.interface.Uav` for what is raised."""

    def __init__(self, resolver: FrameResolver, clock: Clock) -> None:
        self._tree = resolver.tree
        self._clock = clock
        self._refusals = RefusalLog()

    def add(self, transform: Transform) -> None:
        """Adds a frame, or moves one that was added. Moves are not logged, because they may come often."""
        with self._refusals.logging_refusal("add_frame"):
            transform = validation.transform(transform, "transform")
            is_new = transform.child_frame_id not in self._tree.names()
            self._tree.add(transform, self._clock.now_s())
            if is_new:
                accepted("add_frame", frame=transform.child_frame_id, parent=transform.frame_id or MAP)

    def remove(self, frame_id: str) -> None:
        """Removes a frame that was added."""
        with self._refusals.logging_refusal("remove_frame"):
            self._tree.remove(validation.frame_id(frame_id, "frame_id"))
            accepted("remove_frame", frame=frame_id)
