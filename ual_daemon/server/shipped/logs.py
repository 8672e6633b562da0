"""`LogService`: the logs of the autopilot."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from functools import partial
from typing import Any

from typing_extensions import override

from ual.v1 import logs_pb2 as pb
from ual.v1 import logs_pb2_grpc
from ual.wire import logs as convert
from ual_daemon.extensions.shipped.logs import LIST_S, READ_S, VehicleLogs
from ual_daemon.extensions.shipped.vehicle import ServedVehicle
from ual_daemon.server.shipped.waiting import ended


class LogServicer(logs_pb2_grpc.LogServiceServicer):
    """The logs of one UAV. ``ual/v1/logs.proto`` describes each method."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._logs = VehicleLogs(vehicle)

    # Names and order are those of the contract.

    @override
    async def ListLogs(self, request: pb.ListLogsRequest, context: object) -> pb.ListLogsResponse:
        found = await ended(self._logs.get_all(), LIST_S, "ListLogs")
        return pb.ListLogsResponse(logs=map(convert.to_proto, found))

    @override
    async def DownloadLog(
        self, request: pb.DownloadLogRequest, context: object
    ) -> AsyncIterator[pb.DownloadLogResponse]:
        download = self._logs.download(request.log_id, request.offset)
        try:
            download.choose(await ended(download.listed(), LIST_S, "DownloadLog"))
            while not download.is_over:
                piece = await ended(download.read(), READ_S, "DownloadLog")
                yield convert.chunk_to_proto(download.add(piece))
        finally:
            download.close()


def log_service(vehicle: ServedVehicle) -> tuple[str, Callable[[Any], None]]:
    """Returns the name of the service, and what registers its methods."""
    name: str = pb.DESCRIPTOR.services_by_name["LogService"].full_name
    return name, partial(logs_pb2_grpc.add_LogServiceServicer_to_server, LogServicer(vehicle))
