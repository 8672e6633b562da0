"""Loads one daemon for a long time, and shows whether its memory grows: ``python -m benchmarks.flood --minutes 15``.

The vehicle sends ten times as much as PX4. One program floods setpoints; another one has ten subscribers, which leave
and come back all the time. The setpoints of an hour of flight (180,000 at 50 Hz) take about a minute.
"""

from __future__ import annotations

import argparse
import socket
import statistics
import sys
import time
from collections.abc import Iterator

from benchmarks.children import Child, free_port
from benchmarks.servers import UalDaemon

_RATE_FACTOR = 10.0
_PERIOD_S = 5.0
_SUBSCRIBERS = 10
_WARM_SHARE = 0.2
_LIMIT_MIB_PER_HOUR = 1.0
_SETPOINTS_PER_HOUR = 180_000


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.flood", description=__doc__)
    parser.add_argument("--minutes", type=float, default=15.0)
    arguments = parser.parse_args()
    samples = []
    for minutes, mib, setpoints_count, samples_count in _load(arguments.minutes * 60.0):
        samples.append((minutes, mib, setpoints_count))
        print(
            f"{minutes:6.2f} min {mib:7.2f} MiB {setpoints_count:10,d} setpoints {samples_count:10,d} samples",
            flush=True,
        )
    warm = samples[int(len(samples) * _WARM_SHARE) :]
    slope = statistics.linear_regression([sample[2] for sample in warm], [sample[1] for sample in warm]).slope
    growth = slope * _SETPOINTS_PER_HOUR
    is_flat = growth <= _LIMIT_MIB_PER_HOUR
    print(
        f"after the first {_WARM_SHARE:.0%}: {min(s[1] for s in warm):.2f} to {max(s[1] for s in warm):.2f} MiB, "
        f"{growth:+.3f} MiB for {_SETPOINTS_PER_HOUR:,} setpoints, an hour at 50 Hz "
        f"(at most {_LIMIT_MIB_PER_HOUR:g}): {'PASS' if is_flat else 'FAIL'}"
    )
    return int(not is_flat)


def _load(duration_s: float) -> Iterator[tuple[float, float, int, int]]:
    """Yields again and again: minutes so far, the daemon's resident MiB, the setpoints and the telemetry so far."""
    port = free_port(socket.SOCK_DGRAM)
    with Child("benchmarks.vehicle") as vehicle:
        vehicle.prefer()  # if the vehicle fell silent, the daemon would refuse setpoints, which ends the flood
        vehicle.ask("fly", port=port, rate_factor=_RATE_FACTOR)
        with UalDaemon(port) as daemon:
            daemon.wait()
            arguments = ("ual_stream", "--address", daemon.addresses["tcp"])
            with (
                Child("benchmarks.peers", *arguments) as sender,
                Child("benchmarks.peers", *arguments) as listener,
            ):
                for child in (sender, listener):
                    child.ask("connect")
                began_s, setpoints_count, samples_count = time.monotonic(), 0, 0
                while time.monotonic() - began_s < duration_s:
                    sender.send("flood", first=setpoints_count, duration_s=_PERIOD_S)
                    listener.send("listen", subscribers_count=_SUBSCRIBERS, duration_s=_PERIOD_S)
                    sender.answer()
                    samples_count += len(listener.answer()["number"])
                    setpoints_count += len(vehicle.ask("setpoints")["came"])
                    vehicle.ask("positions")
                    minutes = (time.monotonic() - began_s) / 60.0
                    yield minutes, daemon.resident_mib(), setpoints_count, samples_count


if __name__ == "__main__":
    sys.exit(main())
