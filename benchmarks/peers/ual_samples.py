"""Subscribers of UAL, for the class interface and for the client."""

from __future__ import annotations

import time

from benchmarks.marks import number_of_distance
from benchmarks.peers.base import Times
from ual.interface import Uav
from ual.types import Telemetry


def listen(uav: Uav, subscribers_count: int, duration_s: float) -> Times:
    """See `benchmarks.peers.base.Peer.listen`."""
    came = Times()

    def note(sample: Telemetry) -> None:
        if sample.pose is not None:
            came.add(number_of_distance(sample.pose.position.y), time.monotonic_ns())

    subscriptions = [uav.subscribe(note) for _ in range(subscribers_count)]
    time.sleep(duration_s)
    for subscription in subscriptions:
        subscription.close()
    return came
