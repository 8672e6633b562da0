"""Runs one way to fly as a process. Tasks (see `benchmarks.children`): ``connect``, ``pace``, ``flood``, ``listen``."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from importlib import import_module
from typing import Any

from benchmarks.children import serve
from benchmarks.peers.base import Peer


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("way")
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--address", default="")
    arguments = parser.parse_args()
    peer: Peer = import_module(f"benchmarks.peers.{arguments.way}").Peer(arguments.port, arguments.address)

    def handle(task: dict[str, Any]) -> dict[str, Any]:
        do = task.pop("do")
        if do == "connect":
            peer.connect()
            return {}
        if do == "pace":
            return asdict(peer.pace(**task))
        if do == "flood":
            return {"count": peer.flood(**task)}
        if do == "listen":
            return asdict(peer.listen(**task))
        raise ValueError(do)

    try:
        serve(handle)
    finally:
        peer.close()


main()
