"""How long a velocity takes from the call of the interface to the backend, three ways, in one run.

    class   `UAL.set_velocity`, in the process
    stream  `ual.Uav.set_velocity`, which streams, over loopback TCP to a daemon in another process
    unary   the plain `SetVelocity` call over the same

Latency at 50 Hz, and how many setpoints a second get through when they come as fast as they can. The last column
compares with unary in the same run: absolute times depend on the machine and on what else it does.
"""

from __future__ import annotations

import asyncio
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from typing import Any

import grpc

import ual
from ual import convert
from ual.interface import Uav
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.values import Setpoint, VelocitySetpoint
from ual_daemon.ual import UAL

RATE_HZ = 50.0
LATENCY_S = float(os.environ.get("UAL_BENCH_SECONDS", "5"))
THROUGHPUT_S = 2.0
# A speed tells one setpoint from another: 0.1 m/s and this much more for each.
MARK_M_S = 1e-6
AGAIN = 500_000
"""A number that nothing before has come to."""


class Probe(LightBackend):
    """The light backend, which notes when each setpoint first came."""

    def __init__(self, ns: str) -> None:
        super().__init__(BackendOptions(ns))
        self.came_s: dict[int, float] = {}

    def send(self, setpoint: Setpoint) -> None:
        if isinstance(setpoint, VelocitySetpoint) and setpoint.velocity.x > 0.05:
            self.came_s.setdefault(round((setpoint.velocity.x - 0.1) / MARK_M_S), time.monotonic())
        super().send(setpoint)


def velocity(number: int) -> ual.TwistStamped:
    return ual.TwistStamped(ual.Twist(ual.Vector3(0.1 + number * MARK_M_S, 0.0, 0.0)))


def measure_latency(send: Callable[[int], object], first: int) -> dict[int, float]:
    """Sends at 50 Hz; when each setpoint was given, by its number."""
    given_s: dict[int, float] = {}
    due_s = time.monotonic()
    for number in range(first, first + int(LATENCY_S * RATE_HZ)):
        due_s += 1.0 / RATE_HZ
        time.sleep(max(0.0, due_s - time.monotonic()))
        given_s[number] = time.monotonic()
        send(number)
    return given_s


def measure_throughput(send: Callable[[int], object]) -> float:
    """Calls a second when one follows the other at once."""
    started_s, count = time.monotonic(), 0
    while time.monotonic() - started_s < THROUGHPUT_S:
        send(count)
        count += 1
    return count / (time.monotonic() - started_s)


def stream_throughput(stub: ual_pb2_grpc.UalServiceStub[Any]) -> float:
    """Setpoints a second that the daemon accepted from one stream."""
    started_s = time.monotonic()

    def requests() -> Iterator[pb.StreamSetpointsRequest]:
        number = 0
        while time.monotonic() - started_s < THROUGHPUT_S:
            yield convert.setpoint_to_proto(velocity(number))
            number += 1

    accepted: int = stub.StreamSetpoints(requests()).accepted_count
    return accepted / (time.monotonic() - started_s)


def main() -> None:
    rows: list[tuple[str, list[float], float]] = []
    probe = Probe("uav_1")
    with UAL(probe, "uav_1") as uav:
        fly(uav)
        send_here = lambda number: uav.set_velocity(velocity(number))  # noqa: E731
        given_s = measure_latency(send_here, 0)
        rows.append(("class", latencies_ms(given_s, probe.came_s), measure_throughput(send_here)))

    with tempfile.TemporaryDirectory() as directory:
        environment = {**os.environ, "UAL_RUNTIME_DIR": directory}
        server = subprocess.Popen(
            [sys.executable, __file__, "--serve"],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert server.stdin is not None
        assert server.stdout is not None
        address = server.stdout.readline().strip()

        def came_s() -> dict[int, float]:
            assert server.stdin is not None
            assert server.stdout is not None
            print("tell", file=server.stdin, flush=True)
            return {int(number): at_s for number, at_s in json.loads(server.stdout.readline()).items()}

        with ual.Uav(address=address) as remote, grpc.insecure_channel(address) as channel:
            fly(remote)
            stub = ual_pb2_grpc.UalServiceStub(channel)
            send_unary = lambda number: stub.SetVelocity(pb.SetVelocityRequest(velocity=packed(number)))  # noqa: E731
            given_s = measure_latency(lambda number: remote.set_velocity(velocity(number)), 0)
            rows.append(("stream", latencies_ms(given_s, came_s()), stream_throughput(stub)))
            given_s = measure_latency(send_unary, AGAIN)
            rows.append(("unary", latencies_ms(given_s, came_s()), measure_throughput(send_unary)))
        server.stdin.close()
        server.wait(60)

    _, unary_ms, unary_rate = rows[-1]
    print(f"{'':8}{'p50 ms':>8}{'p99 ms':>8}{'per s':>9}   p50, per s against unary")
    for name, found_ms, rate in rows:
        p50, p99 = statistics.median(found_ms), statistics.quantiles(found_ms, n=100)[98]
        compared = f"{p50 / statistics.median(unary_ms):6.2f} {rate / unary_rate:6.1f}"
        print(f"{name:8}{p50:8.3f}{p99:8.3f}{rate:9.0f}   {compared}")


def packed(number: int) -> pb.TwistStamped:
    return convert.setpoint_to_proto(velocity(number)).velocity


def fly(uav: Uav) -> None:
    uav.simulation.pilot_arm()
    while uav.state() is not ual.State.LANDED_ARMED:
        time.sleep(0.01)
    uav.take_off(1.0)


def latencies_ms(given_s: dict[int, float], came_s: dict[int, float]) -> list[float]:
    return [(came_s[number] - at_s) * 1000.0 for number, at_s in given_s.items() if number in came_s]


def serve() -> None:
    """A daemon's server around the probe; for each line on stdin, says when the setpoints since the last one came."""
    from ual_daemon.server.addresses import Address
    from ual_daemon.server.server import Server
    from ual_daemon.vehicle import Vehicle

    probe = Probe("uav_1")
    vehicle = Vehicle(probe)

    async def run() -> None:
        server = Server(vehicle)
        (address,) = await server.start([Address("127.0.0.1", 0)])
        vehicle.open()
        print(address, flush=True)
        await asyncio.to_thread(answer)
        server.begin_shutdown()
        await server.stop()
        vehicle.close()

    def answer() -> None:
        for _ in sys.stdin:
            print(json.dumps(probe.came_s), flush=True)
            probe.came_s = {}

    asyncio.run(run())


if __name__ == "__main__":
    serve() if "--serve" in sys.argv else main()
