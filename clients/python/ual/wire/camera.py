"""Between the messages of ``camera.proto`` and their values. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Mapping

from ual.contract.camera import (
    CameraAbility,
    CameraInfo,
    CameraIntrinsics,
    CameraMode,
    CameraStatus,
    CameraStorage,
    ImageKind,
    Photo,
    StorageState,
    VideoStream,
)
from ual.v1 import camera_pb2 as pb
from ual.wire import convert, uav
from ual.wire.enums import member_of, number_of

_CAMERA_ABILITY: Mapping[int, CameraAbility] = {each.value: each for each in CameraAbility}

_CAMERA_MODE: Mapping[int, CameraMode] = {each.value: each for each in CameraMode}

_STORAGE_STATE: Mapping[int, StorageState] = {each.value: each for each in StorageState}

_IMAGE_KIND: Mapping[int, ImageKind] = {each.value: each for each in ImageKind}


def camera_mode_to_proto(value: CameraMode, field: str) -> pb.CameraMode.ValueType:
    """Makes a number of an enum. Raises `InvalidArgumentError` for what is no member of it."""
    return pb.CameraMode.ValueType(number_of(value, CameraMode, field))


def camera_mode_from_proto(number: int, field: str) -> CameraMode:
    """Reads a number of an enum. Raises `InvalidArgumentError` for one that is not known, or not set."""
    return member_of(number, _CAMERA_MODE, field)


def image_kind_to_proto(value: ImageKind, field: str) -> pb.ImageKind.ValueType:
    """Makes a number of an enum. Raises `InvalidArgumentError` for what is no member of it."""
    return pb.ImageKind.ValueType(number_of(value, ImageKind, field))


def image_kind_from_proto(number: int, field: str) -> ImageKind:
    """Reads a number of an enum. Raises `InvalidArgumentError` for one that is not known, or not set."""
    return member_of(number, _IMAGE_KIND, field, ImageKind.COLOUR)


def camera_intrinsics_to_proto(value: CameraIntrinsics) -> pb.CameraIntrinsics:
    """Makes a message."""
    return pb.CameraIntrinsics(
        width_px=value.width_px,
        height_px=value.height_px,
        focal_length_x_px=value.focal_length_x_px,
        focal_length_y_px=value.focal_length_y_px,
        centre_x_px=value.centre_x_px,
        centre_y_px=value.centre_y_px,
    )


def camera_intrinsics_from_proto(message: pb.CameraIntrinsics) -> CameraIntrinsics:
    """Reads a message."""
    return CameraIntrinsics(
        message.width_px,
        message.height_px,
        message.focal_length_x_px,
        message.focal_length_y_px,
        message.centre_x_px,
        message.centre_y_px,
    )


def camera_storage_to_proto(value: CameraStorage) -> pb.CameraStorage:
    """Makes a message."""
    return pb.CameraStorage(
        state=pb.StorageState.ValueType(0 if value.state is None else value.state.value),
        total_mib=value.total_mib,
        available_mib=value.available_mib,
    )


def camera_storage_from_proto(message: pb.CameraStorage) -> CameraStorage:
    """Reads a message."""
    return CameraStorage(
        _STORAGE_STATE.get(message.state),
        message.total_mib if message.HasField("total_mib") else None,
        message.available_mib if message.HasField("available_mib") else None,
    )


def photo_to_proto(value: Photo) -> pb.Photo:
    """Makes a message."""
    return pb.Photo(
        number=value.number,
        stamp=convert.timestamp_to_proto(value.stamp_s),
        is_stored=value.is_stored,
        body=None if value.body is None else convert.pose_stamped_to_proto(value.body),
        camera=None if value.camera is None else convert.pose_stamped_to_proto(value.camera),
        position_geo=None if value.position_geo is None else uav.geo_point_to_proto(value.position_geo),
        file_url=value.file_url,
    )


def photo_from_proto(message: pb.Photo) -> Photo:
    """Reads a message."""
    return Photo(
        message.number,
        convert.stamp_from_proto(message.stamp),
        message.is_stored,
        convert.pose_stamped_from_proto(message.body, "body") if message.HasField("body") else None,
        convert.pose_stamped_from_proto(message.camera, "camera") if message.HasField("camera") else None,
        uav.geo_point_from_proto(message.position_geo) if message.HasField("position_geo") else None,
        message.file_url,
    )


def video_stream_to_proto(value: VideoStream) -> pb.VideoStream:
    """Makes a message."""
    return pb.VideoStream(
        name=value.name,
        url=value.url,
        encoding=value.encoding,
        width_px=value.width_px,
        height_px=value.height_px,
        rate_hz=value.rate_hz,
        is_running=value.is_running,
        is_thermal=value.is_thermal,
    )


def video_stream_from_proto(message: pb.VideoStream) -> VideoStream:
    """Reads a message."""
    return VideoStream(
        message.name,
        message.url,
        message.encoding,
        message.width_px,
        message.height_px,
        message.rate_hz,
        message.is_running,
        message.is_thermal,
    )


def camera_info_to_proto(value: CameraInfo) -> pb.Camera:
    """Makes a message."""
    return pb.Camera(
        number=value.number,
        name=value.name,
        abilities=[pb.CameraAbility.ValueType(each) for each in sorted(each.value for each in value.abilities)],
        is_connected=value.is_connected,
        firmware_version=value.firmware_version,
        width_px=value.width_px,
        height_px=value.height_px,
        intrinsics=None if value.intrinsics is None else camera_intrinsics_to_proto(value.intrinsics),
        note=value.note,
        image_kinds=[pb.ImageKind.ValueType(each) for each in sorted(each.value for each in value.image_kinds)],
    )


def camera_info_from_proto(message: pb.Camera) -> CameraInfo:
    """Reads a message."""
    return CameraInfo(
        message.number,
        message.name,
        frozenset(_CAMERA_ABILITY[each] for each in message.abilities if each in _CAMERA_ABILITY),
        message.is_connected,
        message.firmware_version,
        message.width_px,
        message.height_px,
        camera_intrinsics_from_proto(message.intrinsics) if message.HasField("intrinsics") else None,
        message.note,
        frozenset(_IMAGE_KIND[each] for each in message.image_kinds if each in _IMAGE_KIND),
    )


def camera_status_to_proto(value: CameraStatus) -> pb.CameraStatus:
    """Makes a message."""
    return pb.CameraStatus(
        mode=pb.CameraMode.ValueType(0 if value.mode is None else value.mode.value),
        is_taking_photos=value.is_taking_photos,
        interval_s=value.interval_s,
        distance_m=value.distance_m,
        is_recording=value.is_recording,
        recording_s=value.recording_s,
        photos_count=value.photos_count,
        missed_count=value.missed_count,
        storage=camera_storage_to_proto(value.storage),
        zoom_percent=value.zoom_percent,
        focus_percent=value.focus_percent,
        battery_percent=value.battery_percent,
    )


def camera_status_from_proto(message: pb.CameraStatus) -> CameraStatus:
    """Reads a message."""
    return CameraStatus(
        _CAMERA_MODE.get(message.mode),
        message.is_taking_photos,
        message.interval_s if message.HasField("interval_s") else None,
        message.distance_m if message.HasField("distance_m") else None,
        message.is_recording,
        message.recording_s,
        message.photos_count,
        message.missed_count,
        camera_storage_from_proto(message.storage),
        message.zoom_percent if message.HasField("zoom_percent") else None,
        message.focus_percent if message.HasField("focus_percent") else None,
        message.battery_percent if message.HasField("battery_percent") else None,
    )
