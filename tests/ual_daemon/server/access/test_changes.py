"""Changes while a daemon runs: tokens that are revoked, certificates that are renewed, shares of the limits."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import grpc
import grpc.aio
import pytest

from tests.ual_daemon.server.access.entrances import Served, beyond_loopback, make_files, served, variants
from tests.waiting import LIMIT_S
from ual.access import tokens
from ual.shared import whole_file
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc
from ual_daemon.server import calls
from ual_daemon.server.transport.selection import Choice
from ual_tools.access import certificates


def run(tmp_path: Path, transport: Choice, check: Callable[[Served], object]) -> None:
    host = beyond_loopback()

    async def main() -> None:
        async with served(make_files(tmp_path, host), host, transport) as to:
            result = check(to)
            assert asyncio.iscoroutine(result)
            await asyncio.wait_for(result, LIMIT_S)

    asyncio.run(main())


async def end_of(stream: grpc.aio.UnaryStreamCall[Any, Any]) -> grpc.StatusCode:
    """Reads a stream to its end. Returns the status that it ended with."""
    try:
        while await stream.read() is not grpc.aio.EOF:
            pass
    except grpc.aio.AioRpcError as error:
        return error.code()
    return await stream.code()


def test_a_revoked_token_ends_its_streams(tmp_path: Path, transport: Choice, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calls, "REQUEST_S", 0.1)

    async def check(to: Served) -> None:
        way = variants(to.made)["tls, token of an observer"]
        async with to.channel(way) as channel:
            stub = ual_pb2_grpc.UalServiceStub(channel)
            stream = stub.StreamTelemetry(pb.StreamTelemetryRequest(), metadata=to.metadata(way))
            assert await stream.read() is not grpc.aio.EOF
            file = tmp_path / "tokens.json"
            left = [token for token in tokens.read(file.read_bytes()) if token.name != "observer"]
            whole_file.write(file, tokens.write(left))
            assert await end_of(stream) is grpc.StatusCode.UNAUTHENTICATED

    run(tmp_path, transport, check)


def test_a_lowered_role_of_local_callers_ends_their_streams(
    tmp_path: Path, transport: Choice, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calls, "REQUEST_S", 0.1)

    async def check(to: Served) -> None:
        way = variants(to.made)["loopback"]
        async with to.channel(way) as channel:
            stub = ual_pb2_grpc.UalServiceStub(channel)
            watching = stub.StreamTelemetry(pb.StreamTelemetryRequest())
            assert await watching.read() is not grpc.aio.EOF
            flying = stub.StreamExternalPoses()
            await flying.wait_for_connection()
            roles = tmp_path / "roles.yaml"
            whole_file.write(roles, b"local: observer" + roles.read_bytes())
            assert await flying.code() is grpc.StatusCode.PERMISSION_DENIED
            assert await watching.read() is not grpc.aio.EOF  # an observer may go on reading

    run(tmp_path, transport, check)


def test_a_lowered_role_ends_its_streams(tmp_path: Path, transport: Choice, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calls, "REQUEST_S", 0.1)

    async def check(to: Served) -> None:
        way = variants(to.made)["tls, token of a pilot"]
        async with to.channel(way) as channel:
            stub = ual_pb2_grpc.UalServiceStub(channel)
            watching = stub.StreamTelemetry(pb.StreamTelemetryRequest(), metadata=to.metadata(way))
            assert await watching.read() is not grpc.aio.EOF
            flying = stub.StreamExternalPoses(metadata=to.metadata(way))
            roles = tmp_path / "roles.yaml"
            whole_file.write(roles, roles.read_bytes().replace(b"tokens:", b"tokens:\n  pilot: observer"))
            assert await flying.code() is grpc.StatusCode.PERMISSION_DENIED
            assert await watching.read() is not grpc.aio.EOF  # an observer may go on reading

    run(tmp_path, transport, check)


def test_a_renewed_certificate_is_used_without_a_restart(tmp_path: Path, transport: Choice) -> None:
    async def check(to: Served) -> None:
        way = variants(to.made)["tls, token of a pilot"]
        for kind in ("key", "certificate"):
            getattr(certificates.files(tmp_path, "uav_1"), kind).rename(tmp_path / f"old {kind}")
        new = tmp_path / "new"
        certificates.make_authority(new, "renewed", 10.0)
        host = to.addresses["tls"].rpartition(":")[0]
        made = certificates.make_daemon(new, "uav_1", [host], 10.0)
        made.key.rename(tmp_path / "uav_1.key")
        made.certificate.rename(tmp_path / "uav_1.pem")
        trusted = grpc.ssl_channel_credentials(certificates.files(new, "authority").certificate.read_bytes())
        async with grpc.aio.secure_channel(to.addresses["tls"], trusted) as channel:
            stub = ual_pb2_grpc.UalServiceStub(channel)
            answer = await stub.GetInfo(pb.GetInfoRequest(), metadata=to.metadata(way), timeout=LIMIT_S)
            assert answer.namespace == "uav_1"

    run(tmp_path, transport, check)


def test_one_caller_does_not_use_up_the_share_of_another(
    tmp_path: Path, transport: Choice, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calls, "MOST_CALLS_PER_METHOD", 3)

    async def check(to: Served) -> None:
        greedy, other = (variants(to.made)[f"tls, token of {who}"] for who in ("an observer", "a pilot"))
        async with to.channel(greedy) as channel, to.channel(other) as another:
            stub = ual_pb2_grpc.UalServiceStub(channel)
            request = pb.StreamTelemetryRequest()
            open_streams = [stub.StreamTelemetry(request, metadata=to.metadata(greedy)) for _ in range(3)]
            for stream in open_streams:
                assert await stream.read() is not grpc.aio.EOF
            with pytest.raises(grpc.aio.AioRpcError) as caught:
                await stub.StreamTelemetry(request, metadata=to.metadata(greedy)).read()
            assert caught.value.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
            assert "of observer" in (caught.value.details() or "")
            others = ual_pb2_grpc.UalServiceStub(another).StreamTelemetry(request, metadata=to.metadata(other))
            assert await others.read() is not grpc.aio.EOF
            for stream in (*open_streams, others):
                stream.cancel()

    run(tmp_path, transport, check)


def test_only_a_commander_takes_the_lease(tmp_path: Path, transport: Choice) -> None:
    async def check(to: Served) -> None:
        pilot, commander = (variants(to.made)[f"tls, token of a {who}"] for who in ("pilot", "commander"))
        async with to.channel(pilot) as first, to.channel(commander) as second:
            stub, commanding = ual_pb2_grpc.UalServiceStub(first), ual_pb2_grpc.UalServiceStub(second)
            request = pb.AcquireLeaseRequest(holder="film", take=True)
            await commanding.AcquireLease(pb.AcquireLeaseRequest(holder="survey"), metadata=to.metadata(commander))
            with pytest.raises(grpc.aio.AioRpcError) as caught:
                await stub.AcquireLease(request, metadata=to.metadata(pilot))
            assert caught.value.code() is grpc.StatusCode.PERMISSION_DENIED
            taken = await commanding.AcquireLease(request, metadata=to.metadata(commander))
            assert (taken.lease.holder, taken.lease.identity) == ("film", "commander")

    run(tmp_path, transport, check)
