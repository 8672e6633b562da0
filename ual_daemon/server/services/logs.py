"""`LogService`: unpack, call, pack. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import AsyncIterator

from typing_extensions import override

from ual.v1 import logs_pb2 as pb
from ual.v1 import logs_pb2_grpc
from ual.wire import logs as wire
from ual_daemon.server.services.waiting import answer, answers
from ual_daemon.services.logs import VehicleLogs
from ual_daemon.services.vehicle import ServedVehicle


class LogServicer(logs_pb2_grpc.LogServiceServicer):
    """The methods of `LogService` for one UAV. ``ual/v1/logs.proto`` describes each of them."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._of_vehicle = VehicleLogs(vehicle)

    @override
    async def ListLogs(self, request: pb.ListLogsRequest, context: object) -> pb.ListLogsResponse:
        result = await answer(self._of_vehicle.get_all(), "ListLogs")
        return pb.ListLogsResponse(logs=map(wire.log_to_proto, result))

    @override
    async def DownloadLog(
        self, request: pb.DownloadLogRequest, context: object
    ) -> AsyncIterator[pb.DownloadLogResponse]:
        async for result in answers(
            self._of_vehicle.download(log_id=request.log_id, offset=request.offset), "DownloadLog"
        ):
            yield wire.log_chunk_to_proto(result)
