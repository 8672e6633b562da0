"""The calls of `ual.interface.Cameras` and `ual.interface.Camera`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual._calls import Call, nothing, of, request
from ual._service_calls.by_hand import camera_image
from ual.cameras import CameraInfo, CameraMode, CameraStatus, Photo, VideoStream
from ual.v1 import camera_pb2 as pb
from ual.wire import camera as wire

image = camera_image


def status(camera: int) -> Call[CameraStatus]:
    return of(
        "GetCameraStatus",
        request(pb.GetCameraStatusRequest, camera=camera),
        lambda response: wire.camera_status_from_proto(response.status),
    )


def take_photo(camera: int) -> Call[Photo]:
    return of(
        "TakePhoto", request(pb.TakePhotoRequest, camera=camera), lambda response: wire.photo_from_proto(response.photo)
    )


def start_photos(camera: int, interval_s: float | None, distance_m: float | None, count: int) -> Call[None]:
    return of(
        "StartPhotos",
        request(pb.StartPhotosRequest, camera=camera, interval_s=interval_s, distance_m=distance_m, count=count),
        nothing,
    )


def stop_photos(camera: int) -> Call[None]:
    return of("StopPhotos", request(pb.StopPhotosRequest, camera=camera), nothing)


def start_video(camera: int) -> Call[None]:
    return of("StartVideo", request(pb.StartVideoRequest, camera=camera), nothing)


def stop_video(camera: int) -> Call[None]:
    return of("StopVideo", request(pb.StopVideoRequest, camera=camera), nothing)


def set_mode(camera: int, mode: CameraMode) -> Call[None]:
    return of(
        "SetCameraMode",
        request(pb.SetCameraModeRequest, camera=camera, mode=wire.camera_mode_to_proto(mode, "mode")),
        nothing,
    )


def set_zoom(camera: int, percent: float) -> Call[None]:
    return of("SetCameraZoom", request(pb.SetCameraZoomRequest, camera=camera, percent=percent), nothing)


def set_focus(camera: int, percent: float | None) -> Call[None]:
    return of("SetCameraFocus", request(pb.SetCameraFocusRequest, camera=camera, percent=percent), nothing)


def photos(camera: int, first: int) -> Call[list[Photo]]:
    return of(
        "ListPhotos",
        request(pb.ListPhotosRequest, camera=camera, first=first),
        lambda response: list(map(wire.photo_from_proto, response.photos)),
    )


def streams(camera: int) -> Call[list[VideoStream]]:
    return of(
        "ListVideoStreams",
        request(pb.ListVideoStreamsRequest, camera=camera),
        lambda response: list(map(wire.video_stream_from_proto, response.streams)),
    )


def get_all() -> Call[list[CameraInfo]]:
    return of(
        "ListCameras",
        pb.ListCamerasRequest(),
        lambda response: list(map(wire.camera_info_from_proto, response.cameras)),
    )
