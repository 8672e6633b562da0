"""Every method, by every way in: what a caller may do is what docs/security.md says, and nothing else."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path

import grpc
import grpc.aio
from grpc_health.v1 import health_pb2
from grpc_reflection.v1alpha import reflection_pb2

from tests.ual_daemon.server.access.ways_in import Served, Way, beyond_loopback, make_files, served, ways
from ual._access.roles import Role
from ual.v1 import simulation_pb2, ual_pb2
from ual_daemon.server.access.needed import needed_role
from ual_daemon.server.transport.selection import Choice

PAGE = Path(__file__).parents[4] / "docs" / "security.md"
DESCRIPTORS = (ual_pb2.DESCRIPTOR, simulation_pb2.DESCRIPTOR, health_pb2.DESCRIPTOR, reflection_pb2.DESCRIPTOR)
METHODS = {
    f"/{service.full_name}/{name}": method
    for file in DESCRIPTORS
    for service in file.services_by_name.values()
    for name, method in service.methods_by_name.items()
}
REFUSED = (grpc.StatusCode.UNAUTHENTICATED, grpc.StatusCode.PERMISSION_DENIED, grpc.StatusCode.UNAVAILABLE)
LIMIT_S = 60.0


def said_roles() -> dict[str, Role]:
    """The role of each method, by the table of the page: `Service/Method`, or `Service` for all of its others."""
    rows = re.findall(
        r"^\| (observer|pilot|commander) \|[^|]*\| ([^|]*) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE
    )
    return {name: Role[role.upper()] for role, names in rows for name in re.findall(r"`([\w/]+)`", names)}


def said(method: str) -> Role:
    service, _, name = method.rpartition(".")[2].partition("/")
    table = said_roles()
    return table.get(f"{service}/{name}") or table[service if service != "UalService" else name]


async def status(
    channel: grpc.aio.Channel, method: str, metadata: tuple[tuple[str, str], ...]
) -> tuple[grpc.StatusCode, str]:
    """The status with which a call with an empty request ends; OK once a stream has answered."""
    make: grpc.aio.UnaryStreamMultiCallable[bytes, bytes] = channel.unary_stream(method)
    call = make(b"", metadata=metadata, timeout=LIMIT_S)
    try:
        if await call.read() is not grpc.aio.EOF:
            call.cancel()
            return grpc.StatusCode.OK, ""
    except grpc.aio.AioRpcError as error:
        return error.code(), error.details() or ""
    return await call.code(), await call.details()


def expected(way: Way, method: str) -> grpc.StatusCode | None:
    """The status by which it is refused because of who calls; None where it is not."""
    if way.role is None:
        return grpc.StatusCode.UNAVAILABLE  # no TLS connection
    if way.role is Role.NONE:
        return grpc.StatusCode.UNAUTHENTICATED
    return grpc.StatusCode.PERMISSION_DENIED if way.role < said(method) else None


def test_the_page_says_the_role_of_every_method() -> None:
    assert {method: needed_role(method) for method in METHODS} == {method: said(method) for method in METHODS}


async def problems(to: Served, name: str, way: Way) -> list[str]:
    found = []
    async with to.channel(way) as channel:
        for method in METHODS:
            code, details = await status(channel, method, to.metadata(way))
            wanted = expected(way, method)
            if code != wanted if wanted is not None else code in REFUSED:
                found.append(f"{name}: {method}: {code.name} ({details}), not {wanted}")
    return found


def test_each_caller_may_do_what_its_role_says(tmp_path: Path, transport: Choice) -> None:
    host = beyond_loopback()

    async def check() -> list[str]:
        async with served(make_files(tmp_path, host), host, transport) as to:
            return [problem for name, way in ways(to.made).items() for problem in await problems(to, name, way)]

    assert asyncio.run(check()) == []


def test_a_stranger_cannot_see_that_a_uav_or_a_method_exists(tmp_path: Path, transport: Choice) -> None:
    host = beyond_loopback()

    async def answers() -> set[tuple[grpc.StatusCode, str]]:
        async with served(make_files(tmp_path, host), host, transport) as to:
            way = ways(to.made)["tls, nothing"]
            asked = [*METHODS, "/ual.v1.UalService/Explode", "/nothing.like/That", "/x"]
            async with to.channel(way) as channel:
                plain = [await status(channel, method, ()) for method in asked]
                named = [
                    await status(channel, method, (("ual-ns", ns),)) for method in asked for ns in ("uav_1", "uav_2")
                ]
            return {*plain, *named}

    [(code, details)] = asyncio.run(answers())  # one answer to everything
    assert code is grpc.StatusCode.UNAUTHENTICATED
    assert "uav" not in details.replace("UAL_TOKEN", "")
