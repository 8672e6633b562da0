"""Small meshes made of boxes and cylinders, as arrays of corners and triangles. Metres; x forward, y left, z up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_CYLINDER_SIDES = 8
_BOX_FACES = [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4)]
_BOX_FACES += [(1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7)]


@dataclass(frozen=True)
class Mesh:
    """Corners (n x 3) and triangles (m x 3, numbers of corners)."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
        """Returns it moved."""
        return Mesh((self.vertices + np.array([x, y, z])).astype(np.float32), self.faces)


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Returns several meshes as one."""
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces).astype(np.uint32))


def box(length: float, width: float, height: float) -> Mesh:
    """Returns a box around the origin: its length along x, its width along y, its height along z."""
    x, y, z = length / 2, width / 2, height / 2
    low = [(-x, -y, -z), (x, -y, -z), (x, y, -z), (-x, y, -z)]
    high = [(a, b, z) for a, b, _ in low]
    return Mesh(np.array(low + high, np.float32), np.array(_BOX_FACES, np.uint32))


def bar(start: Sequence[float], end: Sequence[float], width: float) -> Mesh:
    """Returns a bar of square section between two points."""
    a, b = np.array(start, float), np.array(end, float)
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length
    across = np.cross(along, (0.0, 0.0, 1.0) if abs(along[2]) < 0.9 else (1.0, 0.0, 0.0))
    across /= np.linalg.norm(across)
    turn = np.stack([along, across, np.cross(along, across)], axis=1)
    flat = box(length, width, width)
    return Mesh((flat.vertices @ turn.T + (a + b) / 2).astype(np.float32), flat.faces)


def cylinder(radius: float, height: float) -> Mesh:
    """Returns an upright cylinder around the origin."""
    angles = np.linspace(0.0, math.tau, _CYLINDER_SIDES, endpoint=False)
    ring = np.stack([radius * np.cos(angles), radius * np.sin(angles)], axis=1)
    low, high = (np.column_stack([ring, np.full(_CYLINDER_SIDES, z)]) for z in (-height / 2, height / 2))
    middle = np.array([(0.0, 0.0, -height / 2), (0.0, 0.0, height / 2)])
    faces = []
    for i in range(_CYLINDER_SIDES):
        j = (i + 1) % _CYLINDER_SIDES
        faces += [(i, j, _CYLINDER_SIDES + j), (i, _CYLINDER_SIDES + j, _CYLINDER_SIDES + i)]
        faces += [(2 * _CYLINDER_SIDES, j, i), (2 * _CYLINDER_SIDES + 1, _CYLINDER_SIDES + i, _CYLINDER_SIDES + j)]
    return Mesh(np.concatenate([low, high, middle]).astype(np.float32), np.array(faces, np.uint32))
