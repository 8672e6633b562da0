"""Metadata of a picture: tags of EXIF 2.32, by Pillow, and XMP for the attitude."""

from __future__ import annotations

import math
from datetime import datetime, timedelta, timezone

from PIL import ExifTags, Image
from PIL.TiffImagePlugin import IFDRational

from ual import cameras
from ual.geotag._angles import Angles, angles
from ual.types import GeoPoint

_SENSOR_MM = 36.0
"""Width of the sensor in mm: the real one is not known, and only the ratio to the focal length counts."""
_CM, _MM_IN_CM = 3, 10.0
_MICRO, _SECONDS = 1_000_000, 100_000
"""Denominators of numbers, and of the seconds of an angle: 0.3 mm on the ground."""
_BASE, _GPS = ExifTags.Base, ExifTags.GPS
_REQUIRED: dict[int, object] = {
    _BASE.Make: "UAL",
    _BASE.Orientation: 1,
    _BASE.XResolution: IFDRational(72),
    _BASE.YResolution: IFDRational(72),
    _BASE.ResolutionUnit: 2,
    _BASE.YCbCrPositioning: 1,
}
_REQUIRED_DETAILS: dict[int, object] = {
    _BASE.ExifVersion: b"0232",
    _BASE.FlashPixVersion: b"0100",
    _BASE.ColorSpace: 1,
}
"""Tags that EXIF requires of every file, unless the camera has written them."""


def write(image: cameras.Image, camera: str, exif: Image.Exif) -> None:
    """Writes the tags of a picture over those that are there."""
    taken = datetime(1970, 1, 1, tzinfo=timezone.utc) + timedelta(microseconds=round(image.stamp_s * _MICRO))
    details = exif.get_ifd(ExifTags.IFD.Exif)
    for kept, required in ((exif, {**_REQUIRED, _BASE.Model: camera or "camera"}), (details, _REQUIRED_DETAILS)):
        for tag, value in required.items():
            kept.setdefault(tag, value)
    details[_BASE.DateTimeOriginal] = f"{taken:%Y:%m:%d %H:%M:%S}"
    details[_BASE.SubsecTimeOriginal] = f"{taken:%f}"
    details[_BASE.OffsetTimeOriginal] = "+00:00"
    details[_BASE.ExifImageWidth], details[_BASE.ExifImageHeight] = image.width_px, image.height_px
    if image.intrinsics is not None:
        _write_focal_length(image.intrinsics, details)
    if image.position_geo is not None:
        _write_position(image.position_geo, taken, exif.get_ifd(ExifTags.IFD.GPSInfo))
    if image.camera is not None:
        _write_direction(angles(image.camera.pose.orientation), exif.get_ifd(ExifTags.IFD.GPSInfo))


def _write_focal_length(lens: cameras.CameraIntrinsics, details: dict[int, object]) -> None:
    """Writes it with the size of a pixel.

    Not as FocalLengthIn35mmFilm: that is a whole number, and OpenSfM prefers it.
    """
    details[_BASE.FocalLength] = _rational(lens.focal_length_x_px / lens.width_px * _SENSOR_MM)
    pixels_per_cm = _rational(lens.width_px / _SENSOR_MM * _MM_IN_CM)
    details[_BASE.FocalPlaneXResolution] = details[_BASE.FocalPlaneYResolution] = pixels_per_cm
    details[_BASE.FocalPlaneResolutionUnit] = _CM


def _write_position(position: GeoPoint, taken: datetime, gps: dict[int, object]) -> None:
    gps[_GPS.GPSVersionID] = b"\x02\x03\x00\x00"
    gps[_GPS.GPSMapDatum] = "WGS-84"
    gps[_GPS.GPSLatitudeRef] = "S" if position.latitude_deg < 0.0 else "N"
    gps[_GPS.GPSLatitude] = _degrees(position.latitude_deg)
    gps[_GPS.GPSLongitudeRef] = "W" if position.longitude_deg < 0.0 else "E"
    gps[_GPS.GPSLongitude] = _degrees(position.longitude_deg)
    if position.altitude_amsl_m is not None:
        gps[_GPS.GPSAltitudeRef] = b"\x01" if position.altitude_amsl_m < 0.0 else b"\x00"
        gps[_GPS.GPSAltitude] = _rational(abs(position.altitude_amsl_m), 1000)
    seconds = IFDRational(taken.second * _MICRO + taken.microsecond, _MICRO)
    gps[_GPS.GPSTimeStamp] = (IFDRational(taken.hour, 1), IFDRational(taken.minute, 1), seconds)
    gps[_GPS.GPSDateStamp] = f"{taken:%Y:%m:%d}"


def _write_direction(direction: Angles, gps: dict[int, object]) -> None:
    gps[_GPS.GPSImgDirectionRef] = "T"
    gps[_GPS.GPSImgDirection] = _rational(round(math.degrees(direction.heading_rad), 2) % 360.0, 100)


def _rational(value: float, denominator: int = _MICRO) -> IFDRational:
    return IFDRational(round(value * denominator), denominator)


def _degrees(angle_deg: float) -> tuple[IFDRational, IFDRational, IFDRational]:
    minutes, seconds = divmod(round(abs(angle_deg) * 3600 * _SECONDS), 60 * _SECONDS)
    degrees, minutes = divmod(minutes, 60)
    return IFDRational(degrees, 1), IFDRational(minutes, 1), IFDRational(seconds, _SECONDS)


def xmp(image: cameras.Image) -> bytes:
    """Returns the attitude in the tags of Pix4D, which OpenDroneMap reads; nothing where it is not known."""
    if image.camera is None:
        return b""
    direction = angles(image.camera.pose.orientation)
    yaw, pitch, roll = (
        f"{math.degrees(angle):.3f}" for angle in (direction.yaw_rad, direction.pitch_rad, direction.roll_rad)
    )
    return (
        '<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        '<rdf:Description rdf:about="" xmlns:Camera="http://pix4d.com/camera/1.0/" '
        f'Camera:Yaw="{yaw}" Camera:Pitch="{pitch}" Camera:Roll="{roll}"/>'
        '</rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()
