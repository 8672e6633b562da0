"""The autopilot's logs by the service and the action of the node. The node writes on this computer."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from flying import Client
from inexpressible import InexpressibleError
from ual_msgs import action, srv

import ual
from ual.interface import Logs
from ual.logs import Log, LogChunk
from ual_ros2 import values

Call = Callable[..., Any]


class RosLogs(Logs):
    """The logs of one UAV."""

    def __init__(self, client: Client, ns: str, call: Call, error_of: Callable[[Any], ual.UalError]) -> None:
        self._client = client
        self._action = f"/{ns}/ual/download_log"
        self._call = call
        self._error_of = error_of

    def get_all(self) -> list[Log]:
        return [_log(each) for each in self._call(srv.ListLogs, "list_logs").logs]

    def download(self, log_id: str, offset: int = 0) -> Iterator[LogChunk]:
        if offset:
            raise InexpressibleError("offset")
        _, result = self._client.fly(action.DownloadLog, self._action, log_id=log_id)
        if not result.success:
            raise self._error_of(result)
        data = Path(result.file).read_bytes()
        assert hashlib.sha256(data).hexdigest() == result.sha256
        [log] = [each for each in self.get_all() if each.id == log_id]
        yield LogChunk(log, 0, data, result.sha256)


def _log(message: Any) -> Log:
    written = message.written
    time_s = written.sec + written.nanosec / values.NANO
    return Log(message.log_id, message.size, time_s or None)
