"""`CameraService`: the cameras of a UAV."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Future
from functools import partial
from typing import Any

from typing_extensions import override

from ual.v1 import camera_pb2 as pb
from ual.v1 import camera_pb2_grpc
from ual.wire import cameras as convert
from ual_daemon.extensions.shipped.cameras import ORDER_S, VehicleCameras
from ual_daemon.extensions.shipped.vehicle import LocatedVehicle
from ual_daemon.server.shipped.waiting import ended


class CameraServicer(camera_pb2_grpc.CameraServiceServicer):
    """The cameras of one UAV. ``ual/v1/camera.proto`` describes each method."""

    def __init__(self, vehicle: LocatedVehicle) -> None:
        self._cameras = VehicleCameras(vehicle)

    # Names and order are those of the contract.

    @override
    async def ListCameras(self, request: pb.ListCamerasRequest, context: object) -> pb.ListCamerasResponse:
        return pb.ListCamerasResponse(cameras=map(convert.info_to_proto, self._cameras.get_all()))

    @override
    async def GetCameraStatus(self, request: pb.GetCameraStatusRequest, context: object) -> pb.GetCameraStatusResponse:
        found = await ended(self._cameras.status(request.camera), ORDER_S, "GetCameraStatus")
        return pb.GetCameraStatusResponse(status=convert.status_to_proto(found))

    @override
    async def TakePhoto(self, request: pb.TakePhotoRequest, context: object) -> pb.TakePhotoResponse:
        taken = await ended(self._cameras.take_photo(request.camera), ORDER_S, "TakePhoto")
        return pb.TakePhotoResponse(photo=convert.photo_to_proto(taken))

    @override
    async def StartPhotos(self, request: pb.StartPhotosRequest, context: object) -> pb.StartPhotosResponse:
        interval_s = request.interval_s if request.HasField("interval_s") else None
        distance_m = request.distance_m if request.HasField("distance_m") else None
        starting = self._cameras.start_photos(request.camera, interval_s, distance_m, request.count)
        await _ordered(starting, "StartPhotos")
        return pb.StartPhotosResponse()

    @override
    async def StopPhotos(self, request: pb.StopPhotosRequest, context: object) -> pb.StopPhotosResponse:
        await _ordered(self._cameras.stop_photos(request.camera), "StopPhotos")
        return pb.StopPhotosResponse()

    @override
    async def StartVideo(self, request: pb.StartVideoRequest, context: object) -> pb.StartVideoResponse:
        await _ordered(self._cameras.start_video(request.camera), "StartVideo")
        return pb.StartVideoResponse()

    @override
    async def StopVideo(self, request: pb.StopVideoRequest, context: object) -> pb.StopVideoResponse:
        await _ordered(self._cameras.stop_video(request.camera), "StopVideo")
        return pb.StopVideoResponse()

    @override
    async def SetCameraMode(self, request: pb.SetCameraModeRequest, context: object) -> pb.SetCameraModeResponse:
        mode = convert.mode_from_proto(request.mode)
        await _ordered(self._cameras.set_mode(request.camera, mode), "SetCameraMode")
        return pb.SetCameraModeResponse()

    @override
    async def SetCameraZoom(self, request: pb.SetCameraZoomRequest, context: object) -> pb.SetCameraZoomResponse:
        await _ordered(self._cameras.set_zoom(request.camera, request.percent), "SetCameraZoom")
        return pb.SetCameraZoomResponse()

    @override
    async def SetCameraFocus(self, request: pb.SetCameraFocusRequest, context: object) -> pb.SetCameraFocusResponse:
        percent = request.percent if request.HasField("percent") else None
        await _ordered(self._cameras.set_focus(request.camera, percent), "SetCameraFocus")
        return pb.SetCameraFocusResponse()

    @override
    async def ListPhotos(self, request: pb.ListPhotosRequest, context: object) -> pb.ListPhotosResponse:
        return await asyncio.to_thread(self._photos, request)  # ten thousand take 0.2 s, and setpoints wait for none

    def _photos(self, request: pb.ListPhotosRequest) -> pb.ListPhotosResponse:
        found = self._cameras.photos(request.camera, request.first)
        return pb.ListPhotosResponse(photos=map(convert.photo_to_proto, found))

    @override
    async def ListVideoStreams(
        self, request: pb.ListVideoStreamsRequest, context: object
    ) -> pb.ListVideoStreamsResponse:
        found = await ended(self._cameras.streams(request.camera), ORDER_S, "ListVideoStreams")
        return pb.ListVideoStreamsResponse(streams=map(convert.stream_to_proto, found))

    @override
    async def GetImage(self, request: pb.GetImageRequest, context: object) -> AsyncIterator[pb.GetImageResponse]:
        photo = request.photo if request.HasField("photo") else None
        kind = convert.kind_from_proto(request.kind)
        making = self._cameras.image(request.camera, photo, kind, request.max_age_s)
        image = await ended(making, ORDER_S, "GetImage")
        for message in convert.image_to_protos(image):
            yield message


async def _ordered(order: Future[None], what: str) -> None:
    await ended(order, ORDER_S, what)


def camera_service(vehicle: LocatedVehicle) -> tuple[str, Callable[[Any], None]]:
    """Returns the name of the service, and what registers its methods."""
    name: str = pb.DESCRIPTOR.services_by_name["CameraService"].full_name
    return name, partial(camera_pb2_grpc.add_CameraServiceServicer_to_server, CameraServicer(vehicle))
