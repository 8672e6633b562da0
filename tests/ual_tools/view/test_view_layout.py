"""`ual view`: where its camera and its labels are, what is chosen, and what its table says. Without a page."""

from __future__ import annotations

import gzip
import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual.geometry import Quaternion, Vector3
from ual_tools.condition import UavCondition, Urgency
from ual_tools.view import fleet_table, palette, shell
from ual_tools.view.camera import PageCamera, framing
from ual_tools.view.chosen import ALL, chosen, title
from ual_tools.view.label_layout import Fixed, Wanted, laid_out
from ual_tools.view.shown import GREY, Shown

FOV_RAD = 1.0
NAMES = ("uav_1", "uav_2", "uav_10")
places = st.builds(Vector3, st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(-100, 1e3))


def camera_at(position: Vector3, look_at: Vector3, width_px: float, height_px: float) -> PageCamera:
    """A camera whose picture is upright."""
    ahead = (look_at - position) * (1.0 / (look_at - position).norm())
    yaw_rad, pitch_rad = math.atan2(ahead.y, ahead.x), math.asin(ahead.z)
    body = Quaternion.from_euler(0.0, -pitch_rad, yaw_rad)  # x ahead, y left, z up
    to_optical = Quaternion(-0.5, 0.5, -0.5, 0.5)
    return PageCamera(position, body * to_optical, FOV_RAD, width_px, height_px)


@given(st.lists(places, min_size=1, max_size=8), st.sampled_from([(1280.0, 800.0), (390.0, 844.0), (800.0, 800.0)]))
def test_the_camera_sees_all_uavs_wherever_their_homes_are(found: list[Vector3], size: tuple[float, float]) -> None:
    width_px, height_px = size
    position, look_at = framing(found, FOV_RAD, width_px / height_px)
    camera = camera_at(position, look_at, width_px, height_px)
    for place in found:
        pixel = camera.pixel(place)
        assert pixel is not None
        assert 0.0 <= pixel[0] <= width_px
        assert 0.0 <= pixel[1] <= height_px


def test_the_camera_is_near_a_single_uav_and_faces_it() -> None:
    position, look_at = framing([Vector3(200.0, 100.0, 4.0)], FOV_RAD, 1.6)
    assert look_at == Vector3(200.0, 100.0, 4.0)
    assert (position - look_at).norm() < 10.0
    assert position.z > look_at.z


def test_what_is_behind_the_camera_is_not_observed() -> None:
    camera = camera_at(Vector3(), Vector3(1.0, 0.0, 0.0), 800.0, 600.0)
    assert camera.pixel(Vector3(-1.0, 0.0, 0.0)) is None
    pixel = camera.pixel(Vector3(10.0, 1.0, 1.0))
    assert pixel is not None
    assert pixel[0] < 400.0  # on its left
    assert pixel[1] < 300.0  # above


PLACES = st.lists(st.builds(Vector3, st.floats(0, 30), st.floats(-15, 15), st.floats(0, 10)), max_size=25)


@given(PLACES, PLACES)
def test_no_label_covers_another_one_nor_one_of_the_ground(found: list[Vector3], ground: list[Vector3]) -> None:
    camera = camera_at(Vector3(-20.0, 0.0, 15.0), Vector3(15.0, 0.0, 0.0), 860.0, 800.0)
    wanted = [Wanted(f"uav_{n}", f"uav_{n}", place, is_urgent=n % 5 == 0) for n, place in enumerate(found)]
    fixed = [Fixed("10 m", place) for place in ground]
    placed = laid_out(wanted, camera, fixed)
    assert {each.name for each in wanted if each.is_urgent} <= set(placed)
    pixels = [camera.pixel(place) for place in placed.values()]
    for one, other in itertools.combinations(pixels, 2):
        assert one is not None
        assert other is not None
        assert abs(one[0] - other[0]) >= 35.0 or abs(one[1] - other[1]) >= 12.0
    for one, other in itertools.product(pixels, (camera.pixel(each.place) for each in fixed)):
        assert one is not None
        assert other is not None
        middle = one[1] - 19.0 / 2.0  # a label stands above its place, one of the ground around it
        assert abs(one[0] - other[0]) >= 25.0 or abs(middle - other[1]) >= 12.0


def test_a_label_that_has_room_stays_where_it_is() -> None:
    camera = camera_at(Vector3(-20.0, 0.0, 15.0), Vector3(15.0, 0.0, 0.0), 860.0, 800.0)
    place = Vector3(10.0, 2.0, 3.0)
    assert (laid_out([Wanted("uav_1", "uav_1", place)], camera)["uav_1"] - place).norm() < 1e-9


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", NAMES),
        (ALL, NAMES),
        ("uav_2", ("uav_2",)),
        (" uav_10 ,uav_1", ("uav_1", "uav_10")),
        ("uav_1,", ("uav_1",)),
        ("uav", ()),
        ("uav_1, nobody", ("uav_1",)),
        ("all", ()),
    ],
)
def test_one_several_or_all_are_chosen_and_a_text_that_is_being_typed_chooses_none_by_chance(
    text: str, found: tuple[str, ...]
) -> None:
    assert chosen(text, NAMES) == found


def test_a_button_says_for_which_uavs_it_is() -> None:
    assert title(NAMES, NAMES) == "all 3"
    assert title(("uav_1", "uav_2"), NAMES) == "uav_1, uav_2"
    many = tuple(f"uav_{n}" for n in range(5))
    assert title(many[:4], many) == "4 chosen"


def uav(ns: str, level: Urgency = Urgency.FINE, words: str = "") -> Shown:
    return Shown(ns, "", GREY, UavCondition(level, "FLYING_AUTO", words, words), "87 %", palette.colour(1), task="goes")


def test_the_table_has_the_worst_first_and_marks_what_is_chosen() -> None:
    found = [uav("uav_1"), uav("uav_2", Urgency.WARNING, "weak link"), uav("uav_3", Urgency.ALARM, "failsafe: <b>")]
    html = fleet_table.table(found, ("uav_2",), "UAL")
    rows = html.split("<tr ")[1:]
    assert ["uav_3" in rows[0], "uav_2" in rows[1], "uav_1" in rows[2]] == [True] * 3
    assert "class='ual-alarm'" in rows[0]
    assert "failsafe: &lt;b&gt;" in rows[0]
    assert "class='ual-warning ual-chosen'" in rows[1]
    assert "class=''" in rows[2]
    assert "1 alarm, 1 warning; 3 FLYING_AUTO" in html
    assert fleet_table.with_alarms("UAL", found) == "1 alarm, 1 warning - UAL"
    assert fleet_table.with_alarms("UAL", found[:1]) == "UAL"


def test_one_that_is_lost_ranks_above_a_failsafe() -> None:
    lost = Shown("uav_2", "", GREY, UavCondition(Urgency.ALARM, "LOST", "lost", "lost"))
    rows = fleet_table.table([uav("uav_1", Urgency.ALARM, "failsafe: fence"), lost], (), "UAL").split("<tr ")[1:]
    assert ["uav_2" in rows[0], "uav_1" in rows[1]] == [True, True]


def test_a_name_of_a_uav_is_no_markup() -> None:
    html = fleet_table.table([uav("a' onclick='x<")], (), "UAL")
    assert "data-ual-ns='a&#x27; onclick=&#x27;x&lt;'" in html


@pytest.mark.parametrize("encoding", ["", "identity", "gzip"])
def test_the_page_has_a_title_of_its_own(encoding: str) -> None:
    page = b"<html><head><title>Viser</title></head><body></body></html>"
    body = shell.with_shell(gzip.compress(page) if encoding == "gzip" else page, encoding, "UAL - CONTROL")
    found = gzip.decompress(body) if encoding == "gzip" else body
    assert b"<title>UAL - CONTROL</title>" in found
    assert b"data-ual-ns" in found


def test_a_page_in_another_encoding_is_left_as_it_is() -> None:
    assert shell.with_shell(b"x", "br", "UAL") == b"x"
