"""The labels of one page, as its camera sees them: each page has its own, because they must not cover each other."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import viser

from ual.geometry import Quaternion, Vector3
from ual_tools.condition import Urgency
from ual_tools.view.camera import PageCamera
from ual_tools.view.label_layout import Wanted, laid_out
from ual_tools.view.scene import GROUND_LABELS, xyz
from ual_tools.view.shown import Shown

_LEAST_MOVE_M = 1e-3
_LONGEST_LABEL_CHARACTERS = 48
_MOST_LABELS = 60
"""A page with more UAVs names the ones with trouble and those that are chosen first."""


class Labels:
    """The labels in the scene of one browser."""

    def __init__(self, client: viser.ClientHandle, top_m: Callable[[str], float]) -> None:
        self._client = client
        self._top_m = top_m
        self._drawn: dict[str, viser.LabelHandle] = {}
        self._positions: dict[str, Vector3] = {}

    def update(self, uavs: Iterable[Shown], chosen: frozenset[str]) -> None:
        """Draws them as they are now."""
        camera = camera_of(self._client)
        if camera is None:
            return
        found = sorted(uavs, key=lambda uav: (-uav.how.level, uav.ns not in chosen))[:_MOST_LABELS]
        wanted = [_wanted(uav, self._top_m(uav.ns)) for uav in found if uav.body is not None]
        texts = {each.name: each.text for each in wanted}
        positions = laid_out(wanted, camera, GROUND_LABELS)
        for ns in self._drawn.keys() - positions.keys():
            self._drawn.pop(ns).remove()
        for ns, point in positions.items():
            self._draw(ns, texts[ns], point)

    def _draw(self, ns: str, text: str, point: Vector3) -> None:
        handle = self._drawn.get(ns)
        if handle is None:
            path = f"/labels/{ns.replace('/', '.')}"
            self._drawn[ns] = self._client.scene.add_label(path, text, position=xyz(point), anchor="bottom-center")
        else:
            if handle.text != text:
                handle.text = text
            if (point - self._positions[ns]).norm() > _LEAST_MOVE_M:
                handle.position = xyz(point)
            else:
                return
        self._positions[ns] = point


def camera_of(client: viser.ClientHandle) -> PageCamera | None:
    """Returns the camera of a page; None while it has not told it."""
    camera = client.camera
    if not camera.image_height:
        return None
    w, x, y, z = map(float, camera.wxyz)
    return PageCamera(
        Vector3(*map(float, camera.position)),
        Quaternion(x, y, z, w),
        float(camera.fov),
        float(camera.image_width),
        float(camera.image_height),
    )


def _wanted(uav: Shown, top_m: float) -> Wanted:
    assert uav.body is not None
    text = uav.ns if uav.how.level is Urgency.FINE else f"{uav.ns}: {uav.how.text}"
    text = text if len(text) <= _LONGEST_LABEL_CHARACTERS else f"{text[: _LONGEST_LABEL_CHARACTERS - 1]}…"
    above = uav.body.position + Vector3(0.0, 0.0, top_m)
    return Wanted(uav.ns, text, above, is_urgent=uav.how.level is not Urgency.FINE)
