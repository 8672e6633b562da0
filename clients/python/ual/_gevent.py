"""gevent's patched threads: gRPC must know of them, or a thread that waits for it stops all others for good."""

from __future__ import annotations

import functools
import sys

from ual.errors import UalError


def _is_patched() -> bool:
    monkey = sys.modules.get("gevent.monkey")
    return monkey is not None and bool(monkey.is_module_patched("threading"))


_WAS_PATCHED = _is_patched()
"""At the import: else the locks and queues of this package would stop all greenlets."""


def prepare() -> None:
    """Lets gRPC wait as gevent does, where gevent has patched the threads. Called before a channel or a subscription is
    opened.

    Raises:
        UalError: They were patched too late.
    """
    if not _is_patched():
        return
    if not _WAS_PATCHED:
        raise UalError("gevent's monkey.patch_all() was called after ual's client was imported: call it first of all")
    _prepare_once()


def refuse_asyncio() -> None:
    """Raises `UalError` under gevent, where the threads of gRPC's asyncio would stop all greenlets."""
    if _is_patched():
        raise UalError("ual.aio and ual.Team do not run under gevent's monkey.patch_all(): use ual.Uav in greenlets")


@functools.cache
def _prepare_once() -> None:
    from grpc.experimental.gevent import init_gevent  # imported late: it needs gevent

    init_gevent()
