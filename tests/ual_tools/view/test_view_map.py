"""`ual view`: the map below the scene. Its pictures are a user's own: no test asks the internet."""

from __future__ import annotations

import functools
import http.server
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod

from tests.conftest import DaemonProcess
from tests.ual_tools.view.conftest import StartView
from ual.errors import InvalidArgumentError
from ual.geometry import Vector3
from ual_tools.view.earth import EarthPosition, Origin, Tile, tile_at, tiles_around
from ual_tools.view.map_source import MapPicture, Tiles, ground

SEVILLE = EarthPosition(37.4117, -6.0012)
GEOD = Geod(ellps="WGS84")


@given(st.floats(-75.0, 75.0), st.floats(-180.0, 180.0), st.floats(-2000.0, 2000.0), st.floats(-2000.0, 2000.0))
def test_a_position_is_where_the_ellipsoid_says(latitude_deg: float, longitude_deg: float, x: float, y: float) -> None:
    origin = Origin(EarthPosition(latitude_deg, longitude_deg))
    place = origin.position_at(Vector3(x, y, 0.0))
    back = origin.in_map(place)
    assert (back - Vector3(x, y, 0.0)).norm() < 1e-4
    _, _, distance_m = GEOD.inv(longitude_deg, latitude_deg, place.longitude_deg, place.latitude_deg)
    assert distance_m == pytest.approx(Vector3(x, y, 0.0).norm(), abs=5.0)


def test_the_origin_follows_from_a_uav_that_stands_next_to_it() -> None:
    here = Origin(SEVILLE).position_at(Vector3(200.0, 100.0, 0.0))
    found = Origin.of(here, Vector3(200.0, 100.0, 4.0))
    assert found.in_map(SEVILLE).norm() < 0.02


def test_tiles_are_counted_as_the_maps_of_the_web_do() -> None:
    assert tile_at(EarthPosition(0.0, 0.0), 1) == Tile(1, 1, 1)
    assert tile_at(EarthPosition(52.5163, 13.3777), 17) == Tile(17, 70406, 42987)  # the Brandenburg Gate
    assert tile_at(EarthPosition(90.0, 180.0), 3) == Tile(3, 0, 0)
    north_west, _, south_east, _ = Tile(0, 0, 0).corners()
    assert north_west == pytest.approx((85.0511, -180.0), abs=1e-4)
    assert south_east == pytest.approx((-85.0511, 180.0), abs=1e-4)


@given(st.floats(-85.0, 85.0), st.floats(-180.0, 179.9999), st.integers(0, 22))
def test_a_position_is_within_its_tile(latitude_deg: float, longitude_deg: float, zoom: int) -> None:
    north_west, _, south_east, _ = tile_at(EarthPosition(latitude_deg, longitude_deg), zoom).corners()
    assert south_east.latitude_deg - 1e-9 <= latitude_deg <= north_west.latitude_deg + 1e-9
    assert north_west.longitude_deg - 1e-9 <= longitude_deg <= south_east.longitude_deg + 1e-9


def test_the_nearest_tiles_come_first_and_none_twice() -> None:
    found = tiles_around(SEVILLE, 17, 2)
    assert found[0] == tile_at(SEVILLE, 17)
    assert len(set(found)) == len(found) == 25
    assert tiles_around(SEVILLE, 0, 2) == [Tile(0, 0, 0)]


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (("http://localhost/{z}/{x}.png", 17, None, None), "it needs {z}, {x}, {y}"),
        (("ftp://localhost/{z}/{x}/{y}.png", 17, None, None), "http, https or a path"),
        (("a{z}{x}{y}", 17, Path("a.png"), ("0,0",) * 4), "give one of them"),
        ((None, 17, Path("a.png"), None), "give both or none"),
        ((None, 17, Path("a.png"), ("0,0", "0,0", "0,0", "north")), "LAT,LON in degrees"),
        ((None, 17, Path("a.png"), ("0,0", "0,0", "0,0", "91,0")), "no place on Earth"),
    ],
)
def test_what_is_no_map_is_refused(
    options: tuple[str | None, int, Path | None, tuple[str, ...] | None], why: str
) -> None:
    with pytest.raises(InvalidArgumentError, match=why.replace("{", r"\{")):
        ground(*options)


def test_there_is_none_unless_it_is_requested() -> None:
    assert ground(None, 17, None, None) is None
    assert ground(None, 17, Path("a.png"), ("1,2", "1,3", "0,3", "0,2")) == MapPicture(
        Path("a.png"),
        (EarthPosition(1.0, 2.0), EarthPosition(1.0, 3.0), EarthPosition(0.0, 3.0), EarthPosition(0.0, 2.0)),
    )


@pytest.fixture
def tiles(tmp_path: Path) -> Path:
    """A directory with a tile of one colour at the place where light UAVs begin."""
    image = pytest.importorskip("PIL.Image")
    z, x, y = tile_at(SEVILLE, 17)
    file = tmp_path / str(z) / str(x) / f"{y}.png"
    file.parent.mkdir(parents=True)
    image.new("RGB", (16, 16), (10, 200, 30)).save(file)
    return tmp_path


@pytest.fixture
def server(tiles: Path) -> Iterator[str]:
    """A server of these tiles."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=tiles)) as serving:
        serving.daemon_threads = False  # its end is that of all its connections
        threading.Thread(target=serving.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{serving.server_port}/{{z}}/{{x}}/{{y}}.png"
        serving.shutdown()


def test_a_tile_is_read_from_a_server_or_from_a_directory(server: str, tiles: Path) -> None:
    tile = tile_at(SEVILLE, 17)
    assert Tiles(server).read(tile) == Tiles(f"{tiles}/{{z}}/{{x}}/{{y}}.png").read(tile)
    with pytest.raises(OSError, match="404"):
        Tiles(server).read(Tile(17, 0, 0))


def test_the_page_has_the_tile_below_the_uav_and_says_which_are_missing(
    daemon: DaemonProcess, start_view: StartView, server: str
) -> None:
    pytest.importorskip("viser", reason="NO VISER, `ual view` is NOT TESTED: pip install 'ual-tools[view]'")
    from tests.ual_tools.view.forger import forger

    daemon.wait_for("listening")
    with forger(start_view("--map-tiles", server)) as page:
        page.read_until_text("the map\\: Tile")
        while not any(name.startswith("/map/") for name in page.nodes):
            page.read(60.0)


def test_the_page_has_a_picture_between_its_corners(daemon: DaemonProcess, start_view: StartView, tiles: Path) -> None:
    pytest.importorskip("viser", reason="NO VISER, `ual view` is NOT TESTED: pip install 'ual-tools[view]'")
    from tests.ual_tools.view.forger import forger

    daemon.wait_for("listening")
    [file] = tiles.rglob("*.png")
    corners = ("37.413,-6.003", "37.413,-5.999", "37.410,-5.999", "37.410,-6.003")
    with forger(start_view("--map-picture", str(file), "--map-corners", *corners)) as page:
        while not any(name.startswith("/map/") for name in page.nodes):
            page.read(60.0)


def test_a_picture_lies_with_its_upper_edge_to_the_north() -> None:
    image = pytest.importorskip("PIL.Image")
    pytest.importorskip("viser", reason="NO VISER, `ual view` is NOT TESTED: pip install 'ual-tools[view]'")
    from trimesh.visual import TextureVisuals

    from ual_tools.view.map_layer import quad

    corners = [Vector3(-1.0, 1.0, 0.0), Vector3(1.0, 1.0, 0.0), Vector3(1.0, -1.0, 0.0), Vector3(-1.0, -1.0, 0.0)]
    mesh = quad(corners, image.new("RGB", (4, 4)))
    assert [tuple(normal) for normal in mesh.face_normals] == [(0.0, 0.0, 1.0)] * 2
    north_west = [tuple(vertex) for vertex in mesh.vertices].index((-1.0, 1.0, 0.0))
    assert isinstance(mesh.visual, TextureVisuals)
    assert tuple(mesh.visual.uv[north_west]) == (0.0, 1.0)  # v is up
