"""Between a picture and the messages of its stream: what it is, and its bytes in pieces."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

from ual.cameras import Image, ImageFormat, ImageKind
from ual.errors import NotSupportedError, UalError
from ual.geometry import PoseStamped
from ual.v1 import camera_pb2 as pb
from ual.v1 import ual_pb2
from ual.wire import camera as wire
from ual.wire import convert, uav

CHUNK_BYTES = 64 << 10
"""Bytes of a picture in one message: other traffic of the connection waits for no more than one of them."""
_FORMATS: Mapping[int, ImageFormat] = {each.value: each for each in ImageFormat}


def image_to_protos(image: Image) -> Iterator[pb.GetImageResponse]:
    """Yields the messages of a picture: what it is, and its bytes in pieces."""
    info = pb.ImageInfo(
        format=pb.ImageFormat.ValueType(image.format.value),
        width_px=image.width_px,
        height_px=image.height_px,
        intrinsics=None if image.intrinsics is None else wire.camera_intrinsics_to_proto(image.intrinsics),
        body=_pose_to_proto(image.body),
        camera=_pose_to_proto(image.camera),
        position_geo=None if image.position_geo is None else uav.geo_point_to_proto(image.position_geo),
        size_bytes=len(image.data),
        kind=wire.image_kind_to_proto(image.kind, "kind"),
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
    if wire.image_kind_from_proto(info.kind, "kind") is not wanted:
        raise NotSupportedError(f"the daemon knows no pictures of the kind {wanted.name.lower()}: update it")
    encoding = _FORMATS.get(info.format)
    if encoding is None:
        raise UalError(f"the daemon sent a picture in the format {info.format}, which this client does not know")
    return Image(
        data,
        encoding,
        info.width_px,
        info.height_px,
        convert.stamp_from_proto(info.stamp),
        wire.camera_intrinsics_from_proto(info.intrinsics) if info.HasField("intrinsics") else None,
        _pose(info, "body"),
        _pose(info, "camera"),
        uav.geo_point_from_proto(info.position_geo) if info.HasField("position_geo") else None,
        wanted,
    )


def _pose_to_proto(pose: PoseStamped | None) -> ual_pb2.PoseStamped | None:
    return None if pose is None else convert.pose_stamped_to_proto(pose)


def _pose(info: pb.ImageInfo, name: Literal["body", "camera"]) -> PoseStamped | None:
    return convert.pose_stamped_from_proto(getattr(info, name), name) if info.HasField(name) else None
