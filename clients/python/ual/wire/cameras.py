"""Between the messages of `CameraService` and the value types."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from enum import Enum
from typing import TypeVar

from ual.cameras import (
    CameraAbility,
    CameraInfo,
    CameraIntrinsics,
    CameraMode,
    CameraStatus,
    CameraStorage,
    Image,
    ImageFormat,
    ImageKind,
    Photo,
    StorageState,
    VideoStream,
)
from ual.errors import InvalidArgumentError, NotSupportedError, UalError
from ual.geometry import PoseStamped
from ual.types import GeoPoint
from ual.v1 import camera_pb2 as pb
from ual.v1 import ual_pb2
from ual.wire import convert

E = TypeVar("E", bound=Enum)

CHUNK_BYTES = 64 << 10
"""How many bytes of a picture one message has: what else the connection carries waits for no more than one of them."""


def info_to_proto(info: CameraInfo) -> pb.Camera:
    """Makes a message."""
    return pb.Camera(
        number=info.number,
        name=info.name,
        firmware_version=info.firmware_version,
        abilities=[pb.CameraAbility.ValueType(each.value) for each in sorted(info.abilities, key=lambda it: it.value)],
        is_connected=info.is_connected,
        width_px=info.width_px,
        height_px=info.height_px,
        intrinsics=_intrinsics_to_proto(info.intrinsics),
        note=info.note,
        image_kinds=[kind_to_proto(each) for each in sorted(info.image_kinds, key=lambda it: it.value)],
    )


def info_from_proto(message: pb.Camera) -> CameraInfo:
    """Reads a message. Abilities and kinds of pictures that this version does not know are left out."""
    return CameraInfo(
        message.number,
        message.name,
        _all_known(CameraAbility, message.abilities),
        message.is_connected,
        message.firmware_version,
        message.width_px,
        message.height_px,
        _intrinsics_from_proto(message),
        message.note,
        _all_known(ImageKind, message.image_kinds),
    )


def status_to_proto(status: CameraStatus) -> pb.CameraStatus:
    """Makes a message."""
    storage = status.storage
    return pb.CameraStatus(
        mode=pb.CameraMode.ValueType(0 if status.mode is None else status.mode.value),
        is_taking_photos=status.is_taking_photos,
        interval_s=status.interval_s,
        distance_m=status.distance_m,
        is_recording=status.is_recording,
        recording_s=status.recording_s,
        photos_count=status.photos_count,
        missed_count=status.missed_count,
        storage=pb.CameraStorage(
            state=pb.StorageState.ValueType(0 if storage.state is None else storage.state.value),
            total_mib=storage.total_mib,
            available_mib=storage.available_mib,
        ),
        zoom_percent=status.zoom_percent,
        focus_percent=status.focus_percent,
        battery_percent=status.battery_percent,
    )


def status_from_proto(message: pb.CameraStatus) -> CameraStatus:
    """Reads a message."""
    has, storage = message.HasField, message.storage
    return CameraStatus(
        _known(CameraMode, message.mode),
        message.is_taking_photos,
        message.interval_s if has("interval_s") else None,
        message.distance_m if has("distance_m") else None,
        message.is_recording,
        message.recording_s,
        message.photos_count,
        message.missed_count,
        CameraStorage(
            _known(StorageState, storage.state),
            storage.total_mib if storage.HasField("total_mib") else None,
            storage.available_mib if storage.HasField("available_mib") else None,
        ),
        message.zoom_percent if has("zoom_percent") else None,
        message.focus_percent if has("focus_percent") else None,
        message.battery_percent if has("battery_percent") else None,
    )


def mode_to_proto(mode: CameraMode) -> pb.CameraMode.ValueType:
    """Makes a value of the enum."""
    if not isinstance(mode, CameraMode):
        raise InvalidArgumentError(f"mode: {mode!r:.80} is no CameraMode", {"field": "mode"})
    return pb.CameraMode.ValueType(mode.value)


def mode_from_proto(value: pb.CameraMode.ValueType) -> CameraMode:
    """Reads a value of the enum. Raises `InvalidArgumentError` for one that is not known, or not set."""
    mode = _known(CameraMode, value)
    if mode is None:
        known = ", ".join(each.name for each in CameraMode)
        raise InvalidArgumentError(f"mode: {value} is none of {known}", {"field": "mode"})
    return mode


def kind_to_proto(kind: ImageKind) -> pb.ImageKind.ValueType:
    """Makes a value of the enum."""
    if not isinstance(kind, ImageKind):
        raise InvalidArgumentError(f"kind: {kind!r:.80} is no ImageKind", {"field": "kind"})
    return pb.ImageKind.ValueType(kind.value)


def kind_from_proto(value: pb.ImageKind.ValueType) -> ImageKind:
    """Reads a value of the enum: colours where it is not set.

    Raises:
        InvalidArgumentError: It is not known.

    """
    kind = ImageKind.COLOUR if value == pb.IMAGE_KIND_UNSPECIFIED else _known(ImageKind, value)
    if kind is None:
        known = ", ".join(each.name for each in ImageKind)
        raise InvalidArgumentError(f"kind: {value} is none of {known}", {"field": "kind"})
    return kind


def photo_to_proto(photo: Photo) -> pb.Photo:
    """Makes a message."""
    message = pb.Photo(
        number=photo.number,
        is_stored=photo.is_stored,
        body=_pose_to_proto(photo.body),
        camera=_pose_to_proto(photo.camera),
        position_geo=_geo_to_proto(photo.position_geo),
        file_url=photo.file_url,
    )
    convert.stamp_to_proto(photo.stamp_s, message.stamp)
    return message


def photo_from_proto(message: pb.Photo) -> Photo:
    """Reads a message."""
    return Photo(
        message.number,
        convert.stamp_from_proto(message.stamp),
        message.is_stored,
        _pose(message, "body"),
        _pose(message, "camera"),
        _geo(message),
        message.file_url,
    )


def stream_to_proto(stream: VideoStream) -> pb.VideoStream:
    """Makes a message."""
    return pb.VideoStream(
        name=stream.name,
        url=stream.url,
        encoding=stream.encoding,
        width_px=stream.width_px,
        height_px=stream.height_px,
        rate_hz=stream.rate_hz,
        is_running=stream.is_running,
        is_thermal=stream.is_thermal,
    )


def stream_from_proto(message: pb.VideoStream) -> VideoStream:
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


def image_to_protos(image: Image) -> Iterator[pb.GetImageResponse]:
    """Yields the messages of a picture: what it is, and its bytes in pieces."""
    info = pb.ImageInfo(
        format=pb.ImageFormat.ValueType(image.format.value),
        width_px=image.width_px,
        height_px=image.height_px,
        intrinsics=_intrinsics_to_proto(image.intrinsics),
        body=_pose_to_proto(image.body),
        camera=_pose_to_proto(image.camera),
        position_geo=_geo_to_proto(image.position_geo),
        size_bytes=len(image.data),
        kind=kind_to_proto(image.kind),
    )
    convert.stamp_to_proto(image.stamp_s, info.stamp)
    yield pb.GetImageResponse(info=info)
    for begin in range(0, len(image.data), CHUNK_BYTES):
        yield pb.GetImageResponse(data=image.data[begin : begin + CHUNK_BYTES])


def image_from_protos(messages: Sequence[pb.GetImageResponse], wanted: ImageKind = ImageKind.COLOUR) -> Image:
    """Joins the messages of a picture.

    Raises:
        NotSupportedError: It is of another kind than was wanted: an older daemon knows only colours.
        UalError: They are not those of one picture.

    """
    data = b"".join(each.data for each in messages[1:])
    if not messages or not messages[0].HasField("info") or len(data) != messages[0].info.size_bytes:
        raise UalError("the daemon sent another number of bytes than the picture has")
    info = messages[0].info
    if kind_from_proto(info.kind) is not wanted:
        raise NotSupportedError(f"the daemon knows no pictures of the kind {wanted.name.lower()}: update it")
    encoding = _known(ImageFormat, info.format)
    if encoding is None:
        raise UalError(f"the daemon sent a picture in the format {info.format}, which this client does not know")
    return Image(
        data,
        encoding,
        info.width_px,
        info.height_px,
        convert.stamp_from_proto(info.stamp),
        _intrinsics_from_proto(info),
        _pose(info, "body"),
        _pose(info, "camera"),
        _geo(info),
        wanted,
    )


def _intrinsics_to_proto(found: CameraIntrinsics | None) -> pb.CameraIntrinsics | None:
    if found is None:
        return None
    return pb.CameraIntrinsics(
        width_px=found.width_px,
        height_px=found.height_px,
        focal_length_x_px=found.focal_length_x_px,
        focal_length_y_px=found.focal_length_y_px,
        centre_x_px=found.centre_x_px,
        centre_y_px=found.centre_y_px,
    )


def _intrinsics_from_proto(owner: pb.Camera | pb.ImageInfo) -> CameraIntrinsics | None:
    if not owner.HasField("intrinsics"):
        return None
    found = owner.intrinsics
    return CameraIntrinsics(
        found.width_px,
        found.height_px,
        found.focal_length_x_px,
        found.focal_length_y_px,
        found.centre_x_px,
        found.centre_y_px,
    )


def _pose_to_proto(pose: PoseStamped | None) -> ual_pb2.PoseStamped | None:
    return None if pose is None else convert.pose_stamped_to_proto(pose)


def _pose(owner: pb.Photo | pb.ImageInfo, name: str) -> PoseStamped | None:
    is_set = any(field.name == name for field, _ in owner.ListFields())
    return convert.pose_stamped_from_proto(getattr(owner, name), name) if is_set else None


def _geo_to_proto(place: GeoPoint | None) -> ual_pb2.GeoPoint | None:
    return None if place is None else convert.geo_point_to_proto(place)


def _geo(owner: pb.Photo | pb.ImageInfo) -> GeoPoint | None:
    return convert.geo_point_from_proto(owner.position_geo) if owner.HasField("position_geo") else None


def _known(kind: type[E], number: int) -> E | None:
    """Returns the member of a number; None for one that is not set, or that this version does not know."""
    return next((each for each in kind if each.value == number), None)


def _all_known(kind: type[E], numbers: Iterable[int]) -> frozenset[E]:
    found = (_known(kind, each) for each in numbers)
    return frozenset(each for each in found if each is not None)
