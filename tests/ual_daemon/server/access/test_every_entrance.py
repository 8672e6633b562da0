"""Every method, by every way in: what a caller may do is what docs/evidence/security.md says, and nothing else."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path
from typing import Any

import grpc
import grpc.aio
from grpc_health.v1 import health_pb2
from grpc_reflection.v1alpha import reflection_pb2

from tests.contract_files import FILES
from tests.ual_daemon.server.access.entrances import Served, Variant, beyond_loopback, make_files, served, variants
from tests.waiting import LIMIT_S
from ual.access.roles import Role
from ual.v1 import simulation_pb2
from ual_daemon.server.access.needed import needed_role
from ual_daemon.server.transport.selection import Choice

PAGE = Path(__file__).parents[4] / "docs" / "evidence" / "security.md"
DESCRIPTORS: tuple[Any, ...] = (*FILES, health_pb2.DESCRIPTOR, reflection_pb2.DESCRIPTOR)
METHODS = {
    f"/{service.full_name}/{name}": method
    for file in DESCRIPTORS
    for service in file.services_by_name.values()
    for name, method in service.methods_by_name.items()
}
REQUESTS = {"/ual.v1.SimulationService/SetSpeedFactor": simulation_pb2.SetSpeedFactorRequest(speed_factor=1.0)}
"""Requests that are not empty. A speed of 0 would let the time stand still, and then no disarming ever ends."""
REFUSED = (grpc.StatusCode.UNAUTHENTICATED, grpc.StatusCode.PERMISSION_DENIED, grpc.StatusCode.UNAVAILABLE)


ROW = re.compile(r"^\| (`\w+Service`|`Health`.*?) \|(.*?)\|(.*?)\|(.*?)\|.*\|$", re.MULTILINE)


def stated_roles() -> dict[str, Role]:
    """The role of each method, by the table of the page: `Service/Method`, or `Service` where all need the same."""
    found: dict[str, Role] = {}
    for services, *cells in ROW.findall(PAGE.read_text(encoding="utf-8")):
        for role, cell in zip((Role.OBSERVER, Role.PILOT, Role.COMMANDER), cells, strict=True):
            for service in re.findall(r"`(\w+)`", services):
                found |= dict.fromkeys((f"{service}/{name}" for name in re.findall(r"`(\w+)`", cell)), role)
                found |= {service: role} if cell.strip() == "all" else {}
    return found


def status_text(method: str) -> Role:
    service, _, name = method.rpartition(".")[2].partition("/")
    table = stated_roles()
    return table[f"{service}/{name}" if f"{service}/{name}" in table else service]


def status(channel: grpc.Channel, method: str, metadata: tuple[tuple[str, str], ...]) -> tuple[grpc.StatusCode, str]:
    """The status with which a call ends; OK once a stream has answered."""
    make: grpc.UnaryStreamMultiCallable[bytes, bytes] = channel.unary_stream(method)
    request = REQUESTS[method].SerializeToString() if method in REQUESTS else b""
    call = make(request, metadata=metadata, timeout=LIMIT_S)
    try:
        next(call, None)
    except grpc.RpcError as error:
        code: grpc.StatusCode = error.code()
        return code, error.details() or ""
    call.cancel()
    return grpc.StatusCode.OK, ""


def expected(way: Variant, method: str) -> grpc.StatusCode | None:
    """The status by which it is refused because of the caller; None where it is not."""
    if way.role is None:
        return grpc.StatusCode.UNAVAILABLE  # no TLS connection
    if way.role is Role.NONE:
        return grpc.StatusCode.UNAUTHENTICATED
    return grpc.StatusCode.PERMISSION_DENIED if way.role < status_text(method) else None


def test_the_page_says_the_role_of_every_method() -> None:
    assert {method: needed_role(method) for method in METHODS} == {method: status_text(method) for method in METHODS}


def problems(to: Served, name: str, way: Variant) -> list[str]:
    found = []
    with to.blocking_channel(way) as channel:
        for method in METHODS:
            code, details = status(channel, method, to.metadata(way))
            wanted = expected(way, method)
            if code != wanted if wanted is not None else code in REFUSED:
                found.append(f"{name}: {method}: {code.name} ({details}), not {wanted}")
    return found


def test_each_caller_may_do_what_its_role_says(tmp_path: Path, transport: Choice) -> None:
    host = beyond_loopback()

    def ask_all(to: Served) -> list[str]:
        return [problem for name, way in variants(to.made).items() for problem in problems(to, name, way)]

    async def check() -> list[str]:
        async with served(make_files(tmp_path, host), host, transport) as to:
            return await asyncio.to_thread(ask_all, to)

    assert asyncio.run(check()) == []


def test_a_stranger_cannot_see_that_a_uav_or_a_method_exists(tmp_path: Path, transport: Choice) -> None:
    host = beyond_loopback()
    asked = [*METHODS, "/ual.v1.UalService/Explode", "/nothing.like/That", "/x"]
    named = ((), (("ual-ns", "uav_1"),), (("ual-ns", "uav_2"),))

    def ask_all(to: Served) -> set[tuple[grpc.StatusCode, str]]:
        with to.blocking_channel(variants(to.made)["tls, nothing"]) as channel:
            return {status(channel, method, metadata) for method in asked for metadata in named}

    async def answers() -> set[tuple[grpc.StatusCode, str]]:
        async with served(make_files(tmp_path, host), host, transport) as to:
            return await asyncio.to_thread(ask_all, to)

    [(code, details)] = asyncio.run(answers())  # one answer to everything
    assert code is grpc.StatusCode.UNAUTHENTICATED
    assert "uav" not in details.replace("UAL_TOKEN", "")
