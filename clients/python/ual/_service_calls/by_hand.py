"""The calls that are more than a request and its response."""

from __future__ import annotations

from collections.abc import Sequence

from ual._calls import Call, of, request
from ual.cameras import Image, ImageKind
from ual.fences.values import KeptFence
from ual.v1 import camera_pb2, fence_pb2
from ual.wire import camera as wire_camera
from ual.wire import fence as wire_fence
from ual.wire.images import image_from_protos


def camera_image(camera: int, photo: int | None, kind: ImageKind, max_age_s: float) -> Call[Image]:
    """A picture, which comes as a stream of pieces."""

    def read(messages: Sequence[camera_pb2.GetImageResponse]) -> Image:
        return image_from_protos(messages, kind)

    number = wire_camera.image_kind_to_proto(kind, "kind")
    wanted = request(camera_pb2.GetImageRequest, camera=camera, photo=photo, kind=number, max_age_s=max_age_s)
    return of("GetImage", wanted, read, is_stream=True)


def fence_enable() -> Call[KeptFence]:
    """One method switches the fence on and off."""
    return _enabled(is_on=True)


def fence_disable() -> Call[KeptFence]:
    """See `fence_enable`."""
    return _enabled(is_on=False)


def _enabled(*, is_on: bool) -> Call[KeptFence]:
    def read(response: fence_pb2.EnableFenceResponse) -> KeptFence:
        return wire_fence.kept_fence_from_proto(response.fence)

    return of("EnableFence", fence_pb2.EnableFenceRequest(enable=is_on), read)
