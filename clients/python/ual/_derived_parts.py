"""The services beside that of the UAV. ``make clients`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Iterator

from typing_extensions import override

from ual import _fence_calls, _log_calls, _parameter_calls, interface
from ual._connection import Connection
from ual.fences.values import FencePlan, KeptFence
from ual.logs.values import Log, LogChunk
from ual.parameters.values import Parameter


class Parameters(interface.Parameters):
    """`ual.interface.Parameters`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Parameters of {self._connection.described}>"

    @override
    def get(self, name: str) -> Parameter:
        return self._connection.run(_parameter_calls.get(name))

    @override
    def get_all(self) -> list[Parameter]:
        return self._connection.run(_parameter_calls.get_all())

    @override
    def set(self, name: str, value: float, *, force: bool = False) -> Parameter:
        return self._connection.run(_parameter_calls.set_(name=name, value=value, force=force))


class Fence(interface.Fence):
    """`ual.interface.Fence`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Fence of {self._connection.described}>"

    @override
    def get(self) -> KeptFence:
        return self._connection.run(_fence_calls.get())

    @override
    def upload(
        self, plan: FencePlan | None = None, *, replace: bool = False, enable: bool = True, force: bool = False
    ) -> KeptFence:
        return self._connection.run(_fence_calls.upload(plan, replace=replace, enable=enable, force=force))

    @override
    def clear(self, *, with_rally_points: bool = False, force: bool = False) -> KeptFence:
        return self._connection.run(_fence_calls.clear(with_rally_points=with_rally_points, force=force))

    @override
    def enable(self) -> KeptFence:
        return self._connection.run(_fence_calls.enable())

    @override
    def disable(self) -> KeptFence:
        return self._connection.run(_fence_calls.disable())


class Logs(interface.Logs):
    """`ual.interface.Logs`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Logs of {self._connection.described}>"

    @override
    def get_all(self) -> list[Log]:
        return self._connection.run(_log_calls.get_all())

    @override
    def download(self, log_id: str, offset: int = 0) -> Iterator[LogChunk]:
        return self._connection.iterate(_log_calls.download(log_id=log_id, offset=offset))
