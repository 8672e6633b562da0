"""Paints what a simulated camera sees: level ground with a grid, markers on it, and the sky. A pinhole, no distortion.

It tells how far that is, too, and what.

Lines are a metre apart, and of the width that they have on the ground: each pixel gets its share of them. The line
through the origin along x is red, that along y is green.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ual.cameras import CameraIntrinsics
from ual.geometry import Pose
from ual_daemon.backends.light.scene import Marker, PaintedScene

Array = NDArray[np.float32]
Picture = NDArray[np.uint8]
"""Rows of columns of red, green, blue."""

GRID_M = 1.0
LINE_M, AXIS_M = 0.05, 0.12
"""The widths of a line of the grid, and of the two through the origin."""
NEAREST_GROUND_M = 0.02
"""Least height in metres over the ground at which a camera is painted."""
HAZE_M = 400.0
"""Distance in metres at which 63 % of a colour is that of the horizon."""
GROUND, LINE, RED, GREEN = (108.0, 122.0, 92.0), (214.0, 214.0, 206.0), (208.0, 40.0, 36.0), (40.0, 168.0, 60.0)
HORIZON, ZENITH = (214.0, 222.0, 230.0), (84.0, 138.0, 214.0)
BLACK, WHITE = (16.0, 16.0, 16.0), (244.0, 244.0, 244.0)
SKY_LABEL, GROUND_LABEL, FIRST_MARKER_LABEL = 0, 1, 2
"""Values of a pixel in `segments`: the markers count on. A line belongs to the ground."""
LAST_MARKER_LABEL = 255
"""All markers from this number on have it."""
_BLOCK_PX = 32768
"""Pixels, approximately, of a block of rows that is painted at a time: its numbers stay in the processor's cache."""
_LEAST_SLOPE = np.float32(1e-6)
"""A ray that goes down less than this sees the sky."""


def paint(
    camera: Pose, intrinsics: CameraIntrinsics, scene: PaintedScene, noise: float = 0.0, seed: int = 0
) -> Picture:
    """Returns a picture.

    `camera` looks along its x; its picture's left is its y. `noise` is the standard deviation of each colour, of 255.
    The same seed makes the same noise, whatever is seen.
    """
    picture = np.empty((intrinsics.height_px, intrinsics.width_px, 3), np.uint8)
    generator = np.random.default_rng(seed)
    for rows, cast in _blocks(camera, intrinsics, scene):
        planes = _colour_planes(cast, intrinsics.focal_length_x_px, scene)
        if noise:
            planes += generator.standard_normal(planes.shape, np.float32) * np.float32(noise)
        planes += np.float32(0.5)  # what follows cuts off
        np.clip(planes, 0.0, 255.0, out=planes)
        picture[rows] = np.moveaxis(planes, 0, 2)
    return picture


def depths(camera: Pose, intrinsics: CameraIntrinsics, scene: PaintedScene) -> Array:
    """Returns rows of how far each pixel's point is along the view, m; infinity for the sky."""
    found = np.empty((intrinsics.height_px, intrinsics.width_px), np.float32)
    for rows, cast in _blocks(camera, intrinsics, scene):
        found[rows] = np.where(cast.is_ground, cast.reach, np.inf)
    return found


def ranges(camera: Pose, intrinsics: CameraIntrinsics, scene: PaintedScene) -> Array:
    """Returns rows of how far each pixel's point is from the camera's centre, m; infinity for the sky."""
    found = np.empty((intrinsics.height_px, intrinsics.width_px), np.float32)
    for rows, cast in _blocks(camera, intrinsics, scene):
        found[rows] = np.where(cast.is_ground, cast.reach * cast.length, np.inf)
    return found


def segments(camera: Pose, intrinsics: CameraIntrinsics, scene: PaintedScene) -> Picture:
    """Returns a picture, whose red, green and blue are the label of what a pixel's centre shows."""
    labels = np.empty((intrinsics.height_px, intrinsics.width_px), np.uint8)
    for rows, cast in _blocks(camera, intrinsics, scene):
        found = np.full(cast.x.shape, GROUND_LABEL, np.uint8)
        for number, marker in enumerate(scene.markers):
            on_it = _within(marker, cast.x, cast.y)
            found[on_it.rows, on_it.columns] = min(FIRST_MARKER_LABEL + number, LAST_MARKER_LABEL)
        labels[rows] = np.where(cast.is_ground, found, np.uint8(SKY_LABEL))
    return np.repeat(labels[:, :, None], 3, axis=2)


class _Cast(NamedTuple):
    """The rays of a block's pixels, and where they meet the ground: one of x = 1 in the camera as often as `reach`.

    Where it meets none, `slope` is the least one, and what follows from it has no meaning.
    """

    rays: Array
    is_ground: NDArray[np.bool_]
    slope: Array
    reach: Array
    length: Array
    x: Array
    y: Array


def _blocks(camera: Pose, intrinsics: CameraIntrinsics, scene: PaintedScene) -> Iterator[tuple[slice, _Cast]]:
    """Yields blocks of rows: which ones, and what their rays meet."""
    columns = (np.arange(intrinsics.width_px) - intrinsics.centre_x_px) / intrinsics.focal_length_x_px
    rows = (np.arange(intrinsics.height_px) - intrinsics.centre_y_px) / intrinsics.focal_length_y_px
    forward, left, up = _matrix(camera).T[:, :, None, None]
    across = (forward - left * columns).astype(np.float32)
    along = (-up * rows[:, None]).astype(np.float32)
    count = max(1, _BLOCK_PX // intrinsics.width_px)
    for first in range(0, intrinsics.height_px, count):
        block = slice(first, first + count)
        yield block, _cast(camera, across + along[:, block], scene)


def _cast(camera: Pose, rays: Array, scene: PaintedScene) -> _Cast:
    slope = np.maximum(-rays[2], _LEAST_SLOPE)
    reach = np.float32(max(camera.position.z - scene.ground_z_m, NEAREST_GROUND_M)) / slope
    x, y = rays[0] * reach + np.float32(camera.position.x), rays[1] * reach + np.float32(camera.position.y)
    return _Cast(rays, slope > _LEAST_SLOPE, slope, reach, np.sqrt(np.square(rays).sum(axis=0)), x, y)


def _matrix(camera: Pose) -> NDArray[np.float64]:
    x, y, z, w = camera.orientation.normalized()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _colour_planes(cast: _Cast, focal_px: float, scene: PaintedScene) -> Array:
    """Returns the planes of red, green and blue that the rays of a block see."""
    if not cast.is_ground.any():
        return _sky(cast)
    path = cast.reach * cast.length
    footprint = path / (np.float32(focal_px) * cast.slope)  # what a pixel covers, along its ray
    planes = _ground(cast.x, cast.y, footprint)
    for marker in scene.markers:
        _lay(marker, cast.x, cast.y, planes)
    clear = np.exp(path / np.float32(-HAZE_M))
    _mix(planes, np.float32(1.0) - clear, HORIZON)
    return planes if cast.is_ground.all() else np.where(cast.is_ground, planes, _sky(cast))


def _sky(cast: _Cast) -> Array:
    planes = _plain(HORIZON, cast.length.shape)
    _mix(planes, np.clip(cast.rays[2] / cast.length, 0.0, 1.0), ZENITH)
    return planes


def _ground(x: Array, y: Array, footprint: Array) -> Array:
    planes = _plain(GROUND, x.shape)
    for value in (x, y):
        to_grid = np.abs(value - np.rint(value / np.float32(GRID_M)) * np.float32(GRID_M))
        _mix(planes, _share(to_grid, LINE_M, footprint), LINE)
    for distance, colour in ((np.abs(y), RED), (np.abs(x), GREEN)):
        if (distance < (footprint + np.float32(AXIS_M)) / 2).any():
            _mix(planes, _share(distance, AXIS_M, footprint), colour)
    return planes


def _plain(colour: tuple[float, ...], shape: tuple[int, ...]) -> Array:
    planes = np.empty((3, *shape), np.float32)
    planes[:] = np.array(colour, np.float32)[:, None, None]
    return planes


def _mix(planes: Array, share: Array, colour: tuple[float, ...]) -> None:
    """Gives each pixel its share of a colour."""
    for index, value in enumerate(colour):
        planes[index] += (np.float32(value) - planes[index]) * share


def _share(distance: Array, width_m: float, footprint: Array) -> Array:
    """Returns which share of what each pixel covers is a line of this width."""
    half, half_line = footprint * np.float32(0.5), np.float32(width_m / 2)
    covered = np.minimum(distance + half, half_line) - np.maximum(distance - half, -half_line)
    share: Array = np.clip(covered / footprint, 0.0, 1.0)
    return share


class _Within(NamedTuple):
    """Pixels of a block that are on a marker, and their distances to the right and up from its centre, m."""

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    right: Array
    up: Array


def _within(marker: Marker, x: Array, y: Array) -> _Within:
    reach_m = _extent_m(marker)
    dx, dy = x - np.float32(marker.x_m), y - np.float32(marker.y_m)
    rows, columns = np.nonzero((np.abs(dx) < 1.5 * reach_m) & (np.abs(dy) < 1.5 * reach_m))
    dx, dy = dx[rows, columns], dy[rows, columns]
    cos, sin = np.cos(marker.yaw_rad), np.sin(marker.yaw_rad)
    right, up = cos * dx + sin * dy, cos * dy - sin * dx
    inside = (np.abs(right) < reach_m) & (np.abs(up) < reach_m)
    return _Within(rows[inside], columns[inside], right[inside], up[inside])


def _extent_m(marker: Marker) -> float:
    """Returns how far a marker reaches from its centre, along its sides."""
    return marker.size_m / 2 + marker.size_m / (len(marker.cells) + 2)


def _lay(marker: Marker, x: Array, y: Array, planes: Array) -> None:
    """Lays a marker over the ground: its cells, a black border, and a white one, each of a cell's width."""
    rows, columns, right, up = _within(marker, x, y)
    if not right.size:
        return
    count, reach_m = len(marker.cells) + 2, _extent_m(marker)
    cell_m = marker.size_m / count
    table = np.pad(np.pad(np.array(marker.cells, bool), 1, constant_values=False), 1, constant_values=True)
    column = ((right + reach_m) / cell_m).astype(int).clip(0, count + 1)
    row = ((reach_m - up) / cell_m).astype(int).clip(0, count + 1)
    planes[:, rows, columns] = np.where(table[row, column], np.array(WHITE)[:, None], np.array(BLACK)[:, None])
