"""Measures the processor's share of the server and of the program, at 50 Hz setpoints and a recorded stream of PX4."""

from __future__ import annotations

import socket
import time
from contextlib import ExitStack

from benchmarks.children import Child, free_port
from benchmarks.effort import RATE_HZ
from benchmarks.results import Results
from benchmarks.setups import ClientSetup, server_of

TRACE = "px4_offboard_manual_recover"
_FROM_S, _TO_S = 8.0, 21.9
"""Part of the recording in which it flies in OFFBOARD, in s."""
_WARM_S = 1.0


def measure(vehicle: Child, results: Results, way: ClientSetup) -> None:
    """Measures one round of one way: shares of one core, in percent."""
    port = free_port(socket.SOCK_DGRAM)
    with ExitStack() as stack:
        began_s = time.monotonic()
        replayed = vehicle.ask("replay", port=port, trace=TRACE, from_s=_FROM_S, to_s=_TO_S, has_fence=way.has_fence)
        results.add("stream_messages_per_s", "vehicle", [replayed["messages_per_s"]])
        server = stack.enter_context(server_of(way, port))
        assert server is not None
        address = server.addresses[way.address]
        client = stack.enter_context(Child("benchmarks.peers", way.peer, "--port", str(port), "--address", address))
        client.ask("connect")
        for process in (server, client):
            process.prefer()
        client.ask("pace", first=1, count=int(_WARM_S * RATE_HZ), rate_hz=RATE_HZ)
        left_s = began_s + _TO_S - _FROM_S - time.monotonic()
        count = int((left_s - 1.0) * RATE_HZ)
        if count < RATE_HZ:
            raise RuntimeError(f"{way.name} took too long to connect: the recorded flight was over")
        vehicle.ask("setpoints")
        before = time.monotonic(), server.processor_s(), client.processor_s()
        client.ask("pace", first=1000, count=count, rate_hz=RATE_HZ)
        after = time.monotonic(), server.processor_s(), client.processor_s()
        came = len(vehicle.ask("setpoints")["came"])
        if came < 0.95 * count:
            raise RuntimeError(f"{way.name}: only {came} of {count} setpoints came while the recorded flight ran")
        took_s, server_s, client_s = (now - then for now, then in zip(after, before, strict=True))
        results.add("server_percent", way.name, [100.0 * server_s / took_s])
        results.add("client_percent", way.name, [100.0 * client_s / took_s])
        results.add("memory_mib", f"{way.name}: 50 Hz and the PX4 stream", [server.resident_mib()])
        vehicle.ask("rest")
