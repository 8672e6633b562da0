"""Cost of metrics for a flight: ``python -m benchmarks.metrics``.

A daemon flies the minimal vehicle with setpoints at 50 Hz, without metrics and with ``--metrics`` that are read once a
second, in turns. What the daemon's processor does more, and how late setpoints come, is printed with PASS or FAIL (exit
status 1 where one is missed).
"""

from __future__ import annotations

import socket
import sys
import threading
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager

from benchmarks import with_and_without
from benchmarks.children import Child, free_port, priority_text
from benchmarks.results import Results

_MOST_PERCENT = 1.0
"""Of one core."""
_READ_S = 1.0


class MetricsReader:
    """Reads the metrics of whatever daemon runs, once a second, as Prometheus would."""

    def __init__(self, address: str) -> None:
        self.count = self.size_bytes = 0
        accept = {"Accept": "application/openmetrics-text; version=1.0.0"}
        self._request = urllib.request.Request(f"http://{address}/metrics", headers=accept)
        self._ending = threading.Event()

    def run(self) -> None:
        """Reads until `end`."""
        while not self._ending.wait(_READ_S):
            try:
                with urllib.request.urlopen(self._request, timeout=_READ_S) as answer:
                    self.size_bytes = len(answer.read())
            except OSError:  # the daemon that runs now has none
                continue
            self.count += 1

    def end(self) -> None:
        """Ends it."""
        self._ending.set()


@contextmanager
def reading(address: str) -> Iterator[MetricsReader]:
    """Reads while the block runs."""
    reader = MetricsReader(address)
    thread = threading.Thread(target=reader.run, daemon=True)
    thread.start()
    yield reader
    reader.end()
    thread.join()


def main() -> None:
    """Measures, prints, and ends with 1 where a target is missed."""
    rounds = with_and_without.rounds("metrics cost")
    print(f"Priority: {priority_text()}\n")
    results, address = Results(), f"127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    measured = with_and_without.setup("metrics", "--metrics", address)
    with Child("benchmarks.vehicle") as vehicle, reading(address) as reader:
        vehicle.prefer()
        with_and_without.measure(vehicle, results, measured, rounds)
    print(f"The metrics were read {reader.count} times, {reader.size_bytes} bytes each.")
    sys.exit(not with_and_without.report(results, measured, _MOST_PERCENT))


if __name__ == "__main__":
    main()
