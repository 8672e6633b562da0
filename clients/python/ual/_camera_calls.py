"""The calls of `CameraService` about one camera: one function for each member of `ual.interface.Camera`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ual._calls import Call, built, of
from ual.cameras import CameraMode, CameraStatus, Image, ImageKind, Photo, VideoStream
from ual.v1 import camera_pb2 as pb
from ual.wire import cameras as convert


def status(camera: int) -> Call[CameraStatus]:
    def read(response: pb.GetCameraStatusResponse) -> CameraStatus:
        return convert.status_from_proto(response.status)

    request = _of(pb.GetCameraStatusRequest, camera)
    return of("GetCameraStatus", request, read)


def take_photo(camera: int) -> Call[Photo]:
    def read(response: pb.TakePhotoResponse) -> Photo:
        return convert.photo_from_proto(response.photo)

    return of("TakePhoto", _of(pb.TakePhotoRequest, camera), read)


def start_photos(camera: int, interval_s: float | None, distance_m: float | None, count: int) -> Call[None]:
    request = built(
        lambda: pb.StartPhotosRequest(camera=camera, interval_s=interval_s, distance_m=distance_m, count=count),
        "interval_s",
    )
    return _order("StartPhotos", request)


def stop_photos(camera: int) -> Call[None]:
    return _order("StopPhotos", _of(pb.StopPhotosRequest, camera))


def start_video(camera: int) -> Call[None]:
    return _order("StartVideo", _of(pb.StartVideoRequest, camera))


def stop_video(camera: int) -> Call[None]:
    return _order("StopVideo", _of(pb.StopVideoRequest, camera))


def set_mode(camera: int, mode: CameraMode) -> Call[None]:
    request = built(lambda: pb.SetCameraModeRequest(camera=camera, mode=convert.mode_to_proto(mode)), "mode", mode)
    return _order("SetCameraMode", request)


def set_zoom(camera: int, percent: float) -> Call[None]:
    request = built(lambda: pb.SetCameraZoomRequest(camera=camera, percent=percent), "percent", percent)
    return _order("SetCameraZoom", request)


def set_focus(camera: int, percent: float | None) -> Call[None]:
    request = built(lambda: pb.SetCameraFocusRequest(camera=camera, percent=percent), "percent", percent)
    return _order("SetCameraFocus", request)


def photos(camera: int, first: int) -> Call[list[Photo]]:
    def read(response: pb.ListPhotosResponse) -> list[Photo]:
        return [convert.photo_from_proto(each) for each in response.photos]

    request = built(lambda: pb.ListPhotosRequest(camera=camera, first=first), "first", first)
    return of("ListPhotos", request, read)


def streams(camera: int) -> Call[list[VideoStream]]:
    def read(response: pb.ListVideoStreamsResponse) -> list[VideoStream]:
        return [convert.stream_from_proto(each) for each in response.streams]

    return of("ListVideoStreams", _of(pb.ListVideoStreamsRequest, camera), read)


def image(camera: int, photo: int | None, kind: ImageKind, max_age_s: float) -> Call[Image]:
    def read(messages: Sequence[pb.GetImageResponse]) -> Image:
        return convert.image_from_protos(messages, kind)

    wanted = convert.kind_to_proto(kind)
    request = built(
        lambda: pb.GetImageRequest(camera=camera, photo=photo, kind=wanted, max_age_s=max_age_s), "photo", photo
    )
    return of("GetImage", request, read, is_stream=True)


def _of(make: Callable[..., Any], camera: int) -> Any:  # noqa: ANN401 (the request of a method)
    return built(lambda: make(camera=camera), "camera", camera)


def _order(method: str, request: Any) -> Call[None]:  # noqa: ANN401 (the request of a method)
    return of(method, request, lambda _: None)


BOUND = "number"
"""What each client's object has, and each call takes first: the number of the camera."""
MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {
    "status": status,
    "take_photo": take_photo,
    "start_photos": start_photos,
    "stop_photos": stop_photos,
    "start_video": start_video,
    "stop_video": stop_video,
    "set_mode": set_mode,
    "set_zoom": set_zoom,
    "set_focus": set_focus,
    "photos": photos,
    "streams": streams,
    "image": image,
}
"""The members of `ual.interface.Camera`, each with its call."""
