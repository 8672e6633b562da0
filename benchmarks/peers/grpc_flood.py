"""Sends as many setpoints as possible by one stream of the contract, to any server."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

from ual.v1 import ual_pb2 as pb


def flood(stub: Any, make: Callable[[int], pb.StreamSetpointsRequest], first: int, duration_s: float) -> int:  # noqa: ANN401  gRPC's stubs have no type of their own at run time
    """See `benchmarks.peers.base.Peer.flood`."""
    count = 0

    def setpoints() -> Iterator[pb.StreamSetpointsRequest]:
        nonlocal count
        ends_s = time.monotonic() + duration_s
        while time.monotonic() < ends_s:
            yield make(first + count)
            count += 1

    stub.StreamSetpoints(setpoints())
    return count
