"""Messages of a camera as values. What a camera cannot mean is left out, and noted in words.

https://mavlink.io/en/services/camera.html, version 2.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from ual.cameras import CameraAbility, CameraIntrinsics, CameraMode, CameraStorage, StorageState, VideoStream
from ual.types import GeoPoint
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

_ABILITIES = {
    mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE: CameraAbility.PHOTO,
    mavlink.CAMERA_CAP_FLAGS_CAPTURE_VIDEO: CameraAbility.VIDEO,
    mavlink.CAMERA_CAP_FLAGS_HAS_MODES: CameraAbility.MODES,
    mavlink.CAMERA_CAP_FLAGS_HAS_BASIC_ZOOM: CameraAbility.ZOOM,
    mavlink.CAMERA_CAP_FLAGS_HAS_BASIC_FOCUS: CameraAbility.FOCUS,
    mavlink.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM: CameraAbility.STREAMS,
}
_MODES = {
    mavlink.CAMERA_MODE_IMAGE: CameraMode.PHOTO,
    mavlink.CAMERA_MODE_VIDEO: CameraMode.VIDEO,
    mavlink.CAMERA_MODE_IMAGE_SURVEY: CameraMode.SURVEY,
}
MODE_NUMBERS = {mode: number for number, mode in _MODES.items()}
_STORED = {
    mavlink.STORAGE_STATUS_EMPTY: StorageState.NONE,
    mavlink.STORAGE_STATUS_UNFORMATTED: StorageState.UNUSABLE,
    mavlink.STORAGE_STATUS_READY: StorageState.READY,
}
_ENCODINGS = {mavlink.VIDEO_STREAM_ENCODING_H264: "H264", mavlink.VIDEO_STREAM_ENCODING_H265: "H265"}
_EARLIEST_S, _LATEST_S = 946_684_800.0, 4_102_444_800.0
"""The years 2000 to 2100: a camera whose clock was not set says something else."""
LEAST_FREE_MIB = 1.0
"""A storage with less room is full."""


class CameraIdentity(NamedTuple):
    """Content of a CAMERA_INFORMATION. It is on the gimbal of this id; 0: on none."""

    name: str
    firmware_version: str
    abilities: frozenset[CameraAbility]
    width_px: int
    height_px: int
    intrinsics: CameraIntrinsics | None
    gimbal_device_id: int = 0


def identity_of(message: Message) -> CameraIdentity:
    """Reads a CAMERA_INFORMATION."""
    name = " ".join(filter(None, map(_text, (message.vendor_name, message.model_name))))
    abilities = frozenset(ability for flag, ability in _ABILITIES.items() if message.flags & flag)
    version = message.firmware_version
    parts = [version >> shift & 0xFF for shift in (0, 8, 16, 24)]
    size = (message.resolution_h, message.resolution_v)
    return CameraIdentity(
        name or "camera",
        ".".join(map(str, parts)) if version else "",
        abilities,
        *size,
        _intrinsics(message),
        message.gimbal_device_id,
    )


def mode_of(message: Message) -> CameraMode | None:
    """Reads the mode of a CAMERA_SETTINGS."""
    return _MODES.get(message.mode_id)


def percent_of(value: float) -> float | None:
    """Reads a level; None where it is not known, or can be none."""
    return value if 0.0 <= value <= 100.0 else None


def battery_of(message: Message) -> float | None:
    """Reads the charge of a BATTERY_STATUS, in percent; None where the camera does not know it (-1)."""
    return percent_of(float(message.battery_remaining))


def storage_of(message: Message) -> tuple[CameraStorage, str]:
    """Reads a STORAGE_INFORMATION. Returns also what about it cannot be, in words; empty if nothing is."""
    state = _STORED.get(message.status)
    total_mib, free_mib = _size(message.total_capacity), _size(message.available_capacity)
    if total_mib is not None and free_mib is not None and free_mib > total_mib:
        words = f"its storage cannot have {free_mib:.0f} of {total_mib:.0f} MiB free, so that is not told"
        return CameraStorage(state, total_mib), words
    if state is StorageState.READY and free_mib is not None and free_mib < LEAST_FREE_MIB:
        state = StorageState.FULL
    return CameraStorage(state, total_mib, free_mib), ""


def stream_of(message: Message) -> VideoStream:
    """Reads a VIDEO_STREAM_INFORMATION."""
    return VideoStream(
        _text(message.name),
        _url(message.type, _text(message.uri)),
        _ENCODINGS.get(message.encoding, ""),
        message.resolution_h,
        message.resolution_v,
        message.framerate if 0.0 <= message.framerate < math.inf else 0.0,
        bool(message.flags & mavlink.VIDEO_STREAM_STATUS_FLAGS_RUNNING),
        bool(message.flags & mavlink.VIDEO_STREAM_STATUS_FLAGS_THERMAL),
    )


def stamp_of(message: Message) -> float | None:
    """Reads when a picture was taken, by a CAMERA_IMAGE_CAPTURED, as UTC since 1970; None where that cannot be."""
    return stamp_us(message.time_utc)


def stamp_us(time_us: int) -> float | None:
    """Reads a time as UTC since 1970; None where it is another one, as that since boot."""
    stamp_s = time_us / 1e6
    return stamp_s if _EARLIEST_S <= stamp_s <= _LATEST_S else None


def position_of(message: Message) -> GeoPoint | None:
    """Reads the place of a CAMERA_IMAGE_CAPTURED; None where the camera does not know it, or where that is none."""
    is_none = abs(message.lat) > 90e7 or abs(message.lon) > 180e7
    if is_none or (not message.lat and not message.lon):
        return None
    return GeoPoint(message.lat / 1e7, message.lon / 1e7, message.alt / 1e3, message.relative_alt / 1e3)


def url_of(message: Message) -> str:
    """Reads the address of the file of a CAMERA_IMAGE_CAPTURED."""
    return _text(message.file_url)


def _url(kind: int, uri: str) -> str:
    """Returns the address; of a stream that is sent to a port, the message has only the port."""
    return f"udp://:{uri}" if kind == mavlink.VIDEO_STREAM_TYPE_RTPUDP and uri.isdecimal() else uri


def _intrinsics(message: Message) -> CameraIntrinsics | None:
    width_px, height_px = message.resolution_h, message.resolution_v
    focal_mm, size_mm = message.focal_length, (message.sensor_size_h, message.sensor_size_v)
    if not (width_px and height_px and all(0.0 < each < math.inf for each in (focal_mm, *size_mm))):
        return None
    return CameraIntrinsics(
        width_px,
        height_px,
        focal_mm / size_mm[0] * width_px,
        focal_mm / size_mm[1] * height_px,
        (width_px - 1) / 2.0,
        (height_px - 1) / 2.0,
    )


def _size(value: float) -> float | None:
    return value if 0.0 <= value < math.inf else None


def _text(value: str | Iterable[int]) -> str:
    """Reads a text, or one that is sent as numbers. What people cannot read is left out."""
    text = value if isinstance(value, str) else bytes(value).decode("utf-8", "replace")
    return "".join(each for each in text.partition("\0")[0] if each.isprintable()).strip()
