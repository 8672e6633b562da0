"""Chooses the transport: the core where it works here, else ``grpc.aio``."""

from __future__ import annotations

import logging
from typing import Literal, TypeAlias

from typing_extensions import override

from ual_daemon import logs
from ual_daemon.server.transport.base import Transport

Choice: TypeAlias = Literal["auto", "core", "aio"]
"""The setting `transport`."""

_log = logging.getLogger(__name__)


_BINDING = "grpc._cython.cygrpc"


class _Plain(logging.Filter):
    """Takes the traceback, and the caller's bytes, from what gRPC's binding logs about callers.

    So a caller that repeats itself repeats the line, which is then counted.
    """

    @override
    def filter(self, record: logging.LogRecord) -> bool:
        if str(record.msg).startswith("Invalid encoding"):
            _reduce(record, logging.WARNING, "a caller sends metadata that are no UTF-8")
        elif record.exc_info and type(record.exc_info[1]).__name__ == "ExecuteBatchError":
            # An operation of a call fails only where the call has ended. `grpc.aio` logs that as an error if the
            # operation is the status that it sends by itself when its handler returns.
            _reduce(record, logging.DEBUG, "a caller was gone before its answer")
            return _log.isEnabledFor(logging.DEBUG)
        return True


def _reduce(record: logging.LogRecord, level: int, text: str) -> None:
    record.levelno, record.levelname = level, logging.getLevelName(level)
    record.msg, record.args, record.exc_info = text, (), None


_plain = _Plain()


async def choose(choice: Choice, gather_s: float = 0.0) -> Transport:
    """Makes the transport that was chosen. With `auto` it is the core if it passes its self-test.

    `gather_s` is how long the core leaves events to gather, where many UAVs are served; see `CoreTransport`.
    """
    logging.getLogger(_BINDING).addFilter(_plain)
    if choice == "auto":
        why = await _fault_of_core()
        if why:
            logs.event(_log, logging.WARNING, "transport_fallback", transport="aio", why=why)
        choice = "aio" if why else "core"
    if choice == "core":
        from ual_daemon.server.transport.core import CoreTransport

        return CoreTransport(gather_s)
    from ual_daemon.server.transport.aio import AioTransport

    return AioTransport()


async def _fault_of_core() -> str:
    """Why the core cannot be used here; empty where it can."""
    try:
        # The binding is private: in another version of grpcio it may be gone, or import something that is.
        from ual_daemon.server.transport import self_test

        await self_test.run()
    except Exception as error:  # noqa: BLE001  whatever it is, the daemon must serve
        return f"{type(error).__name__}: {error}"
    return ""
