"""Draws the geofences, as their configuration files say."""

from __future__ import annotations

from collections.abc import Sequence

import viser

from ual._cli.view import tree
from ual._cli.view.fence import Fence, lines
from ual._cli.view.fleet import Fleet
from ual._cli.view.picture import Moment
from ual._cli.view.scene import Lines
from ual._cli.view.shown import Colour
from ual.geometry import Transform

_RED: Colour = (200, 30, 30)
_EVERY_S = 1.0


class Fences:
    """The fences in the scene. Each is drawn where its frame is, and not at all while that is not known."""

    def __init__(self, scene: viser.SceneApi, fences: Sequence[Fence], fleet: Fleet) -> None:
        self.need_frames = any(fence.frame_id not in ("map", f"{fence.ns}/odom") for fence in fences)
        """Whether one of them lies in a frame that only the daemon knows."""
        self._fleet = fleet
        self._drawn_s = 0.0
        self._fences = [(fence, Lines(scene, f"/fence/{i}", _RED)) for i, fence in enumerate(fences)]

    def update(self, moment: Moment) -> None:
        """Draws them as they are now, once a second."""
        if moment.now_s - self._drawn_s < _EVERY_S:
            return
        self._drawn_s = moment.now_s
        for fence, drawn in self._fences:
            frame, seen = self._frame(fence, moment), moment.seen.get(fence.ns)
            telemetry = None if seen is None else seen.telemetry
            drawn.draw([] if frame is None else lines(fence, frame, telemetry))

    def _frame(self, fence: Fence, moment: Moment) -> Transform | None:
        uav, member = moment.uavs.get(fence.ns), self._fleet.members().get(fence.ns)
        if uav is None:
            return None
        if fence.frame_id == "map":
            return Transform()
        if fence.frame_id == f"{fence.ns}/odom":
            return uav.odom
        return None if member is None or member.frames is None else tree.in_map(member.frames).get(fence.frame_id)
