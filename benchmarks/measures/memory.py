"""Resident memory of the daemon after a flight of the light backend, and of servers that were flooded."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import ual
from benchmarks.results import Results
from benchmarks.servers import UalDaemon
from ual.types import State

_LIMIT_S = 60.0
_SPEED_FACTOR = 10.0


def measure_flight(results: Results) -> None:
    """Measures one flight."""
    results.add("memory_mib", "UAL: after a flight of the light backend", [flight_mib(UalDaemon.resident_mib)])


def flight_mib(read: Callable[[UalDaemon], float], *flags: str, run: Sequence[str] = ("ual_daemon",)) -> float:
    """Returns the memory of a daemon that took off, flew a path and streamed velocities, and landed, with one telemetry
    subscriber. `read` reads it; `flags` and `run` are those of `UalDaemon`.
    """
    with UalDaemon(None, "--auto-arm", *flags, run=run) as daemon:
        daemon.wait()
        with ual.Uav(address=daemon.addresses["tcp"]) as uav:
            uav.simulation.set_speed_factor(_SPEED_FACTOR)
            with uav.subscribe(lambda _: None):
                _until(uav, State.LANDED_ARMED)
                uav.take_off(3.0)
                uav.go_to_waypoint(ual.Pose.at(4.0, 2.0, 3.0, yaw_rad=1.5))
                uav.follow_path([ual.Pose.at(0.0, 5.0, 4.0), ual.Pose.at(-4.0, 0.0, 3.0), ual.Pose.at(0.0, 0.0, 3.0)])
                for _ in range(100):
                    uav.set_velocity(ual.Twist(ual.Vector3(0.5, 0.0, 0.0)))
                    time.sleep(0.01)
                uav.land()
                _until(uav, State.LANDED_DISARMED, State.LANDED_ARMED)
            return read(daemon)


def _until(uav: ual.Uav, *states: State) -> None:
    deadline_s = time.monotonic() + _LIMIT_S
    while uav.state() not in states:
        if time.monotonic() > deadline_s:
            raise TimeoutError(f"not {states} within {_LIMIT_S:g} s")
        time.sleep(0.01)
