"""Every call of `LogService`; see `ual._calls`. ``make clients`` writes `ual.interface.Logs` from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual._calls import Call, built, of
from ual.logs.values import Log, LogChunk
from ual.v1 import logs_pb2 as pb
from ual.wire import logs as convert


def get_all() -> Call[list[Log]]:
    def read(response: pb.ListLogsResponse) -> list[Log]:
        return [convert.from_proto(each) for each in response.logs]

    return of("ListLogs", pb.ListLogsRequest(), read)


def download(log_id: str, offset: int) -> Call[LogChunk]:
    request = built(lambda: pb.DownloadLogRequest(log_id=log_id, offset=offset), "offset", offset)
    return of("DownloadLog", request, convert.chunk_from_proto)


MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {"get_all": get_all, "download": download}
"""The members of `ual.interface.Logs`, each with its call. Those that return an iterator are streams."""
