"""Measures telemetry, from the vehicle's datagram to the callback, for one and for many subscribers of one program."""

from __future__ import annotations

from benchmarks.children import Child
from benchmarks.effort import SUBSCRIBERS, Effort
from benchmarks.results import Results
from benchmarks.setups import ClientSetup, running_setup

_SETTLE_NS = 1_000_000_000
"""The first part is left out, because subscribers are still being opened."""
_MEGA = 1e-6


def measure(vehicle: Child, effort: Effort, results: Results, way: ClientSetup) -> None:
    """Measures one round of one way: latencies in ms over all subscribers, and the share of positions that came."""
    with running_setup(vehicle, way) as flight:
        flight.prefer()
        for count in SUBSCRIBERS:
            vehicle.ask("positions")
            settle_s = _SETTLE_NS * 1e-9
            came = flight.client.ask("listen", subscribers_count=count, duration_s=effort.listen_s + settle_s)
            gone_ns = dict(vehicle.ask("positions")["gone"])
            begin_ns = min(gone_ns.values()) + _SETTLE_NS
            end_ns = min(max(gone_ns.values()), max(came["at_ns"], default=0)) - _SETTLE_NS // 4
            counted = {number: at_ns for number, at_ns in gone_ns.items() if begin_ns <= at_ns <= end_ns}
            latencies_ms = [
                (at_ns - counted[number]) * _MEGA
                for number, at_ns in zip(came["number"], came["at_ns"], strict=True)
                if number in counted
            ]
            results.add(f"telemetry_ms_{count}", way.name, latencies_ms)
            results.add(f"telemetry_share_{count}", way.name, [len(latencies_ms) / max(1, len(counted) * count)])
