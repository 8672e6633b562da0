"""A server of ours for what a test registers, and a client's channel to it."""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import cast

import grpc
import pytest

from ual_daemon.server.calls import Calls
from ual_daemon.server.transport import selection
from ual_daemon.server.transport.base import Options, ServedCall

GRACE_S = 15.0


@asynccontextmanager
async def serving(
    choice: selection.Choice,
    calls: Calls,
    *registered: Callable[[grpc.aio.Server], None],
    options: Options = (("grpc.so_reuseport", 0),),
) -> AsyncIterator[tuple[grpc.aio.Channel, str]]:
    """Serves what is registered, by ``add_..._to_server``, until the block ends. A channel to it, and the address."""
    for register in registered:
        register(cast("grpc.aio.Server", calls))
    async with taking(choice, calls.on_call, options) as address, grpc.aio.insecure_channel(address) as channel:
        yield channel, address


@asynccontextmanager
async def taking(
    choice: selection.Choice, take: Callable[[ServedCall], None], options: Options = (("grpc.so_reuseport", 0),)
) -> AsyncIterator[str]:
    """Serves on a transport until the block ends; its address. Calls that still run then are cancelled."""
    transport = await selection.choose(choice)
    server = transport.server(options, take)
    port = server.listen("127.0.0.1:0")
    await server.start()
    try:
        yield f"127.0.0.1:{port}"
    finally:
        if not await server.stop(0.0):  # at once, whatever still runs
            assert await server.stop(GRACE_S), "calls never ended"
        transport.close()


def reported(caplog: pytest.LogCaptureFixture) -> list[logging.LogRecord]:
    """Returns the logged records, but for gRPC's asyncio client of an earlier test, which has events for a loop that
    has ended.
    """
    return [record for record in caplog.records if "PollerCompletionQueue" not in record.getMessage()]
