from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

import grpc
import pytest
from grpc_health.v1 import health_pb2, health_pb2_grpc

from tests.ual_daemon.server.serving import reported, serving
from ual_daemon.server import health
from ual_daemon.server.calls import Calls
from ual_daemon.server.health import HealthServicer
from ual_daemon.server.transport.selection import Choice

SERVING = health_pb2.HealthCheckResponse.SERVING
NOT_SERVING = health_pb2.HealthCheckResponse.NOT_SERVING
SERVICE_UNKNOWN = health_pb2.HealthCheckResponse.SERVICE_UNKNOWN


@asynccontextmanager
async def served(transport: Choice) -> AsyncIterator[tuple[HealthServicer, Any]]:
    servicer = HealthServicer(["ual.v1.UalService"])
    calls = Calls("uav_1", shutdown_refuses=())
    async with serving(transport, calls, partial(health.add_to_server, servicer)) as (channel, _):
        stub: Any = health_pb2_grpc.HealthStub(channel)
        stub.List = channel.unary_unary("/grpc.health.v1.Health/List")  # of bytes: the stub may not know it
        yield servicer, stub


def request(service: str = "") -> health_pb2.HealthCheckRequest:
    return health_pb2.HealthCheckRequest(service=service)


def test_each_service_and_the_server_itself_have_the_status(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as (servicer, stub):
            for service in ("", "ual.v1.UalService"):
                assert (await stub.Check(request(service))).status == NOT_SERVING
            servicer.set_serving(True)
            for service in ("", "ual.v1.UalService"):
                assert (await stub.Check(request(service))).status == SERVING

    asyncio.run(run())


def entry(name: bytes, status: int) -> bytes:
    """One of ``map<string, HealthCheckResponse> statuses = 1``."""
    fields = b"\x0a" + bytes((len(name),)) + name + b"\x12\x02\x08" + bytes((status,))
    return b"\x0a" + bytes((len(fields),)) + fields


def test_all_services_are_listed_as_grpcs_health_proto_says(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as (servicer, stub):
            servicer.set_serving(True)
            answer = await stub.List(b"")
            both = entry(b"", SERVING), entry(b"ual.v1.UalService", SERVING)
            assert answer in (both[0] + both[1], both[1] + both[0])  # a map has no order

    asyncio.run(run())


def test_an_unknown_service_is_not_found(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as (_, stub):
            with pytest.raises(grpc.aio.AioRpcError) as caught:
                await stub.Check(request("nobody"))
            assert caught.value.code() is grpc.StatusCode.NOT_FOUND
            async for answer in stub.Watch(request("nobody")):
                assert answer.status == SERVICE_UNKNOWN
                break

    asyncio.run(run())


def test_a_watcher_that_leaves_takes_no_other_with_it(transport: Choice) -> None:
    async def run() -> None:
        async with served(transport) as (servicer, stub):
            leaving, staying = stub.Watch(request()), stub.Watch(request())
            assert (await leaving.read()).status == NOT_SERVING
            assert (await staying.read()).status == NOT_SERVING
            leaving.cancel()
            for is_serving, status in ((True, SERVING), (False, NOT_SERVING), (True, SERVING)):
                servicer.set_serving(is_serving)
                assert (await staying.read()).status == status
            staying.cancel()

    asyncio.run(run())


def test_a_method_that_is_not_implemented_is_unimplemented_and_no_defect(
    transport: Choice, caplog: pytest.LogCaptureFixture
) -> None:
    """As Health/List, which newer stubs have: generated servicers need a context of gRPC to say so."""

    async def run() -> None:
        calls = Calls("uav_1", shutdown_refuses=())
        register = partial(health_pb2_grpc.add_HealthServicer_to_server, health_pb2_grpc.HealthServicer())
        async with serving(transport, calls, register) as (channel, _):
            stub: Any = health_pb2_grpc.HealthStub(channel)
            for call in (stub.Check(request()), stub.Watch(request()).read()):
                with pytest.raises(grpc.aio.AioRpcError, match=r"no method /grpc\.health\.v1") as caught:
                    await call
                assert caught.value.code() is grpc.StatusCode.UNIMPLEMENTED

    asyncio.run(run())
    assert not reported(caplog)
