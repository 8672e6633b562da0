"""Lateness of a setpoint, from just before the call in the program to the wire: by the node, `ual.Uav`, and MAVROS."""

from __future__ import annotations

import socket
import statistics
import time
from collections import defaultdict
from contextlib import ExitStack
from typing import NamedTuple

from benchmarks.children import Child, free_port
from benchmarks.effort import RATE_HZ
from benchmarks.ros2.processes import Ros
from benchmarks.servers import UalDaemon

_ARRIVAL_S = 0.3


class Mavros(NamedTuple):
    """A MAVROS of ROS 1 that runs already, as `roslaunch mavros px4.launch fcu_url:=udp://127.0.0.1:PORT@`."""

    port: int
    python: tuple[str, ...]
    """The words that run a Python of its ROS, which finds `benchmarks`."""


def measure(ros: Ros, rounds: int, count: int, mavros: Mavros | None = None) -> dict[str, list[float]]:
    """Returns the latencies of each way in ms, of all rounds. Those of UAL share a daemon in each round."""
    found: dict[str, list[float]] = defaultdict(list)
    with Child("benchmarks.vehicle") as vehicle:
        for _ in range(rounds):
            for way, latencies in _round(vehicle, ros, count).items():
                found[way] += latencies
            if mavros is not None:
                found["mavros"] += _of_mavros(vehicle, mavros, count)
    return found


def _of_mavros(vehicle: Child, mavros: Mavros, count: int) -> list[float]:
    vehicle.ask("fly", port=mavros.port)
    *before, python = mavros.python
    with Child("benchmarks.peers", "mavros", prefix=before, python=python) as child:
        for process in (vehicle, child):
            process.prefer()
        latencies = _paced(vehicle, child, count)
    vehicle.ask("rest")
    return latencies


def _round(vehicle: Child, ros: Ros, count: int) -> dict[str, list[float]]:
    port = free_port(socket.SOCK_DGRAM)
    vehicle.ask("fly", port=port)
    with ExitStack() as stack:
        daemon = stack.enter_context(UalDaemon(port))
        daemon.wait()
        address = daemon.addresses["tcp"]
        node = stack.enter_context(ros.node("ns:=uav_1", f"address:={address}", "rate_hz:=50.0"))
        given = ("--address", address)
        children = {
            "ual.Uav": stack.enter_context(Child("benchmarks.peers", "ual_stream", *given)),
            "ual_ros2": stack.enter_context(ros.child("benchmarks.peers", "ros2", *given)),
        }
        for process in (vehicle, daemon, node, *children.values()):
            process.prefer()
        latencies = {way: _paced(vehicle, child, count) for way, child in children.items()}
        vehicle.ask("rest")
        return latencies


def _paced(vehicle: Child, child: Child, count: int) -> list[float]:
    child.ask("connect")
    child.ask("pace", first=1, count=int(RATE_HZ / 2), rate_hz=RATE_HZ)  # warm
    vehicle.ask("setpoints")
    given = child.ask("pace", first=1000, count=count, rate_hz=RATE_HZ)
    time.sleep(_ARRIVAL_S)
    came_ns = dict(vehicle.ask("setpoints")["came"])
    sent = zip(given["number"], given["at_ns"], strict=True)
    return [(came_ns[number] - at_ns) * 1e-6 for number, at_ns in sent if number in came_ns]


def table(found: dict[str, list[float]]) -> list[str]:
    """Returns a line for each way."""
    lines = []
    for way, latencies in found.items():
        p99 = statistics.quantiles(latencies, n=100)[98]
        lines.append(f"{way}: p50 {statistics.median(latencies):.2f} ms, p99 {p99:.2f} ms, {len(latencies)} setpoints")
    return lines
