"""`ParameterService`: unpack, call, pack. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from typing_extensions import override

from ual.v1 import parameters_pb2 as pb
from ual.v1 import parameters_pb2_grpc
from ual.wire import parameters as wire
from ual_daemon.extensions.base import lease_of
from ual_daemon.server.services.waiting import answer
from ual_daemon.services.parameters import VehicleParameters
from ual_daemon.services.vehicle import ServedVehicle


class ParameterServicer(parameters_pb2_grpc.ParameterServiceServicer):
    """The methods of `ParameterService` for one UAV. ``ual/v1/parameters.proto`` describes each of them."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._of_vehicle = VehicleParameters(vehicle)

    @override
    async def GetParameter(self, request: pb.GetParameterRequest, context: object) -> pb.GetParameterResponse:
        result = await answer(self._of_vehicle.get(name=request.name), "GetParameter")
        return pb.GetParameterResponse(parameter=wire.parameter_to_proto(result))

    @override
    async def ListParameters(self, request: pb.ListParametersRequest, context: object) -> pb.ListParametersResponse:
        result = await answer(self._of_vehicle.get_all(), "ListParameters")
        return pb.ListParametersResponse(parameters=map(wire.parameter_to_proto, result))

    @override
    async def SetParameter(self, request: pb.SetParameterRequest, context: object) -> pb.SetParameterResponse:
        result = await answer(
            self._of_vehicle.set(
                name=request.name, value=request.value, force=request.force, lease_id=lease_of(context)
            ),
            "SetParameter",
        )
        return pb.SetParameterResponse(parameter=wire.parameter_to_proto(result))
