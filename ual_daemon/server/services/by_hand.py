"""The methods that are more than unpack, call and pack."""

from __future__ import annotations

from collections.abc import AsyncIterator, Generator
from typing import cast

from typing_extensions import override

from ual.v1 import camera_pb2, camera_pb2_grpc, corrections_pb2, corrections_pb2_grpc, fence_pb2, fence_pb2_grpc
from ual.wire import camera, corrections, fence, images
from ual_daemon.extensions.base import lease_of
from ual_daemon.server.services.waiting import answer
from ual_daemon.server.transport.base import ServedCall
from ual_daemon.services.cameras import VehicleCameras
from ual_daemon.services.corrections import CorrectionsStream, VehicleCorrections
from ual_daemon.services.fence import VehicleFence


class CameraServiceBase(camera_pb2_grpc.CameraServiceServicer):
    """A picture is sent in pieces."""

    _of_vehicle: VehicleCameras

    @override
    async def GetImage(
        self, request: camera_pb2.GetImageRequest, context: object
    ) -> AsyncIterator[camera_pb2.GetImageResponse]:
        photo = request.photo if request.HasField("photo") else None
        kind = camera.image_kind_from_proto(request.kind, "kind")
        making = self._of_vehicle.image(request.camera, photo, kind, request.max_age_s)
        for message in images.image_to_protos(await answer(making, "GetImage")):
            yield message


class CorrectionsServiceBase(corrections_pb2_grpc.CorrectionsServiceServicer):
    """Corrections are taken where they are received."""

    _of_vehicle: VehicleCorrections

    @override
    def StreamCorrections(  # type: ignore[override] # each is taken where it was received: see `dispatch`
        self, request_iterator: None, context: object
    ) -> Generator[None, corrections_pb2.StreamCorrectionsRequest | None, corrections_pb2.StreamCorrectionsResponse]:
        stream: CorrectionsStream | None = None
        try:
            while (request := (yield)) is not None:
                if stream is None:
                    stream = self._of_vehicle.open(request.sender or _caller(context))
                stream.send(request.rtcm)
        finally:
            if stream is not None:
                stream.close()
        status = corrections.corrections_status_to_proto(self._of_vehicle.status())
        return corrections_pb2.StreamCorrectionsResponse(status=status)


def _caller(context: object) -> str:
    """Returns by what name a program is known that gave none."""
    call = cast("ServedCall", context)
    return call.identity or call.peer()


class FenceServiceBase(fence_pb2_grpc.FenceServiceServicer):
    """One method switches the fence on and off."""

    _of_vehicle: VehicleFence

    @override
    async def EnableFence(
        self, request: fence_pb2.EnableFenceRequest, context: object
    ) -> fence_pb2.EnableFenceResponse:
        switch = self._of_vehicle.enable if request.enable else self._of_vehicle.disable
        found = await answer(switch(lease_id=lease_of(context)), "EnableFence")
        return fence_pb2.EnableFenceResponse(fence=fence.kept_fence_to_proto(found))
