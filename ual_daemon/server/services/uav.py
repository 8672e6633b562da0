"""Methods that are unpack, call and pack. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Awaitable
from typing import TYPE_CHECKING

from typing_extensions import override

from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc
from ual.wire import convert, samples
from ual.wire import uav as wire
from ual_daemon.extensions.base import lease_of
from ual_daemon.server.waiting import after

if TYPE_CHECKING:
    from ual_daemon.choice import ServedVehicle


class UalServicerBase(ual_pb2_grpc.UalServiceServicer):
    """Methods that the vehicle answers by itself."""

    _vehicle: ServedVehicle

    @override
    def GetInfo(self, request: pb.GetInfoRequest, context: object) -> pb.GetInfoResponse:
        result = self._vehicle.info()
        return wire.info_to_proto(result)

    @override
    def GetTelemetry(self, request: pb.GetTelemetryRequest, context: object) -> pb.GetTelemetryResponse:
        result = self._vehicle.telemetry()
        return pb.GetTelemetryResponse(telemetry=samples.telemetry_to_proto(result))

    @override
    def GetTransform(self, request: pb.GetTransformRequest, context: object) -> pb.GetTransformResponse:
        result = self._vehicle.transform(request.target_frame_id, request.source_frame_id)
        return pb.GetTransformResponse(transform=convert.transform_to_proto(result))

    @override
    def ListFrames(self, request: pb.ListFramesRequest, context: object) -> pb.ListFramesResponse:
        result = self._vehicle.frames()
        return pb.ListFramesResponse(frames=map(wire.frame_to_proto, result))

    @override
    def GetGeofence(self, request: pb.GetGeofenceRequest, context: object) -> pb.GetGeofenceResponse:
        result = self._vehicle.geofence()
        return pb.GetGeofenceResponse(geofence=wire.geofence_to_proto(result))

    @override
    def SetHome(self, request: pb.SetHomeRequest, context: object) -> pb.SetHomeResponse:
        self._vehicle.commands.set_home(request.set_z, lease_of(context))
        return pb.SetHomeResponse()

    @override
    def Arm(self, request: pb.ArmRequest, context: object) -> Awaitable[pb.ArmResponse]:
        return after(self._vehicle.commands.arm(lease_of(context)), pb.ArmResponse())

    @override
    def Disarm(self, request: pb.DisarmRequest, context: object) -> Awaitable[pb.DisarmResponse]:
        return after(self._vehicle.commands.disarm(lease_of(context)), pb.DisarmResponse())

    @override
    def Abort(self, request: pb.AbortRequest, context: object) -> pb.AbortResponse:
        self._vehicle.commands.abort(request.freeze, request.task_id, lease_of(context))
        return pb.AbortResponse()

    @override
    def Pause(self, request: pb.PauseRequest, context: object) -> pb.PauseResponse:
        self._vehicle.commands.pause(request.task_id, lease_of(context))
        return pb.PauseResponse()

    @override
    def Resume(self, request: pb.ResumeRequest, context: object) -> pb.ResumeResponse:
        self._vehicle.commands.resume(request.task_id, lease_of(context))
        return pb.ResumeResponse()
