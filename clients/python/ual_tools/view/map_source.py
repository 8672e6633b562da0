"""Source of a map's pictures: the user's own server, a directory of tiles, or one picture. Draws nothing.

`ual view` requests them, not the browser: the page loads nothing from elsewhere.
"""

from __future__ import annotations

import urllib.error
import urllib.request
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ual.errors import InvalidArgumentError
from ual.shared.numbers import parse_number
from ual_tools.view.earth import EarthPosition, Tile

ZOOM, MOST_ZOOM = 17, 22
_LARGEST_TILE_BYTES = 8 << 20
_TILE_TIMEOUT_S = 10.0
_PARTS = ("{z}", "{x}", "{y}")
_SCHEMES = ("http", "https", "file")


@dataclass(frozen=True)
class MapPicture:
    """One picture, and where its corners are: upper left, upper right, lower right, lower left."""

    file: Path
    corners: tuple[EarthPosition, ...]


@dataclass(frozen=True)
class Tiles:
    """Tiles by an address with {z}, {x} and {y}: http, https, or a path of files."""

    url: str
    zoom: int = ZOOM

    def read(self, tile: Tile) -> bytes:
        """Returns the picture of a tile.

        Raises:
            OSError: It cannot be had.

        """
        where = self.url.format(z=tile.z, x=tile.x, y=tile.y)
        if not where.startswith(("http://", "https://")):
            return Path(where.removeprefix("file://")).read_bytes()
        request = urllib.request.Request(where, headers={"User-Agent": "ual view"})  # noqa: S310 (http or https)
        with urllib.request.urlopen(request, timeout=_TILE_TIMEOUT_S) as answer:  # noqa: S310 (the same)
            data: bytes = answer.read(_LARGEST_TILE_BYTES + 1)
        if len(data) > _LARGEST_TILE_BYTES:
            raise OSError(f"larger than {_LARGEST_TILE_BYTES} bytes")
        return data


def ground(
    tiles: str | None, zoom: int, picture: Path | None, corners: Sequence[str] | None
) -> Tiles | MapPicture | None:
    """Returns the map that the options say; None where there is none.

    Raises:
        InvalidArgumentError: They do not say what is needed.

    """
    if tiles is not None and picture is not None:
        raise InvalidArgumentError("--map-tiles and --map-picture: give one of them", {"field": "map"})
    if (picture is None) is not (corners is None):
        raise InvalidArgumentError("--map-picture and --map-corners: give both or none", {"field": "map_corners"})
    if picture is not None and corners is not None:
        return MapPicture(picture, tuple(_position(corner) for corner in corners))
    if tiles is None:
        return None
    if not all(part in tiles for part in _PARTS):
        raise InvalidArgumentError(f"--map-tiles {tiles}: it needs {', '.join(_PARTS)}", {"field": "map_tiles"})
    scheme, marked, _ = tiles.partition("://")
    if marked and scheme not in _SCHEMES:
        raise InvalidArgumentError(f"--map-tiles {tiles}: http, https or a path", {"field": "map_tiles"})
    return Tiles(tiles, zoom)


def _position(text: str) -> EarthPosition:
    try:
        latitude_deg, longitude_deg = map(parse_number, text.split(","))
    except ValueError:
        raise InvalidArgumentError(f"--map-corners {text}: LAT,LON in degrees", {"field": "map_corners"}) from None
    if not (-90.0 <= latitude_deg <= 90.0 and -180.0 <= longitude_deg <= 180.0):
        raise InvalidArgumentError(f"--map-corners {text}: no place on Earth", {"field": "map_corners"})
    return EarthPosition(latitude_deg, longitude_deg)
