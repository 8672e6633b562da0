"""Pictures with their places: read again by ExifRead, and as OpenDroneMap and its OpenSfM read them.

The rules are those of opendm/photo.py and opensfm/exif.py, of November 2026.
"""

from __future__ import annotations

import io
import math
import struct
import zlib
from datetime import datetime, timezone
from typing import Any
from xml.etree import ElementTree as ET

import exifread
import PIL.Image
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual.cameras import CameraIntrinsics, Image, ImageFormat
from ual.errors import InvalidArgumentError
from ual.geometry import Pose, PoseStamped, Quaternion, Vector3
from ual.geotag import _angles, _exif, _segments, to_jpeg
from ual.types import GeoPoint

STAMP_S = datetime(2026, 11, 26, 5, 7, 9, 45_678, tzinfo=timezone.utc).timestamp()
LENS = CameraIntrinsics.of_view(64, 48, 1.2)
DOWN = Quaternion.from_euler(0.0, math.pi / 2.0, 0.0)
EAST, NORTH = Quaternion(), Quaternion.from_yaw(math.pi / 2.0)
PIX4D = "{http://pix4d.com/camera/1.0/}"


def encoded(kind: str, **options: Any) -> bytes:
    written = io.BytesIO()
    PIL.Image.radial_gradient("L").resize((64, 48)).convert("RGB").save(written, kind, **options)
    return written.getvalue()


def image(
    orientation: Quaternion | None = NORTH * DOWN,
    place: GeoPoint | None = None,
    data: bytes | None = None,
    lens: CameraIntrinsics | None = LENS,
) -> Image:
    kind = ImageFormat.PNG if data is None else ImageFormat.JPEG
    camera = None if orientation is None else PoseStamped(Pose(Vector3(), orientation), "uav_1/odom")
    return Image(data or encoded("PNG"), kind, 64, 48, STAMP_S, lens, camera=camera, position_geo=place)


def tags_of(jpeg: bytes) -> dict[str, Any]:
    found: dict[str, Any] = exifread.process_file(io.BytesIO(jpeg), details=False)
    return found


def degrees_of(tags: dict[str, Any], name: str) -> float:
    """As `gps_to_decimal` of OpenSfM."""
    sign = 1 if tags[f"GPS GPS{name}Ref"].values in "NE" else -1
    degrees, minutes, seconds = (float(each.num) / float(each.den) for each in tags[f"GPS GPS{name}"].values)
    return sign * (degrees + minutes / 60 + seconds / 3600)


def capture_time_s(tags: dict[str, Any]) -> float:
    """As `extract_capture_time` of OpenSfM, by the satellites' time."""
    hours, minutes, seconds = (each.num / each.den for each in tags["GPS GPSTimeStamp"].values)
    text = f"{tags['GPS GPSDate'].values} {int(hours):02d}:{int(minutes):02d}:{seconds:02f}"
    return datetime.strptime(text, "%Y:%m:%d %H:%M:%S.%f").replace(tzinfo=timezone.utc).timestamp()


def attitude_of(jpeg: bytes) -> tuple[float, float, float]:
    """Yaw, pitch, roll in degrees, as `ODM_Photo` finds its XMP."""
    begin, end = jpeg.find(b"<x:xmpmeta"), jpeg.find(b"</x:xmpmeta")
    [said] = ET.fromstring(jpeg[begin : end + 12]).iter("{http://www.w3.org/1999/02/22-rdf-syntax-ns#}Description")
    yaw, pitch, roll = (float(said.attrib[f"{PIX4D}{name}"]) for name in ("Yaw", "Pitch", "Roll"))
    return yaw, pitch, roll


def test_position_time_direction_and_focal_length_are_read_again() -> None:
    jpeg = to_jpeg(image(place=GeoPoint(37.412345678, -6.001234567, 123.456)), "light camera")
    tags = tags_of(jpeg)
    assert degrees_of(tags, "Latitude") == pytest.approx(37.412345678, abs=2e-9)
    assert degrees_of(tags, "Longitude") == pytest.approx(-6.001234567, abs=2e-9)
    altitude = tags["GPS GPSAltitude"].values[0]
    assert (altitude.num / altitude.den, tags["GPS GPSAltitudeRef"].values[0]) == (123.456, 0)
    assert tags["EXIF DateTimeOriginal"].values == "2026:11:26 05:07:09"
    assert tags["EXIF SubSecTimeOriginal"].values == "045678"
    assert tags["EXIF OffsetTimeOriginal"].values == "+00:00"
    assert capture_time_s(tags) == pytest.approx(STAMP_S, abs=2e-6)
    assert (tags["Image Make"].values, tags["Image Model"].values) == ("UAL", "light camera")
    assert (tags["EXIF ExifImageWidth"].values, tags["EXIF ExifImageLength"].values) == ([64], [48])
    direction = tags["GPS GPSImgDirection"].values[0]
    assert (tags["GPS GPSImgDirectionRef"].values, direction.num / direction.den) == ("T", 0.0)
    assert attitude_of(jpeg) == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


def test_the_focal_length_in_widths_of_the_picture_is_that_of_the_camera() -> None:
    """As `extract_focal` of both: the sensor's width follows from the resolution."""
    tags = tags_of(to_jpeg(image()))
    assert "EXIF FocalLengthIn35mmFilm" not in tags
    assert tags["EXIF FocalPlaneResolutionUnit"].values == [3]  # centimetres
    focal, resolution = (tags[f"EXIF {name}"].values[0] for name in ("FocalLength", "FocalPlaneXResolution"))
    sensor_mm = 64 / (resolution.num / resolution.den) * 10.0
    assert focal.num / focal.den / sensor_mm == pytest.approx(LENS.focal_length_x_px / 64, rel=1e-6)


def test_what_is_not_known_is_not_written() -> None:
    jpeg = to_jpeg(image(orientation=None, lens=None))
    tags = tags_of(jpeg)
    assert not [name for name in tags if name.startswith("GPS ") or "Focal" in name]
    assert b"xmpmeta" not in jpeg
    assert tags["EXIF DateTimeOriginal"].values == "2026:11:26 05:07:09"
    assert "GPS GPSAltitude" not in tags_of(to_jpeg(image(place=GeoPoint(1.0, 2.0))))


@given(st.floats(-90.0, 90.0), st.floats(-180.0, 180.0), st.floats(-400.0, 9000.0), st.floats(0.0, 4e9))
def test_every_position_on_earth_is_reported_within_a_millimetre(
    latitude_deg: float, longitude_deg: float, altitude_m: float, stamp_s: float
) -> None:
    exif = PIL.Image.Exif()
    place = GeoPoint(latitude_deg, longitude_deg, altitude_m)
    _exif.write(Image(b"", ImageFormat.PNG, 1, 1, stamp_s, position_geo=place), "", exif)
    written = io.BytesIO()
    PIL.Image.new("L", (1, 1)).save(written, "JPEG", exif=exif)
    tags = tags_of(written.getvalue())
    assert degrees_of(tags, "Latitude") == pytest.approx(latitude_deg, abs=2e-9)
    assert degrees_of(tags, "Longitude") == pytest.approx(longitude_deg, abs=2e-9)
    assert all(0 <= each.num / each.den < 60 for each in tags["GPS GPSLatitude"].values[1:])
    altitude, is_below = tags["GPS GPSAltitude"].values[0], tags["GPS GPSAltitudeRef"].values[0]
    assert (-1) ** is_below * altitude.num / altitude.den == pytest.approx(altitude_m, abs=6e-4)
    assert capture_time_s(tags) == pytest.approx(stamp_s, abs=2e-6)


@pytest.mark.parametrize(
    ("orientation", "yaw_deg", "pitch_deg", "roll_deg", "heading_deg"),
    [
        (NORTH * DOWN, 0.0, 0.0, 0.0, 0.0),
        (EAST * DOWN, 90.0, 0.0, 0.0, 90.0),
        (NORTH, 0.0, 90.0, 0.0, 0.0),
        (EAST, 90.0, 90.0, 0.0, 90.0),
        (EAST * Quaternion.from_euler(0.0, math.pi / 4.0, 0.0), 90.0, 45.0, 0.0, 90.0),
        (NORTH * Quaternion.from_euler(0.1, 0.0, 0.0) * DOWN, 0.0, 0.0, math.degrees(0.1), None),
    ],
)
def test_angles_are_those_of_opendronemap(
    orientation: Quaternion, yaw_deg: float, pitch_deg: float, roll_deg: float, heading_deg: float | None
) -> None:
    """Yaw: 0, the top of the picture is to the north; 90, to the east. Pitch: 0 looks down, 90 forward."""
    found = attitude_of(to_jpeg(image(orientation)))
    assert found == pytest.approx((yaw_deg, pitch_deg, roll_deg), abs=1e-3)
    if heading_deg is not None:
        heading_rad = _angles.angles(orientation).heading_rad
        assert math.cos(heading_rad - math.radians(heading_deg)) == pytest.approx(1.0)


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_the_angles_make_the_attitude_again(roll_rad: float, pitch_rad: float, yaw_rad: float) -> None:
    camera = Quaternion.from_euler(roll_rad, pitch_rad, yaw_rad)
    found = _angles.angles(camera)
    # An aircraft that is turned so in north, east, down, seen with y and z the other way: east, north, up.
    turned = Quaternion.from_euler(found.roll_rad, -found.pitch_rad, math.pi / 2.0 - found.yaw_rad)
    for axis, wanted in ((Vector3(1.0), Vector3(0.0, 0.0, 1.0)), (Vector3(0.0, 0.0, -1.0), Vector3(1.0))):
        assert (turned.rotate(axis) - camera.rotate(wanted)).norm() < 1e-4


def test_a_jpeg_keeps_its_pixels_and_its_other_tags() -> None:
    own = PIL.Image.Exif()
    own[0x010F], own[0x0110], own[0x829A] = "Maker", "Model 1", 0.01
    data = encoded("JPEG", exif=own)
    jpeg = to_jpeg(image(place=GeoPoint(1.0, 2.0, 3.0), data=data), "camera 0")
    tags = tags_of(jpeg)
    assert (tags["Image Make"].values, tags["Image Model"].values) == ("Maker", "Model 1")
    assert degrees_of(tags, "Latitude") == pytest.approx(1.0)
    assert jpeg.count(_segments.EXIF) == 1
    pixels = [PIL.Image.open(io.BytesIO(each)).tobytes() for each in (data, jpeg)]
    assert pixels[0] == pixels[1]
    again = to_jpeg(image(place=GeoPoint(5.0, 2.0, 3.0), data=jpeg))
    assert degrees_of(tags_of(again), "Latitude") == pytest.approx(5.0)
    assert (again.count(_segments.EXIF), again.count(_segments.XMP)) == (1, 1)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_own_tags_that_a_camera_wrote_wrongly_are_left_out() -> None:
    """Pillow reads them, and fails where it writes them again."""
    own = PIL.Image.Exif()
    own[0x0110] = "Model 1"
    data = encoded("JPEG", exif=own)
    at = data.index(_segments.EXIF) + len(_segments.EXIF) + 8 + 2  # the first tag: its number, its type
    assert data[at : at + 4] == b"\x01\x10\x00\x02"
    for kind in range(14):
        jpeg = to_jpeg(image(place=GeoPoint(1.0, 2.0, 3.0), data=data[: at + 3] + bytes((kind,)) + data[at + 4 :]))
        assert degrees_of(tags_of(jpeg), "Latitude") == pytest.approx(1.0)


def test_a_picture_that_tells_a_size_that_nothing_can_hold_is_refused() -> None:
    whole = encoded("PNG")
    head = whole[12:16] + struct.pack(">II", 1 << 16, 1 << 16) + whole[24:29]
    data = whole[:12] + head + struct.pack(">I", zlib.crc32(head)) + whole[33:]
    with pytest.raises(InvalidArgumentError, match=r"^image: "):
        to_jpeg(Image(data, ImageFormat.PNG, 64, 48, STAMP_S))


@pytest.mark.parametrize("data", [b"", b"no picture", encoded("JPEG")[:100]])
def test_what_is_no_picture_is_refused(data: bytes) -> None:
    with pytest.raises(InvalidArgumentError, match=r"^image: "):
        to_jpeg(Image(data, ImageFormat.PNG, 64, 48, STAMP_S))


def test_distances_are_no_picture() -> None:
    with pytest.raises(InvalidArgumentError, match="has no colours"):
        to_jpeg(Image(b"\0" * 16, ImageFormat.FLOAT32, 2, 2, STAMP_S))
