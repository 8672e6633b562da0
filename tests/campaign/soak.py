"""Whether the daemon's memory, threads and descriptors stay flat while it flies for hours."""

from __future__ import annotations

import contextlib
import csv
import threading
import time
from pathlib import Path

from benchmarks.children import ChildError
from benchmarks.soak.readings import FlatnessVerdict, MeasuredProcess, ProcessReading, judge, read

PERIOD_S = 5.0


class SoakWatch:
    """Reads the process every few seconds, to `path`."""

    def __init__(self, process: MeasuredProcess, path: Path) -> None:
        self._process, self._path = process, path
        self._readings: list[ProcessReading] = []
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="soak", daemon=True)
        self._thread.start()

    def close(self) -> FlatnessVerdict:
        """Ends it, and judges what was read."""
        self._closed.set()
        self._thread.join()
        return judge(self._readings)

    def _run(self) -> None:
        began_s = time.monotonic()
        with self._path.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(ProcessReading._fields)
            while True:
                with contextlib.suppress(ChildError):  # a fault has killed it; another comes
                    self._readings.append(read(self._process, time.monotonic() - began_s))
                    writer.writerow(self._readings[-1])
                    file.flush()
                if self._closed.wait(PERIOD_S):
                    return
