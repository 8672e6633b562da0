"""Draws where pictures were taken, and what the last one shows."""

from __future__ import annotations

import io
import logging
import math

import numpy as np
import PIL.Image
import viser
from numpy.typing import NDArray

from ual.cameras import OPTICAL, CameraIntrinsics, Image
from ual.geometry import Pose, Transform, Vector3
from ual_tools.view.fleet import PageFleet
from ual_tools.view.picture import Moment
from ual_tools.view.scene import Line, SceneSegments, wxyz, xyz
from ual_tools.view.shown import Shown
from ual_tools.view.taken import NewestPicture, Taken

_log = logging.getLogger(__name__)

_ARM_M = 0.15
_FRUSTUM_M = 1.0
"""Distance in metres of the drawn picture from its camera."""
_VIEW_RAD, _ASPECT = 1.0, 4.0 / 3.0
"""Of a camera that does not say how it sees."""
_THUMBNAIL_PX = 320
"""Pictures are made smaller for the page."""


class PagePictures:
    """The pictures of all UAVs in the scene: a cross at each place, and the last one where its camera was."""

    def __init__(self, scene: viser.SceneApi, fleet: PageFleet) -> None:
        self._scene = scene
        self._fleet = fleet
        self._drawn: dict[str, _OfUav] = {}

    def update(self, moment: Moment) -> None:
        """Draws them as they are now."""
        members = self._fleet.members()
        for ns, uav in moment.uavs.items():
            member = members.get(ns)
            if member is not None and (ns in self._drawn or member.taken.photos):
                # Kept for good: viser remembers each path that was ever used.
                drawn = self._drawn.setdefault(ns, _OfUav(self._scene, f"/pictures/{len(self._drawn)}", uav))
                drawn.update(member.taken, uav.odom)
        for ns in self._drawn.keys() - moment.uavs.keys():
            self._drawn[ns].update(Taken(), None)


class _OfUav:
    def __init__(self, scene: viser.SceneApi, path: str, uav: Shown) -> None:
        self._scene = scene
        self._path = path
        self._colour = uav.mark
        self._crosses = SceneSegments(scene, f"{path}/places", uav.mark)
        self._shown: tuple[NewestPicture, Transform] | None = None
        self._frustum: viser.CameraFrustumHandle | None = None

    def update(self, taken: Taken, odom: Transform | None) -> None:
        poses = [each.camera or each.body for each in taken.photos]
        positions = [] if odom is None else [odom.apply(each.pose.position) for each in poses if each is not None]
        self._crosses.draw([line for point in positions for line in _cross(point)])
        newest = taken.newest
        shown = None if newest is None or newest.photo.camera is None or odom is None else (newest, odom)
        if shown != self._shown:
            self._draw_last(shown)
            self._shown = shown  # after it: what viser has not drawn is drawn again

    def _draw_last(self, shown: tuple[NewestPicture, Transform] | None) -> None:
        before, self._frustum = self._frustum, None
        if before is not None:
            before.remove()
        if shown is None:
            return
        newest, odom = shown
        assert newest.photo.camera is not None
        camera = odom.apply_pose(newest.photo.camera.pose)
        optical = Pose(camera.position, camera.orientation * OPTICAL)
        view_rad, aspect = _view(newest.lens)
        self._frustum = self._scene.add_camera_frustum(
            f"{self._path}/last",
            view_rad,
            aspect,
            scale=_FRUSTUM_M,
            color=self._colour,
            image=None if newest.image is None else _pixels(newest.image),
            wxyz=wxyz(optical.orientation),
            position=xyz(optical.position),
            cast_shadow=False,
            receive_shadow=False,
        )


def _cross(point: Vector3) -> list[Line]:
    arms = (Vector3(_ARM_M), Vector3(0.0, _ARM_M), Vector3(0.0, 0.0, _ARM_M))
    return [(point - arm, point + arm) for arm in arms]


def _view(lens: CameraIntrinsics | None) -> tuple[float, float]:
    """Returns the angle from top to bottom, and the width over the height."""
    if lens is None:
        return _VIEW_RAD, _ASPECT
    return 2.0 * math.atan(0.5 * lens.height_px / lens.focal_length_y_px), lens.width_px / lens.height_px


def _pixels(image: Image) -> NDArray[np.uint8] | None:
    """Returns a small picture; None where its bytes are none, which does not end the view."""
    try:
        with PIL.Image.open(io.BytesIO(image.data)) as picture:
            small = picture.convert("RGB")
    except Exception as error:  # noqa: BLE001  whatever Pillow's decoders raise of the bytes of a camera
        _log.warning("a picture that cannot be read is not drawn: %s", error)
        return None
    small.thumbnail((_THUMBNAIL_PX, _THUMBNAIL_PX))
    return np.asarray(small)
