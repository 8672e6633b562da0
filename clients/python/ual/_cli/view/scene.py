"""Draws the UAVs in viser's scene, which all pages share. Sends only what has changed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import count

import numpy as np
import viser
from numpy.typing import NDArray

from ual._cli.view.models import MODELS, Model
from ual._cli.view.picture import Moment
from ual._cli.view.shown import Colour, Shown
from ual._cli.view.track import Track
from ual.geometry import Pose, Quaternion, Vector3

_BLACK: Colour = (40, 40, 40)
_ORANGE: Colour = (255, 127, 14)
_WHITE: Colour = (235, 235, 235)
_GHOST: Colour = (31, 119, 180)
_TURN_RAD = 1.1
"""By how much the propellers turn between two pictures: enough to see that they turn."""
_NEAR_M, _NEAR_ROTATION = 1e-3, 1e-3
_TRAIL_EVERY = 5
"""The trail is sent with each fifth picture: it is long, and two of them a second are enough."""

Points = NDArray[np.float32]


def draw_ground(scene: viser.SceneApi) -> None:
    """Draws the ground of `map`: a grid of 1 m and 10 m, north, and how long 10 m are."""
    scene.set_up_direction("+z")
    scene.configure_default_lights(enabled=True, cast_shadow=False)
    scene.add_grid("/ground", infinite_grid=True, cell_size=1.0, section_size=10.0, fade_distance=150.0)
    arrow = [((0, 0, 0), (0, 3, 0)), ((0, 3, 0), (0.25, 2.5, 0)), ((0, 3, 0), (-0.25, 2.5, 0))]
    scene.add_line_segments("/north", np.array(arrow, np.float32), _BLACK, thickness=3.0, thickness_units="screen")
    scene.add_label("/north/label", "N", position=(0.0, 3.3, 0.0), anchor="center-center")
    for name, place in (("10 m east", (10.0, 0.0, 0.0)), ("10 m north", (0.0, 10.0, 0.0)), ("map", (0.0, 0.0, 0.0))):
        scene.add_label(f"/scale/{name}", name, position=place, font_screen_scale=0.7)


class Scene:
    """The UAVs in the scene.

    Args:
        scene: viser's.
        model_of: Returns the name of the model of a UAV.
        goal_of: Returns where a UAV flies straight to, where that is known.

    """

    def __init__(
        self, scene: viser.SceneApi, model_of: Callable[[str], str], goal_of: Callable[[str], Vector3 | None]
    ) -> None:
        self._scene = scene
        self._model_of = model_of
        self._goal_of = goal_of
        self._number = count(1)
        self._crafts: dict[str, tuple[str, Craft]] = {}
        draw_ground(scene)

    def update(self, moment: Moment) -> None:
        """Draws all UAVs as they are now, and takes away those that are not there any more."""
        for ns in self._crafts.keys() - moment.uavs.keys():
            self._crafts.pop(ns)[1].remove()
        for ns, uav in moment.uavs.items():
            self._craft(ns).update(uav, moment.tracks[ns], self._goal_of(ns))

    def _craft(self, ns: str) -> Craft:
        name = self._model_of(ns)
        known = self._crafts.get(ns)
        if known is not None and known[0] == name:
            return known[1]
        if known is not None:
            known[1].remove()
        craft = Craft(self._scene, f"/uav/{next(self._number)}", MODELS[name]())
        self._crafts[ns] = (name, craft)
        return craft


class Craft:
    """One UAV: its model, label, ghost (the reference), home, trail and way."""

    def __init__(self, scene: viser.SceneApi, path: str, model: Model) -> None:
        self._model = model
        self._scene = scene
        self._root = scene.add_frame(path, show_axes=False)
        self._body = _Place(scene.add_frame(f"{path}/body", show_axes=False, visible=False))
        self._ghost = _Place(scene.add_frame(f"{path}/reference", show_axes=False, visible=False))
        self._home = _Place(scene.add_frame(f"{path}/home", axes_length=0.4, axes_radius=0.015, visible=False))
        self._label = scene.add_label(f"{path}/label", "", anchor="bottom-center", visible=False)
        self._skin = _mesh(scene, f"{path}/body/skin", model, _BLACK)
        scene.add_mesh_simple(f"{path}/body/nose", model.nose.vertices, model.nose.faces, color=_ORANGE)
        _mesh(scene, f"{path}/reference/skin", model, _GHOST, opacity=0.3)
        scene.add_label(f"{path}/home/label", "home", font_screen_scale=0.6)
        self._propellers = scene.add_batched_meshes_simple(
            f"{path}/body/propellers",
            model.propeller.vertices,
            model.propeller.faces,
            batched_wxyzs=_turned(0.0, len(model.hubs)),
            batched_positions=np.array(model.hubs, np.float32),
            batched_colors=_WHITE,
            lod="off",
            cast_shadow=False,
        )
        self._trail = Lines(scene, f"{path}/trail", _GHOST)
        self._way = Lines(scene, f"{path}/way", _ORANGE)
        self._angle_rad = 0.0
        self._colour: Colour | None = None
        self._count = 0
        self._drawn_count = -1

    def update(self, uav: Shown, track: Track, goal: Vector3 | None) -> None:
        """Draws the UAV as it is now."""
        self._body.put(uav.body)
        self._ghost.put(uav.reference)
        self._home.put(None if uav.odom is None else Pose(uav.odom.translation, uav.odom.rotation))
        self._name(uav)
        if uav.colour != self._colour:
            self._colour = self._skin.color = uav.colour
        if uav.is_armed:
            self._angle_rad += _TURN_RAD
            self._propellers.batched_wxyzs = _turned(self._angle_rad, len(self._model.hubs))
        self._draw_lines(uav, track, goal)

    def remove(self) -> None:
        """Takes it out of the scene."""
        self._root.remove()

    def _name(self, uav: Shown) -> None:
        self._label.visible = uav.body is not None
        if uav.label != self._label.text:
            self._label.text = uav.label
        if uav.body is not None and self._body.has_moved:
            x, y, z = uav.body.position
            self._label.position = (x, y, z + self._model.top_m)

    def _draw_lines(self, uav: Shown, track: Track, goal: Vector3 | None) -> None:
        self._count += 1
        if self._count % _TRAIL_EVERY:
            return
        if track.count != self._drawn_count:
            self._drawn_count = track.count
            self._trail.draw(track.trail())
        from_here = uav.body is not None and not uav.is_lost
        self._way.draw([(uav.body.position, goal)] if from_here and uav.body and goal else [])


class _Place:
    """A frame of the scene that is moved only when its pose has changed, and shown only while that is known."""

    def __init__(self, handle: viser.FrameHandle) -> None:
        self.has_moved = False
        self._handle = handle
        self._pose: Pose | None = None

    def put(self, pose: Pose | None) -> None:
        self.has_moved = pose is not None and not _near(pose, self._pose)
        if (pose is None) != (self._pose is None):
            self._handle.visible = pose is not None
        if pose is None:
            self._pose = None
        elif self.has_moved:
            self._pose = pose
            self._handle.position = xyz(pose.position)
            self._handle.wxyz = wxyz(pose.orientation)


class Lines:
    """Lines of one colour, which are sent only when they have changed."""

    def __init__(self, scene: viser.SceneApi, path: str, colour: Colour) -> None:
        self._drawn: list[tuple[Vector3, Vector3]] = []
        self._handle = scene.add_line_segments(
            path, np.zeros((1, 2, 3), np.float32), colour, thickness=2.0, thickness_units="screen", visible=False
        )

    def draw(self, lines: list[tuple[Vector3, Vector3]]) -> None:
        """Draws these lines, and no others."""
        if lines == self._drawn:
            return
        if bool(lines) != bool(self._drawn):
            self._handle.visible = bool(lines)
        if lines:
            self._handle.points = points(lines)
        self._drawn = lines


def points(lines: Sequence[tuple[Vector3, Vector3]]) -> Points:
    """Returns lines as viser takes them."""
    return np.array([(xyz(a), xyz(b)) for a, b in lines], np.float32)


def xyz(place: Vector3) -> tuple[float, float, float]:
    """Returns a place as viser takes it."""
    return place.x, place.y, place.z


def wxyz(rotation: Quaternion) -> tuple[float, float, float, float]:
    """Returns a rotation in viser's order."""
    return rotation.w, rotation.x, rotation.y, rotation.z


def _mesh(
    scene: viser.SceneApi, path: str, model: Model, colour: Colour, opacity: float | None = None
) -> viser.MeshHandle:
    return scene.add_mesh_simple(
        path, model.body.vertices, model.body.faces, color=colour, opacity=opacity, flat_shading=True, cast_shadow=False
    )


def _turned(angle_rad: float, hubs_count: int) -> Points:
    """Returns the rotation of each propeller; neighbours turn in opposite directions."""
    half = angle_rad / 2
    each = [(math.cos(half), 0.0, 0.0, math.sin(half) * (-1) ** i) for i in range(hubs_count)]
    return np.array(each, np.float32)


def _near(pose: Pose, other: Pose | None) -> bool:
    if other is None or (pose.position - other.position).norm() > _NEAR_M:
        return False
    pairs = zip(pose.orientation, other.orientation, strict=True)
    return all(abs(a - b) < _NEAR_ROTATION for a, b in pairs)
