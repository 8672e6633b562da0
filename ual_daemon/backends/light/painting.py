"""Paints what a simulated camera sees: level ground with a grid, markers on it, and the sky. A pinhole, no distortion.

It tells how far that is, too, and what.

Lines are a metre apart, and of the width that they have on the ground: each pixel gets its share of them. The line
through the origin along x is red, that along y is green.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ual.cameras import CameraIntrinsics
from ual.geometry import Pose

Array = NDArray[np.float32]

GRID_M = 1.0
LINE_M, AXIS_M = 0.05, 0.12
"""The widths of a line of the grid, and of the two through the origin."""
NEAREST_M = 0.02
"""A camera is painted at least so high over the ground."""
HAZE_M = 400.0
"""At this distance 63 % of a colour is that of the horizon."""
GROUND, LINE, RED, GREEN = (108.0, 122.0, 92.0), (214.0, 214.0, 206.0), (208.0, 40.0, 36.0), (40.0, 168.0, 60.0)
HORIZON, ZENITH = (214.0, 222.0, 230.0), (84.0, 138.0, 214.0)
BLACK, WHITE = (16.0, 16.0, 16.0), (244.0, 244.0, 244.0)
SKY_LABEL, GROUND_LABEL, FIRST_MARKER_LABEL = 0, 1, 2
"""What a pixel shows, in `segments`: the markers count on. A line belongs to the ground."""
MOST_LABEL = 255
"""All markers from this number on have it."""


class Marker(NamedTuple):
    """A square on the ground, with cells from its upper left corner on: True is white. Black and white borders follow.

    `size_m` is the side of its black border. With a yaw of 0 its top is towards y, and its right side towards x.
    """

    x_m: float
    y_m: float
    size_m: float
    yaw_rad: float
    cells: tuple[tuple[bool, ...], ...]


class Scene(NamedTuple):
    """What is to be seen. Places are in the local frame, in metres."""

    ground_z_m: float
    markers: Sequence[Marker] = ()


def paint(camera: Pose, intrinsics: CameraIntrinsics, scene: Scene, noise: float = 0.0, seed: int = 0) -> bytes:
    """Returns the rows of a picture, three bytes (red, green, blue) a pixel.

    `camera` looks along its x; its picture's left is its y. `noise` is the standard deviation of each colour, of 255.
    The same seed makes the same noise.
    """
    rays, sees_ground, slope, reach, length, x, y = _cast(camera, intrinsics, scene)
    colours = _sky(rays)
    footprint = reach * length / (intrinsics.focal_length_x_px * slope)  # what a pixel covers, along the ray's way
    ground = _ground(x, y, footprint)
    for marker in scene.markers:
        _lay(marker, x, y, ground)
    clear = np.exp(-reach * length / HAZE_M)[:, None]
    colours[sees_ground] = ground * clear + np.array(HORIZON, np.float32) * (1.0 - clear)
    if noise:
        # The shape is given, and not the values: so the noise of one seed is the same for each scene.
        generator = np.random.default_rng(seed)
        colours += generator.standard_normal(colours.shape, dtype=np.float32) * np.float32(noise)
    return np.clip(np.rint(colours), 0.0, 255.0).astype(np.uint8).tobytes()


def depths(camera: Pose, intrinsics: CameraIntrinsics, scene: Scene) -> bytes:
    """Returns how far each pixel's point is along the view, m: as `ual.cameras.ImageFormat.FLOAT32`."""
    cast = _cast(camera, intrinsics, scene)
    return _numbers(cast, cast.reach)


def ranges(camera: Pose, intrinsics: CameraIntrinsics, scene: Scene) -> bytes:
    """Returns how far each pixel's point is from the camera's centre, m: as `ual.cameras.ImageFormat.FLOAT32`."""
    cast = _cast(camera, intrinsics, scene)
    return _numbers(cast, cast.reach * cast.length)


def segments(camera: Pose, intrinsics: CameraIntrinsics, scene: Scene) -> bytes:
    """Returns the rows of a picture, whose red, green and blue are the label of what a pixel's centre shows."""
    cast = _cast(camera, intrinsics, scene)
    labels = np.full(len(cast.rays), SKY_LABEL, np.uint8)
    ground = np.full(cast.x.size, GROUND_LABEL, np.uint8)
    for number, marker in enumerate(scene.markers):
        _, _, _, inside = _within(marker, cast.x, cast.y)
        ground[inside] = min(FIRST_MARKER_LABEL + number, MOST_LABEL)
    labels[cast.sees_ground] = ground
    return np.repeat(labels, 3).tobytes()


class _Cast(NamedTuple):
    """The rays of all pixels, and of those that meet the ground where they do: one of x = 1 as often as `reach`."""

    rays: Array
    sees_ground: NDArray[np.bool_]
    slope: Array
    reach: Array
    length: Array
    x: Array
    y: Array


def _cast(camera: Pose, intrinsics: CameraIntrinsics, scene: Scene) -> _Cast:
    rays = _rays(intrinsics) @ _matrix(camera).T
    height_m = max(camera.position.z - scene.ground_z_m, NEAREST_M)
    down = -rays[:, 2]
    sees_ground = down > 1e-6
    ray, slope = rays[sees_ground], down[sees_ground]
    reach = height_m / slope
    x, y = camera.position.x + ray[:, 0] * reach, camera.position.y + ray[:, 1] * reach
    length = np.sqrt(ray[:, 0] ** 2 + ray[:, 1] ** 2 + slope**2)
    return _Cast(rays, sees_ground, slope, reach, length, x, y)


def _numbers(cast: _Cast, of_ground: Array) -> bytes:
    numbers = np.full(len(cast.rays), np.inf, "<f4")
    numbers[cast.sees_ground] = of_ground
    return numbers.tobytes()


@lru_cache(maxsize=4)
def _rays(intrinsics: CameraIntrinsics) -> Array:
    """Returns the direction of each pixel in the axes of the camera's pose, row by row; x is 1."""
    columns = (np.arange(intrinsics.width_px) - intrinsics.centre_x_px) / intrinsics.focal_length_x_px
    rows = (np.arange(intrinsics.height_px) - intrinsics.centre_y_px) / intrinsics.focal_length_y_px
    left, up = np.meshgrid(-columns, -rows)
    return np.stack([np.ones(left.size), left.ravel(), up.ravel()], axis=1).astype(np.float32)


def _matrix(camera: Pose) -> Array:
    x, y, z, w = camera.orientation.normalized()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ],
        np.float32,
    )


def _sky(rays: Array) -> Array:
    elevation = np.clip(rays[:, 2] / np.linalg.norm(rays, axis=1), 0.0, 1.0)[:, None]
    sky: Array = np.array(HORIZON, np.float32) * (1.0 - elevation) + np.array(ZENITH, np.float32) * elevation
    return sky


def _ground(x: Array, y: Array, footprint: Array) -> Array:
    colours = np.empty((x.size, 3), np.float32)
    colours[:] = GROUND
    for value in (x, y):
        _draw(colours, np.abs((value + GRID_M / 2) % GRID_M - GRID_M / 2), LINE_M, footprint, LINE)
    _draw(colours, np.abs(y), AXIS_M, footprint, RED)
    _draw(colours, np.abs(x), AXIS_M, footprint, GREEN)
    return colours


def _draw(colours: Array, distance: Array, width_m: float, footprint: Array, colour: tuple[float, ...]) -> None:
    """Draws a line over colours: each pixel gets the share of the line in what it covers."""
    begin, end = np.maximum(distance - footprint / 2, -width_m / 2), np.minimum(distance + footprint / 2, width_m / 2)
    share = np.clip((end - begin) / footprint, 0.0, 1.0)[:, None]
    colours += (np.array(colour, np.float32) - colours) * share


def _lay(marker: Marker, x: Array, y: Array, colours: Array) -> None:
    """Lays a marker over the ground: its cells, a black border, and a white one, each of a cell's width."""
    right, up, reach_m, inside = _within(marker, x, y)
    if not inside.size:
        return
    count = len(marker.cells) + 2
    cell_m = marker.size_m / count
    table = np.pad(np.pad(np.array(marker.cells, bool), 1, constant_values=False), 1, constant_values=True)
    column = ((right[inside] + reach_m) / cell_m).astype(int).clip(0, count + 1)
    row = ((reach_m - up[inside]) / cell_m).astype(int).clip(0, count + 1)
    colours[inside] = np.where(table[row, column][:, None], np.array(WHITE), np.array(BLACK))


def _within(marker: Marker, x: Array, y: Array) -> tuple[Array, Array, float, NDArray[np.intp]]:
    """Returns places in the axes of a marker, how far it reaches from its centre, and the numbers of those on it."""
    reach_m = marker.size_m / 2 + marker.size_m / (len(marker.cells) + 2)
    dx, dy = x - marker.x_m, y - marker.y_m
    cos, sin = np.cos(marker.yaw_rad), np.sin(marker.yaw_rad)
    right, up = cos * dx + sin * dy, cos * dy - sin * dx
    return right, up, reach_m, np.flatnonzero((np.abs(right) < reach_m) & (np.abs(up) < reach_m))
