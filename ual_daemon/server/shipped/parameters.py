"""`ParameterService`: the parameters of the autopilot."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from typing_extensions import override

from ual.v1 import parameters_pb2 as pb
from ual.v1 import parameters_pb2_grpc
from ual.wire import parameters as convert
from ual_daemon.extensions.base import lease_of
from ual_daemon.extensions.shipped.parameters import ALL_S, ONE_S, VehicleParameters
from ual_daemon.extensions.shipped.vehicle import ServedVehicle
from ual_daemon.server.shipped.waiting import ended


class ParameterServicer(parameters_pb2_grpc.ParameterServiceServicer):
    """The parameters of one UAV. ``ual/v1/parameters.proto`` describes each method."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._parameters = VehicleParameters(vehicle)

    # Names and order are those of the contract.

    @override
    async def GetParameter(self, request: pb.GetParameterRequest, context: object) -> pb.GetParameterResponse:
        found = await ended(self._parameters.get(request.name), ONE_S, "GetParameter")
        return pb.GetParameterResponse(parameter=convert.to_proto(found))

    @override
    async def ListParameters(self, request: pb.ListParametersRequest, context: object) -> pb.ListParametersResponse:
        found = await ended(self._parameters.get_all(), ALL_S, "ListParameters")
        return pb.ListParametersResponse(parameters=map(convert.to_proto, found))

    @override
    async def SetParameter(self, request: pb.SetParameterRequest, context: object) -> pb.SetParameterResponse:
        writing = self._parameters.set(request.name, request.value, lease_of(context), force=request.force)
        found = await ended(writing, ONE_S, "SetParameter")
        return pb.SetParameterResponse(parameter=convert.to_proto(found))


def parameter_service(vehicle: ServedVehicle) -> tuple[str, Callable[[Any], None]]:
    """Returns the name of the service, and what registers its methods."""
    name: str = pb.DESCRIPTOR.services_by_name["ParameterService"].full_name
    add = parameters_pb2_grpc.add_ParameterServiceServicer_to_server
    return name, partial(add, ParameterServicer(vehicle))
