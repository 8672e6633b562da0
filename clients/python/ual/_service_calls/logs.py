"""The calls of `ual.interface.Logs`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual._calls import Call, of, request
from ual._wrong_type import require
from ual.logs.values import Log, LogChunk
from ual.v1 import logs_pb2 as pb
from ual.wire import logs as wire


def get_all() -> Call[list[Log]]:
    return of("ListLogs", pb.ListLogsRequest(), lambda response: list(map(wire.log_from_proto, response.logs)))


def download(log_id: str, offset: int) -> Call[LogChunk]:
    require(log_id, str, "log_id")
    return of("DownloadLog", request(pb.DownloadLogRequest, log_id=log_id, offset=offset), wire.log_chunk_from_proto)
