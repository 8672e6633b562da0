"""The standard gRPC health service.

It replaces grpcio-health-checking's asyncio servicer, which forgets all watchers of a service when one of them leaves,
and in which a watcher that does not read delays whoever sets the status.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterable

import grpc
from grpc_health.v1 import health_pb2, health_pb2_grpc
from typing_extensions import override

from ual_daemon.server.dispatch import StatusError

_Status = health_pb2.HealthCheckResponse


class HealthServicer(health_pb2_grpc.HealthServicer):
    """Reports whether the services, and the server as a whole (the empty name), serve."""

    def __init__(self, services: Iterable[str]) -> None:
        self._services = frozenset({"", *services})
        self._status: int = _Status.NOT_SERVING
        self._changed = asyncio.Event()

    def set_serving(self, is_serving: bool) -> None:
        """Sets the status of all the services, and notifies the watchers."""
        self._status = _Status.SERVING if is_serving else _Status.NOT_SERVING
        # An event for each change, as one event would have to be cleared while some have not seen it.
        self._changed.set()
        self._changed = asyncio.Event()

    @override
    def Check(
        self,
        request: health_pb2.HealthCheckRequest,
        context: object,
    ) -> health_pb2.HealthCheckResponse:
        if request.service not in self._services:
            raise StatusError(grpc.StatusCode.NOT_FOUND, f"no service {request.service!r} here")
        return health_pb2.HealthCheckResponse(status=self._status)

    @override
    async def Watch(
        self,
        request: health_pb2.HealthCheckRequest,
        context: object,
    ) -> AsyncIterator[health_pb2.HealthCheckResponse]:
        sent = None
        while True:
            changed, status = self._changed, self._status
            if request.service not in self._services:
                status = _Status.SERVICE_UNKNOWN
            if status != sent:
                yield health_pb2.HealthCheckResponse(status=status)
                sent = status
                continue  # it may have changed meanwhile
            await changed.wait()
