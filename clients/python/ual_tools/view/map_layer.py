"""Draws a map below the scene, on a thread of its own: a server that is slow delays no picture of the UAVs."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
import trimesh
import viser
from PIL import Image, UnidentifiedImageError

from ual.geometry import Vector3
from ual.shared.guard import WorkGuard
from ual_tools import positions
from ual_tools.view.earth import EarthPosition, Origin, Tile, tiles_around
from ual_tools.view.journal import Journal
from ual_tools.view.map_source import MapPicture, Tiles
from ual_tools.view.scene import xyz
from ual_tools.watch_board import Board, WatchedUav

_POSITION_CHECK_S = 1.0
_RETRY_S = 30.0
_TILES_PER_SIDE = 2
"""Tiles to each side of the one in which the UAVs are."""
_MOST_TILES = 100
_MAP_HEIGHT_M = -0.05
"""So that the grid and what stands on the ground are above it."""
_DIMMED = [150, 150, 150, 255]
"""The lights of the scene are bright: undimmed, a map would be nearly white."""
_UV = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
_FACES = np.array([[0, 3, 2], [0, 2, 1]])


class MapLayer:
    """The map of the scene, once a UAV tells where it is on Earth and in `map`.

    Args:
        scene: viser's.
        board: What the UAVs tell.
        source: Where the pictures come from.
        journal: Gets what cannot be had.

    """

    def __init__(self, scene: viser.SceneApi, board: Board, source: Tiles | MapPicture, journal: Journal) -> None:
        self._scene = scene
        self._board = board
        self._source = source
        self._journal = journal
        self._origin: Origin | None = None
        self._drawn: dict[Tile | MapPicture, viser.GlbHandle] = {}
        self._retry_s: dict[Tile | MapPicture, float] = {}
        self._logged: set[str] = set()
        self._count = 0

    @contextmanager
    def running(self) -> Iterator[None]:
        """Draws while the block runs."""
        is_closing, guard = threading.Event(), WorkGuard("map")

        def run() -> None:
            while not is_closing.wait(_POSITION_CHECK_S):
                guard.contain(self.update)

        threading.Thread(target=run, name="ual view map", daemon=True).start()
        try:
            yield
        finally:
            is_closing.set()

    def update(self) -> None:
        """Draws what is missing around the UAVs."""
        watched = self._board.watched_uavs()
        if self._origin is None:
            self._origin = origin_of(watched)
        middle = _middle(watched)
        if self._origin is None or middle is None:
            return
        if isinstance(self._source, MapPicture):
            self._draw(self._source, self._origin)
            return
        wanted = tiles_around(self._origin.position_at(middle), self._source.zoom, _TILES_PER_SIDE)
        for tile in wanted:
            self._draw(tile, self._origin)
        self._tidy(wanted)

    def _draw(self, part: Tile | MapPicture, origin: Origin) -> None:
        if part in self._drawn or time.monotonic() < self._retry_s.get(part, 0.0):
            return
        try:
            image = Image.open(io.BytesIO(self._read(part))).convert("RGB")
        except (OSError, UnidentifiedImageError, Image.DecompressionBombError) as error:
            self._retry_s[part] = time.monotonic() + _RETRY_S
            self._say(f"the map: {part if isinstance(part, Tile) else part.file}: {error}")
            return
        corners = part.corners() if isinstance(part, Tile) else part.corners
        self._count += 1
        mesh = quad([origin.in_map(corner, _MAP_HEIGHT_M) for corner in corners], image)
        self._drawn[part] = self._scene.add_mesh_trimesh(
            f"/map/{self._count}", mesh, cast_shadow=False, receive_shadow=False
        )

    def _read(self, part: Tile | MapPicture) -> bytes:
        if isinstance(part, MapPicture):
            return part.file.read_bytes()
        assert isinstance(self._source, Tiles)
        return self._source.read(part)

    def _tidy(self, wanted: Sequence[Tile]) -> None:
        """Takes away what is far from the UAVs now, where that is much."""
        if len(self._drawn) > _MOST_TILES:
            for part in self._drawn.keys() - set(wanted):
                self._drawn.pop(part).remove()

    def _say(self, text: str) -> None:
        if not self._logged:  # of many tiles of one server the first failure says it
            self._journal.write("ual view", text, time.time())
        self._logged.add(text)


def quad(corners: Sequence[Vector3], image: Image.Image) -> trimesh.Trimesh:
    """Returns a picture that lies between four corners: upper left, upper right, lower right, lower left."""
    finish = {"baseColorTexture": image, "baseColorFactor": _DIMMED, "metallicFactor": 0.0, "roughnessFactor": 1.0}
    material = trimesh.visual.material.PBRMaterial(**finish)  # type: ignore[no-untyped-call]  # trimesh has no types
    visual = trimesh.visual.TextureVisuals(uv=_UV, material=material)  # type: ignore[no-untyped-call]  # here, either
    return trimesh.Trimesh(np.array([xyz(corner) for corner in corners]), _FACES, visual=visual, process=False)


def origin_of(watched: Mapping[str, WatchedUav]) -> Origin | None:
    """Returns where `map` is on Earth, by the first UAV that tells both."""
    for each in watched.values():
        t = each.telemetry
        position = None if t is None else positions.position(t)
        if t is not None and position is not None and t.position_geo is not None:
            return Origin.of(EarthPosition(t.position_geo.latitude_deg, t.position_geo.longitude_deg), position)
    return None


def _middle(watched: Mapping[str, WatchedUav]) -> Vector3 | None:
    """Returns the middle of all UAVs in `map`."""
    telemetry = (each.telemetry for each in watched.values())
    found = [position for t in telemetry if t is not None and (position := positions.position(t)) is not None]
    return sum(found, Vector3()) * (1.0 / len(found)) if found else None
