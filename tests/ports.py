"""Ports for what a test starts itself."""

from __future__ import annotations

import itertools
import os
import socket

_HOST = "127.0.0.1"
_FIRST, _FIRST_OF_UAVS, _FOR_EACH = 21000, 51000, 400
_WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
_numbers = itertools.count(_FIRST + _FOR_EACH * _WORKER)
_numbers_of_uavs = itertools.count(_FIRST_OF_UAVS + _FOR_EACH * _WORKER, 10)


def free_port() -> int:
    """Returns a port of this computer that no program has, for TCP and for UDP, and that no other test gets.

    It lies below those that the system gives away (32768 on): one of these could be another test's before it is used.
    """
    return next(port for port in _numbers if _is_free(port))


def free_port_of_uav() -> int:
    """Returns a free port that is the default one of a UAV, 50050 + N. No other test gets those near it."""
    return next(port for port in _numbers_of_uavs if _is_free(port))


def _is_free(port: int) -> bool:
    try:
        for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM):
            with socket.socket(socket.AF_INET, kind) as probe:
                probe.bind((_HOST, port))
    except OSError:
        return False
    return True
