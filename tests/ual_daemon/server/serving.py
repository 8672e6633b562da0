"""A server of ours for what a test registers, and a client's channel to it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import cast

import grpc

from ual_daemon.server.calls import Calls
from ual_daemon.server.transport.core import Core, CoreServer
from ual_daemon.server.waiting import completion


@asynccontextmanager
async def serving(
    calls: Calls, *registered: Callable[[grpc.aio.Server], None]
) -> AsyncIterator[tuple[grpc.aio.Channel, str]]:
    """Serves what is registered, by ``add_..._to_server``, until the block ends. A channel to it, and the address."""
    for register in registered:
        register(cast("grpc.aio.Server", calls))
    core = Core()
    server = CoreServer(core, (("grpc.so_reuseport", 0),), calls.take)
    port = server.listen("127.0.0.1:0")
    server.start()
    try:
        async with grpc.aio.insecure_channel(f"127.0.0.1:{port}") as channel:
            yield channel, f"127.0.0.1:{port}"
    finally:
        stopped = completion(server.stop())
        server.cancel_calls()
        await asyncio.wait_for(stopped, 30.0)
        core.close()
