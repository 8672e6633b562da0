"""Draws the geofences, as the daemons tell them."""

from __future__ import annotations

import viser

from ual_tools.view.fence import fence_edges
from ual_tools.view.fleet import PageFleet
from ual_tools.view.palette import Colour
from ual_tools.view.scene import SceneSegments

_RED: Colour = (200, 30, 30)


class Fences:
    """The fences in the scene: none of a UAV while it is not known where its own one lies."""

    def __init__(self, scene: viser.SceneApi, fleet: PageFleet) -> None:
        self._scene = scene
        self._fleet = fleet
        self._drawn: dict[str, SceneSegments] = {}

    def update(self) -> None:
        """Draws them as they are now."""
        found = {ns: member.fence for ns, member in self._fleet.members().items()}
        for ns in found.keys() - self._drawn.keys():
            # Kept for good: viser remembers each path that was ever used.
            self._drawn[ns] = SceneSegments(self._scene, f"/fence/{len(self._drawn)}", _RED)
        for ns, drawn in self._drawn.items():
            fence = found.get(ns)
            drawn.draw([] if fence is None else fence_edges(fence))
