"""Measures setpoints, from the call in the user's program to the datagram at the vehicle: latency and throughput."""

from __future__ import annotations

import time

from benchmarks.children import Child
from benchmarks.effort import RATE_HZ, Effort
from benchmarks.results import Results
from benchmarks.setups import ClientSetup, running_setup

_ARRIVAL_S = 0.3
"""Setpoints that are in transit when the last call has returned arrive within this time."""
_FLOOD_FIRST = 1_000_000
_MEGA = 1e-6


def measure(vehicle: Child, effort: Effort, results: Results, way: ClientSetup) -> None:
    """Measures one round of one way: latencies in ms, and the setpoints a second that arrived."""
    with running_setup(vehicle, way) as flight:
        flight.prefer()
        flight.client.ask("pace", first=1, count=int(RATE_HZ / 2), rate_hz=RATE_HZ)  # warm
        vehicle.ask("setpoints")
        given = flight.client.ask("pace", first=1000, count=effort.paced_count, rate_hz=RATE_HZ)
        time.sleep(_ARRIVAL_S)
        came_ns = dict(vehicle.ask("setpoints")["came"])
        latencies_ms = [
            (came_ns[number] - at_ns) * _MEGA
            for number, at_ns in zip(given["number"], given["at_ns"], strict=True)
            if number in came_ns
        ]
        results.add("setpoint_ms", way.name, latencies_ms)
        results.add("setpoints_lost", way.name, [effort.paced_count - len(latencies_ms)])

        began_s = time.monotonic()
        flight.client.ask("flood", first=_FLOOD_FIRST, duration_s=effort.flood_s)
        took_s = time.monotonic() - began_s
        time.sleep(_ARRIVAL_S)
        numbers = [number for number, _ in vehicle.ask("setpoints")["came"] if number >= _FLOOD_FIRST]
        results.add("setpoints_per_s", way.name, [len(numbers) / took_s])
