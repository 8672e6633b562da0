"""The ways to fly that are compared, each as a process of its own: ``python -m benchmarks.peers NAME ...``.

Every way is one module with a class of the same few members (`base.Peer`).
"""

from __future__ import annotations

from importlib.util import find_spec

NEEDS = {"native": "mavsdk", "mavsdk_grpc": "mavsdk_grpc"}
"""The package that a way needs beside ours, by the way's name."""


def is_missing(way: str) -> bool:
    """Whether what a way needs is not installed."""
    return way in NEEDS and find_spec(NEEDS[way]) is None
