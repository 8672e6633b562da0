"""gevent's patched threads: gRPC must know of them, or a thread that waits for it stops all others for good."""

from __future__ import annotations

import functools
import sys


def prepare() -> None:
    """Lets gRPC wait as gevent does, where gevent has patched the threads. Called before each channel is opened."""
    monkey = sys.modules.get("gevent.monkey")
    if monkey is not None and monkey.is_module_patched("threading"):
        _prepare_once()


@functools.cache
def _prepare_once() -> None:
    from grpc.experimental.gevent import init_gevent  # imported late: it needs gevent

    init_gevent()
