"""The program that flies, as a process. Tasks (see `benchmarks.children`): ``connect`` and ``pace``."""

from __future__ import annotations

import itertools
import sys
from dataclasses import asdict
from typing import Any

import ual
from benchmarks.children import serve
from benchmarks.peers.ual_stream import Peer
from ual.types import State

_BLOCK = 10_000


def main() -> None:
    address = sys.argv[1]
    peer = Peer(0, address)
    blocks = itertools.count(1)

    def handle(task: dict[str, Any]) -> dict[str, Any]:
        if task.pop("do") == "pace":
            return asdict(peer.pace(next(blocks) * _BLOCK, **task))
        with ual.Uav(address=address) as uav:
            uav.wait_for(State.LANDED_ARMED, timeout_s=30.0)
            uav.take_off(6.0)
        peer.connect()
        return {}

    try:
        serve(handle)
    finally:
        peer.close()


main()
