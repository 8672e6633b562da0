"""The clients of the ways that are compared, each as a process of its own: ``python -m benchmarks.peers NAME ...``.

Each way is one module with a subclass of `base.Peer`.
"""

from __future__ import annotations

from importlib.util import find_spec

NEEDS = {"native": "mavsdk", "mavsdk_grpc": "mavsdk_grpc"}
"""The package that a way needs in addition to UAL, by the way's name."""


def is_missing(way: str) -> bool:
    """Returns whether the package that a way needs is not installed."""
    return way in NEEDS and find_spec(NEEDS[way]) is None
