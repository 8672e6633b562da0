"""Waits until a program is ready: until its condition holds, never for a time that is only guessed."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
from collections.abc import Callable
from pathlib import Path

from ual import discovery
from ual_tools.launch.team import Program, ReadyCondition

_POLL_PERIOD_S = 0.05
"""Seconds between two looks at a port, a file and a registration: the system does not announce them."""
_HEALTH_WATCH = "/grpc.health.v1.Health/Watch"
_SERVING = b"\x08\x01"
"""`HealthCheckResponse` with the status SERVING. The package of the health service is not needed for that."""


class LogWatch:
    """Sees the lines of a program, and is set once one of them matches."""

    def __init__(self, program: Program) -> None:
        is_by_log = program.ready.condition is ReadyCondition.LOG
        self._pattern = re.compile(program.ready.value) if is_by_log else None
        self.seen = asyncio.Event()

    def see(self, line: str) -> None:
        """Looks at one line."""
        if self._pattern is not None and self._pattern.search(line):
            self.seen.set()


async def until_ready(program: Program, pid: int, log: LogWatch) -> None:
    """Returns when the program is ready. A program that is ready when it has ended with 0 is its caller's matter."""
    condition, value = program.ready.condition, program.ready.value
    if condition is ReadyCondition.PORT:
        await _until_open(value)
    elif condition is ReadyCondition.FILE:
        await _until(Path(value).exists)
    elif condition is ReadyCondition.LOG:
        await log.seen.wait()
    elif condition is ReadyCondition.EXIT:
        await asyncio.Event().wait()
    elif condition is ReadyCondition.SERVING:
        await _until_serving(await address_of(program.ns, pid))


async def _until_open(address: str) -> None:
    host, _, port = address.rpartition(":")
    while True:
        try:
            _, writer = await asyncio.open_connection(host.strip("[]"), int(port))
        except OSError:
            await asyncio.sleep(_POLL_PERIOD_S)
        else:
            writer.close()
            return


async def _until(is_true: Callable[[], bool]) -> None:
    while not is_true():  # noqa: ASYNC110  nobody would set an event
        await asyncio.sleep(_POLL_PERIOD_S)


async def address_of(ns: str, session: int) -> str:
    """Returns where a daemon listens once it does. `session` is its process's: no other daemon is taken for it."""
    while True:
        found = discovery.registered(ns)
        if found is not None and _session_of(found.pid) == session:
            return found.address
        await asyncio.sleep(_POLL_PERIOD_S)


def _session_of(pid: int) -> int | None:
    try:
        return os.getsid(pid)
    except OSError:
        return None


async def _until_serving(address: str) -> None:
    """Returns when the daemon's health is SERVING: it is connected to its autopilot, and takes commands."""
    import grpc

    async with grpc.aio.insecure_channel(address) as channel:
        watch = channel.unary_stream(_HEALTH_WATCH, request_serializer=bytes, response_deserializer=bytes)
        while True:
            with contextlib.suppress(grpc.aio.AioRpcError):  # it ends, or is busy: its exit status says which
                async for answer in watch(b""):
                    if answer == _SERVING:
                        return
            await asyncio.sleep(_POLL_PERIOD_S)
