"""Draws the UAVs in viser's scene, which all pages share. Sends only what has changed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
import viser
from numpy.typing import NDArray

from ual.geometry import Pose, Quaternion, Transform, Vector3
from ual_tools.view import models
from ual_tools.view.label_layout import Fixed
from ual_tools.view.meshes import Mesh
from ual_tools.view.models import MODELS, Model
from ual_tools.view.palette import Colour
from ual_tools.view.picture import Moment
from ual_tools.view.shown import GREY, Shown

_BLACK: Colour = (40, 40, 40)
_ORANGE: Colour = (255, 127, 14)
_WHITE: Colour = (235, 235, 235)
_GHOST: Colour = (31, 119, 180)
_TURN_RAD = 1.1
"""By how much the propellers turn between two pictures: enough to see that they turn."""
_NEAR_M, _NEAR_ROTATION = 1e-3, 1e-3
_ALL_PIECES, _FEWEST_PIECES = 600, 20
"""Of the trails of all UAVs, and of each one: a browser without a graphics card draws no more at 10 frames a second."""
_PICTURES_PER_TRAIL = 5
"""The trail is sent with each fifth picture: it is long, and two of them a second are enough."""

Points = NDArray[np.float32]
Line = tuple[Vector3, Vector3]


GROUND_LABELS = (
    Fixed("N", Vector3(0.0, 3.3, 0.0)),
    Fixed("10 m east", Vector3(10.0, 0.0, 0.0)),
    Fixed("10 m north", Vector3(0.0, 10.0, 0.0)),
    Fixed("map", Vector3()),
)


def draw_ground(scene: viser.SceneApi) -> None:
    """Draws the ground of `map`: a grid of 1 m and 10 m, north, and how long 10 m are."""
    scene.set_up_direction("+z")
    scene.configure_default_lights(enabled=True, cast_shadow=False)
    scene.add_grid("/ground", infinite_grid=True, cell_size=1.0, section_size=10.0, fade_distance=150.0)
    arrow = [((0, 0, 0), (0, 3, 0)), ((0, 3, 0), (0.25, 2.5, 0)), ((0, 3, 0), (-0.25, 2.5, 0))]
    scene.add_line_segments("/north", np.array(arrow, np.float32), _BLACK, thickness=3.0, thickness_units="screen")
    for text, point in GROUND_LABELS:
        scale = 1.0 if text == "N" else 0.7
        path = f"/scale/{text}"
        scene.add_label(path, text, position=xyz(point), anchor="center-center", font_screen_scale=scale)


class Scene:
    """The UAVs in the scene. What all of them have is drawn at once: with 20 UAVs, one by one would be slow.

    Args:
        scene: viser's.
        model_of: Returns the name of the model of a UAV.
        way_of: Returns the way that a UAV flies, in `map`, where that is known.

    """

    def __init__(
        self, scene: viser.SceneApi, model_of: Callable[[str], str], path_of: Callable[[str], Sequence[Vector3]]
    ) -> None:
        self._scene = scene
        self._model_of = model_of
        self._path_of = path_of
        self._numbers: dict[str, int] = {}
        self._squadrons = {name: Squadron(scene, f"/models/{name}", make()) for name, make in MODELS.items()}
        self._homes = Batch(scene, "/homes", models.helipad())
        self._goals = Batch(scene, "/goals", models.goal())
        self._drops = Drops(scene)
        self._marks: dict[str, Marks] = {}
        draw_ground(scene)

    def update(self, moment: Moment) -> None:
        """Draws all UAVs as they are now, and takes away those that are not there any more."""
        names = {ns: self._model_of(ns) for ns in moment.uavs}
        for name, squadron in self._squadrons.items():
            squadron.update([uav for ns, uav in moment.uavs.items() if names[ns] == name])
        homes = [Pose(uav.odom.translation, uav.odom.rotation) for uav in moment.uavs.values() if uav.odom is not None]
        self._homes.draw(homes, [_GHOST] * len(homes))
        paths = {ns: () if uav.is_lost else self._path_of(ns) for ns, uav in moment.uavs.items()}
        goals = [Pose(waypoints[-1]) for waypoints in paths.values() if waypoints]
        self._goals.draw(goals, [_ORANGE] * len(goals))
        self._drops.draw(moment.uavs.values())
        self._draw_marks(moment, paths)

    def top_m(self, ns: str) -> float:
        """Returns how far above a UAV its label is."""
        return self._squadrons[self._model_of(ns)].model.top_m

    def _draw_marks(self, moment: Moment, paths: Mapping[str, Sequence[Vector3]]) -> None:
        for ns in self._marks.keys() - moment.uavs.keys():
            self._marks.pop(ns).remove()
        most = max(_FEWEST_PIECES, _ALL_PIECES // max(1, len(moment.uavs)))
        for ns, uav in moment.uavs.items():
            if ns not in self._marks:
                # A UAV that is back gets its old path: viser remembers each path that was ever used.
                path = f"/uav/{self._numbers.setdefault(ns, len(self._numbers))}"
                self._marks[ns] = Marks(self._scene, path, uav.mark)
            self._marks[ns].update(uav, moment.tracks[ns].trail()[-most:], paths[ns], most // 2)


class Squadron:
    """All UAVs of one model: their bodies, noses and propellers, and their ghosts, which show the references."""

    def __init__(self, scene: viser.SceneApi, path: str, model: Model) -> None:
        self.model = model
        self._bodies = Batch(scene, f"{path}/bodies", model.body)
        self._noses = Batch(scene, f"{path}/noses", model.nose)
        self._propellers = Batch(scene, f"{path}/propellers", model.propeller)
        self._ghosts = Batch(scene, f"{path}/references", model.ghost, opacity=0.3)
        self._angle_rad = 0.0

    def update(self, uavs: Sequence[Shown]) -> None:
        """Draws them as they are now."""
        self._angle_rad += _TURN_RAD
        placed = [(uav, uav.body) for uav in uavs if uav.body is not None]
        bodies = [body for _, body in placed]
        propellers = [each for uav, body in placed for each in self._turned(uav, body)]
        ghosts = [uav.reference for uav in uavs if uav.reference is not None]
        self._bodies.draw(bodies, [uav.colour for uav, _ in placed])
        self._noses.draw(bodies, [GREY if uav.is_lost else _ORANGE for uav, _ in placed])
        self._propellers.draw(propellers, [_WHITE] * len(propellers))
        self._ghosts.draw(ghosts, [_GHOST] * len(ghosts))

    def _turned(self, uav: Shown, body: Pose) -> Iterator[Pose]:
        """Returns where its propellers are; neighbours turn in opposite directions, and none while it is disarmed."""
        angle_rad = self._angle_rad if uav.is_armed else 0.0
        in_map = Transform(body.position, body.orientation)
        for i, hub in enumerate(self.model.hubs):
            yield in_map.apply_pose(Pose(Vector3(*hub), Quaternion.from_yaw(angle_rad * (-1) ** i)))


class Batch:
    """One mesh that is drawn at many places. Only what has changed is sent."""

    def __init__(self, scene: viser.SceneApi, path: str, mesh: Mesh, opacity: float | None = None) -> None:
        self._scene = scene
        self._path = path
        self._mesh = mesh
        self._opacity = opacity
        self._handle: viser.BatchedMeshHandle | None = None
        self._drawn: tuple[Sequence[Pose], Sequence[Colour]] = ((), ())

    def draw(self, poses: Sequence[Pose], colours: Sequence[Colour]) -> None:
        """Draws it at these places, and nowhere else."""
        before, before_colours = self._drawn
        if len(poses) != len(before):
            self._make(poses, colours)
        elif self._handle is not None:
            if not all(map(_near, poses, before)):
                self._handle.batched_positions = _positions(poses)
                self._handle.batched_wxyzs = _rotations(poses)
            else:
                poses = before
            if list(colours) != list(before_colours):
                self._handle.batched_colors = np.array(colours, np.uint8)
        self._drawn = (poses, colours)

    def _make(self, poses: Sequence[Pose], colours: Sequence[Colour]) -> None:
        """Begins again: viser does not change how many there are."""
        if self._handle is not None:
            self._handle.remove()
            self._handle = None
        if poses:
            self._handle = self._scene.add_batched_meshes_simple(
                self._path,
                self._mesh.vertices,
                self._mesh.faces,
                batched_wxyzs=_rotations(poses),
                batched_positions=_positions(poses),
                batched_colors=np.array(colours, np.uint8),
                opacity=self._opacity,
                lod="off",
                flat_shading=True,
                cast_shadow=False,
                receive_shadow=False,
            )


class Marks:
    """Marks of one UAV: its trail, and the route that it flies."""

    def __init__(self, scene: viser.SceneApi, path: str, colour: Colour) -> None:
        self._root = scene.add_frame(path, show_axes=False)
        self._trail = SceneSegments(scene, f"{path}/trail", colour)
        self._path_ahead = SceneSegments(scene, f"{path}/way", _ORANGE)
        self._count = 0

    def update(self, uav: Shown, trail: list[Line], waypoints: Sequence[Vector3], most: int) -> None:
        """Draws them as they are now: at most so many pieces of the way, those ahead of it."""
        self._count += 1
        if self._count % _PICTURES_PER_TRAIL:
            return
        self._trail.draw(trail)
        self._path_ahead.draw(list(pairwise(_ahead(waypoints, uav.body, most))))

    def remove(self) -> None:
        """Takes them out of the scene."""
        self._root.remove()


class Drops:
    """A line from each UAV straight down to the ground of its home, in its own colour: where it is above the map."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._handle: viser.LineSegmentsHandle | None = None
        self._marks: list[Colour] = []
        self._lines: list[Line] = []

    def draw(self, uavs: Iterable[Shown]) -> None:
        """Draws them as they are now."""
        drawn = [(uav, uav.body.position) for uav in uavs if uav.body is not None]
        marks = [GREY if uav.is_lost else uav.mark for uav, _ in drawn]
        lines = [(point, below(uav, point)) for uav, point in drawn]
        if self._handle is None or marks != self._marks:
            self._make(lines, marks)
        elif not all((a - b).norm() < _NEAR_M for (a, _), (b, _) in zip(lines, self._lines, strict=True)):
            self._handle.points = points(lines)
        else:
            return
        self._lines = lines

    def _make(self, lines: list[Line], marks: list[Colour]) -> None:
        """Begins again: it has another number of lines, or other colours."""
        self._marks = marks
        if self._handle is not None:
            self._handle.remove()
            self._handle = None
        if lines:
            colours = np.repeat(np.array(marks, np.uint8)[:, None, :], 2, axis=1)
            self._handle = self._scene.add_line_segments(
                "/drops", points(lines), colours, thickness=1.5, thickness_units="screen"
            )


def below(uav: Shown, point: Vector3) -> Vector3:
    """Returns the place on the ground of a UAV's home that is straight below another one."""
    return Vector3(point.x, point.y, 0.0 if uav.odom is None else uav.odom.translation.z)


class SceneSegments:
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


def xyz(point: Vector3) -> tuple[float, float, float]:
    """Returns a place as viser takes it."""
    return point.x, point.y, point.z


def wxyz(rotation: Quaternion) -> tuple[float, float, float, float]:
    """Returns a rotation in viser's order."""
    return rotation.w, rotation.x, rotation.y, rotation.z


def _ahead(waypoints: Sequence[Vector3], body: Pose | None, most: int) -> Sequence[Vector3]:
    """Returns the part of a way that begins where the UAV is, in at most so many pieces."""
    if len(waypoints) <= most + 1:
        return waypoints
    nearest = 0 if body is None else min(range(len(waypoints)), key=lambda i: (waypoints[i] - body.position).norm())
    begin = max(0, min(nearest - 1, len(waypoints) - 1 - most))
    return waypoints[begin : begin + most + 1]


def _positions(poses: Sequence[Pose]) -> Points:
    return np.array([xyz(pose.position) for pose in poses], np.float32)


def _rotations(poses: Sequence[Pose]) -> Points:
    return np.array([wxyz(pose.orientation) for pose in poses], np.float32)


def _near(pose: Pose, other: Pose) -> bool:
    if (pose.position - other.position).norm() > _NEAR_M:
        return False
    pairs = zip(pose.orientation, other.orientation, strict=True)
    return all(abs(a - b) < _NEAR_ROTATION for a, b in pairs)
