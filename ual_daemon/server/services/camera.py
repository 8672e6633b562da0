"""`CameraService`: unpack, call, pack. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

import asyncio

from typing_extensions import override

from ual.v1 import camera_pb2 as pb
from ual.v1 import camera_pb2_grpc
from ual.wire import camera as wire
from ual_daemon.server.services.by_hand import CameraServiceBase
from ual_daemon.server.services.waiting import answer
from ual_daemon.services.cameras import VehicleCameras
from ual_daemon.services.vehicle import LocatedVehicle


class CameraServicer(CameraServiceBase, camera_pb2_grpc.CameraServiceServicer):
    """The methods of `CameraService` for one UAV. ``ual/v1/camera.proto`` describes each of them."""

    def __init__(self, vehicle: LocatedVehicle) -> None:
        self._of_vehicle = VehicleCameras(vehicle)

    @override
    async def GetCameraStatus(self, request: pb.GetCameraStatusRequest, context: object) -> pb.GetCameraStatusResponse:
        result = await answer(self._of_vehicle.status(request.camera), "GetCameraStatus")
        return pb.GetCameraStatusResponse(status=wire.camera_status_to_proto(result))

    @override
    async def TakePhoto(self, request: pb.TakePhotoRequest, context: object) -> pb.TakePhotoResponse:
        result = await answer(self._of_vehicle.take_photo(request.camera), "TakePhoto")
        return pb.TakePhotoResponse(photo=wire.photo_to_proto(result))

    @override
    async def StartPhotos(self, request: pb.StartPhotosRequest, context: object) -> pb.StartPhotosResponse:
        await answer(
            self._of_vehicle.start_photos(
                request.camera,
                interval_s=request.interval_s if request.HasField("interval_s") else None,
                distance_m=request.distance_m if request.HasField("distance_m") else None,
                count=request.count,
            ),
            "StartPhotos",
        )
        return pb.StartPhotosResponse()

    @override
    async def StopPhotos(self, request: pb.StopPhotosRequest, context: object) -> pb.StopPhotosResponse:
        await answer(self._of_vehicle.stop_photos(request.camera), "StopPhotos")
        return pb.StopPhotosResponse()

    @override
    async def StartVideo(self, request: pb.StartVideoRequest, context: object) -> pb.StartVideoResponse:
        await answer(self._of_vehicle.start_video(request.camera), "StartVideo")
        return pb.StartVideoResponse()

    @override
    async def StopVideo(self, request: pb.StopVideoRequest, context: object) -> pb.StopVideoResponse:
        await answer(self._of_vehicle.stop_video(request.camera), "StopVideo")
        return pb.StopVideoResponse()

    @override
    async def SetCameraMode(self, request: pb.SetCameraModeRequest, context: object) -> pb.SetCameraModeResponse:
        await answer(
            self._of_vehicle.set_mode(request.camera, mode=wire.camera_mode_from_proto(request.mode, "mode")),
            "SetCameraMode",
        )
        return pb.SetCameraModeResponse()

    @override
    async def SetCameraZoom(self, request: pb.SetCameraZoomRequest, context: object) -> pb.SetCameraZoomResponse:
        await answer(self._of_vehicle.set_zoom(request.camera, percent=request.percent), "SetCameraZoom")
        return pb.SetCameraZoomResponse()

    @override
    async def SetCameraFocus(self, request: pb.SetCameraFocusRequest, context: object) -> pb.SetCameraFocusResponse:
        await answer(
            self._of_vehicle.set_focus(
                request.camera, percent=request.percent if request.HasField("percent") else None
            ),
            "SetCameraFocus",
        )
        return pb.SetCameraFocusResponse()

    @override
    async def ListPhotos(self, request: pb.ListPhotosRequest, context: object) -> pb.ListPhotosResponse:
        def made() -> pb.ListPhotosResponse:
            result = self._of_vehicle.photos(request.camera, first=request.first)
            return pb.ListPhotosResponse(photos=map(wire.photo_to_proto, result))

        return await asyncio.to_thread(made)

    @override
    async def ListVideoStreams(
        self, request: pb.ListVideoStreamsRequest, context: object
    ) -> pb.ListVideoStreamsResponse:
        result = await answer(self._of_vehicle.streams(request.camera), "ListVideoStreams")
        return pb.ListVideoStreamsResponse(streams=map(wire.video_stream_to_proto, result))

    @override
    async def ListCameras(self, request: pb.ListCamerasRequest, context: object) -> pb.ListCamerasResponse:
        result = self._of_vehicle.get_all()
        return pb.ListCamerasResponse(cameras=map(wire.camera_info_to_proto, result))
