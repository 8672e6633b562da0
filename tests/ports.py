"""Ports for what a test starts itself."""

from __future__ import annotations

import itertools
import os
import socket
from collections.abc import Iterator
from functools import cache

_HOST = "127.0.0.1"
_FIRST, _FIRST_OF_UAVS, _FOR_EACH = 21000, 51000, 400


def free_port() -> int:
    """Returns a port of this computer that no program has, for TCP and for UDP, and that no other test gets.

    It lies below those that the system gives away (32768 on): one of these could be another test's before it is used.
    """
    return next(port for port in _numbers(_FIRST) if _is_free(port))


def free_port_of_uav() -> int:
    """Returns a free port that is the default one of a UAV, 50050 + N. No other test gets those near it."""
    return next(port for port in _numbers(_FIRST_OF_UAVS, 10) if _is_free(port))


@cache
def _numbers(first: int, step: int = 1) -> Iterator[int]:
    """Returns what this worker has not given away yet; asked once it is known which worker this is."""
    return itertools.count(first + _FOR_EACH * int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:]), step)


def _is_free(port: int) -> bool:
    try:
        for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM):
            with socket.socket(socket.AF_INET, kind) as probe:
                probe.bind((_HOST, port))
    except OSError:
        return False
    return True
