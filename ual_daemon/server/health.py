"""The standard gRPC health service.

It replaces grpcio-health-checking's asyncio servicer. That forgets all watchers of a service when one of them leaves,
and in it a watcher that does not read delays the setter of the status.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterable
from typing import Any

import grpc
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from grpc_health.v1 import health_pb2, health_pb2_grpc
from typing_extensions import override

from ual_daemon.server.dispatch import StatusError

_Status = health_pb2.HealthCheckResponse
_PACKAGE: str = health_pb2.DESCRIPTOR.package
WATCH = f"/{_PACKAGE}.Health/Watch"
_Field = descriptor_pb2.FieldDescriptorProto


def _list_messages() -> tuple[Any, Any]:
    """Returns ``HealthListRequest`` and ``HealthListResponse`` of gRPC's health.proto, which grpcio may not have.

    They are in a pool of their own: another version of the same file would clash with them in the default one.
    """
    file = descriptor_pb2.FileDescriptorProto()
    file.ParseFromString(health_pb2.DESCRIPTOR.serialized_pb)
    pool: Any = descriptor_pool.DescriptorPool()
    if "HealthListResponse" not in health_pb2.DESCRIPTOR.message_types_by_name:
        file.message_type.add(name="HealthListRequest")
        answer = file.message_type.add(name="HealthListResponse")
        entry = answer.nested_type.add(name="StatusesEntry")
        entry.options.map_entry = True
        entry.field.add(name="key", number=1, type=_Field.TYPE_STRING, label=_Field.LABEL_OPTIONAL)
        _add_message(entry, "value", 2, "HealthCheckResponse", is_repeated=False)
        _add_message(answer, "statuses", 1, "HealthListResponse.StatusesEntry", is_repeated=True)
    pool.Add(file)
    classes = (pool.FindMessageTypeByName(f"{_PACKAGE}.HealthList{kind}") for kind in ("Request", "Response"))
    request, response = map(message_factory.GetMessageClass, classes)
    return request, response


def _add_message(to: descriptor_pb2.DescriptorProto, name: str, number: int, kind: str, *, is_repeated: bool) -> None:
    label = _Field.LABEL_REPEATED if is_repeated else _Field.LABEL_OPTIONAL
    to.field.add(name=name, number=number, type=_Field.TYPE_MESSAGE, label=label, type_name=f".{_PACKAGE}.{kind}")


_ListRequest, _ListResponse = _list_messages()


def add_to_server(servicer: HealthServicer, server: grpc.aio.Server) -> None:
    """Registers all methods, also ``List`` where the generated code of grpcio does not know it."""
    health_pb2_grpc.add_HealthServicer_to_server(servicer, server)
    handler = grpc.unary_unary_rpc_method_handler(
        servicer.List,
        request_deserializer=_ListRequest.FromString,
        response_serializer=_ListResponse.SerializeToString,
    )
    server.add_registered_method_handlers(f"{_PACKAGE}.Health", {"List": handler})


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

    def List(self, request: object, context: object) -> Any:  # noqa: ANN401, N802  a message of `_list_messages`
        """Returns the status of each service."""
        answer = _ListResponse()
        for service in self._services:
            answer.statuses[service].status = self._status
        return answer
