"""Draws where gimbals look: a pyramid along the view of each."""

from __future__ import annotations

import re
from collections.abc import Iterable

import viser

from ual.geometry import Pose, Transform, Vector3
from ual.types import Frame
from ual_tools.view.fleet import PageFleet
from ual_tools.view.picture import Moment
from ual_tools.view.scene import Line, SceneSegments

_CORNERS = tuple(Vector3(1.0, y, z) for y, z in ((0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2)))
"""Of its base, 1 m ahead of the gimbal."""


class PageGimbals:
    """The gimbals of all UAVs in the scene: none where no page wants them, or where it is not known how one looks."""

    def __init__(self, scene: viser.SceneApi, fleet: PageFleet) -> None:
        self._scene = scene
        self._fleet = fleet
        self._drawn: dict[str, SceneSegments] = {}

    def update(self, moment: Moment) -> None:
        """Draws them as they are now."""
        found = self._found(moment) if self._fleet.wants_gimbals else {}
        for ns in found.keys() - self._drawn.keys():
            # Kept for good: viser remembers each path that was ever used.
            self._drawn[ns] = SceneSegments(self._scene, f"/gimbals/{len(self._drawn)}", moment.uavs[ns].mark)
        for ns, drawn in self._drawn.items():
            drawn.draw(found.get(ns, []))

    def _found(self, moment: Moment) -> dict[str, list[Line]]:
        found = {}
        for ns, member in self._fleet.members().items():
            uav, frames = moment.uavs.get(ns), member.frames
            if uav is not None and uav.body is not None and not uav.is_lost and frames is not None:
                found[ns] = views(ns, uav.body, frames)
        return {ns: lines for ns, lines in found.items() if lines}


def views(ns: str, body: Pose, frames: Iterable[Frame]) -> list[Line]:
    """Returns the pyramids of the gimbals among the frames of a UAV, in the frame of its `body`."""
    in_map = Transform(body.position, body.orientation)
    of_gimbals = (each.transform for each in frames if _is_gimbal(ns, each))
    return [line for each in of_gimbals if each is not None for line in _pyramid(in_map.compose(each))]


def _is_gimbal(ns: str, frame: Frame) -> bool:
    is_named = re.fullmatch(rf"{re.escape(ns)}/gimbal_\d+", frame.frame_id) is not None
    return is_named and frame.parent_frame_id == f"{ns}/base_link"


def _pyramid(gimbal: Transform) -> list[Line]:
    corners = [gimbal.apply(each) for each in _CORNERS]
    around = zip(corners, [*corners[1:], corners[0]], strict=True)
    return [*((gimbal.translation, each) for each in corners), *around]
