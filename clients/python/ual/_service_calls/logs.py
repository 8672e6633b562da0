"""The calls of `ual.interface.Logs`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual._calls import Call, of, request
from ual.logs.values import Log, LogChunk
from ual.v1 import logs_pb2 as pb
from ual.wire import logs as wire


def get_all() -> Call[list[Log]]:
    return of("ListLogs", pb.ListLogsRequest(), lambda response: list(map(wire.log_from_proto, response.logs)))


def download(log_id: str, offset: int) -> Call[LogChunk]:
    return of("DownloadLog", request(pb.DownloadLogRequest, log_id=log_id, offset=offset), wire.log_chunk_from_proto)


MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {
    "get_all": get_all,
    "download": download,
}
