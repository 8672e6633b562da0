"""Tells of many UAVs from recorded telemetry: ``python -m benchmarks.network.teller CONFIG FIRST COUNT``.

It records a flying light UAV for a second, and tells that of all, as `ual_daemon.program.network` does: in one report
for 128 UAVs. The stamp of each sample is when its report was begun, by the monotonic clock.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from itertools import count, cycle

from ual.geometry import Pose
from ual.network import computer, keys, settings
from ual.network.keys import Source
from ual.network.publishing import Publication
from ual.network.values import Report, Teller, UavReport
from ual.types import Telemetry
from ual.wire import network as wire
from ual_daemon import UAL

_AT_ONCE = 128
_JOIN_S = 60.0
_SAMPLES = 20


def main(config: str, first: int, uavs_count: int) -> None:
    """Tells until it is killed."""
    recorded = record()
    names = [f"uav_{first + number}" for number in range(uavs_count)]
    found = settings.read(config)
    by = Source(found.site, keys.publisher(names), f"{first:016x}")
    teller = Teller("0", computer.host(), computer.identifier(), 1, time.time(), found.rate_hz, uavs_count)
    publication = Publication(found, by, _JOIN_S)
    print("ready", flush=True)
    samples = cycle(recorded)
    due_s = time.monotonic()
    for _ in count():
        sample = next(samples)
        for begin in range(0, uavs_count, _AT_ONCE):
            now = replace(sample, stamp_s=time.monotonic())
            told = (
                UavReport(ns, now, "light", ("10.0.0.1:50051",), True, "pilot")
                for ns in names[begin : begin + _AT_ONCE]
            )
            publication.put(Report(teller, tuple(told)))
        due_s = max(due_s + 1.0 / found.rate_hz, time.monotonic())
        time.sleep(max(0.0, due_s - time.monotonic()))


def record() -> list[Telemetry]:
    """Returns what a light UAV tells of itself on its way."""
    with UAL(backend="light", ns="uav_1", backend_settings={"speed_factor": 20.0}) as uav:
        uav.wait_for(type(uav.state()).LANDED_DISARMED, timeout_s=_JOIN_S)
        uav.simulation.pilot_arm()
        uav.take_off(3.0)
        uav.go_to_waypoint(Pose.at(500.0, 0.0, 3.0), blocking=False)
        samples = []
        for _ in range(_SAMPLES):
            samples.append(wire.small(uav.telemetry()))
            time.sleep(1.0 / _SAMPLES)
        return samples


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
