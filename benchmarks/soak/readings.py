"""Readings of a process from the system, and whether they stayed flat."""

from __future__ import annotations

import re
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from benchmarks.children import ChildError

WARM_S = 900.0
"""Memory is judged after the first quarter of an hour."""
LIMIT_MIB = 1.0
_WINDOW_S = 60.0
"""Memory is judged by the medians of a minute: a call that is under way when it is read is no growth."""
_SPREAD_COUNT = 12
"""Threads or descriptors that may come and go with calls."""


class MeasuredProcess(Protocol):
    """A process."""

    @property
    def pid(self) -> int:
        """Its id."""

    def processor_s(self) -> float:
        """Returns its processor time so far."""


class ProcessReading(NamedTuple):
    """One look at a process. Resident memory with all, and the anonymous part alone (without files)."""

    at_s: float
    resident_mib: float
    anonymous_mib: float
    threads_count: int
    descriptors_count: int
    processor_s: float


class FlatnessVerdict(NamedTuple):
    """Whether it stayed flat, and a line that says so."""

    is_flat: bool
    text: str


def read(process: MeasuredProcess, at_s: float) -> ProcessReading:
    """Returns a reading now.

    Raises:
        ChildError: The process has ended.

    """
    try:
        status = Path(f"/proc/{process.pid}/status").read_text()
        descriptors_count = len(list(Path(f"/proc/{process.pid}/fd").iterdir()))
    except FileNotFoundError:
        raise ChildError(f"process {process.pid} has ended") from None
    numbers = {key: int(value) for key, value in re.findall(r"^(VmRSS|RssAnon|Threads):\s+(\d+)", status, re.MULTILINE)}
    if "VmRSS" not in numbers:
        raise ChildError(f"process {process.pid} has ended")
    return ProcessReading(
        at_s,
        numbers["VmRSS"] / 1024.0,
        numbers["RssAnon"] / 1024.0,
        numbers["Threads"],
        descriptors_count,
        process.processor_s(),
    )


def judge(readings: Sequence[ProcessReading]) -> FlatnessVerdict:
    """Judges the readings after `WARM_S`; where the run was short, those of its second half."""
    end_s = readings[-1].at_s
    since_s = WARM_S if end_s >= 2.0 * WARM_S else end_s / 2.0
    warm = [reading for reading in readings if reading.at_s >= since_s]
    resident = _medians(warm, [reading.resident_mib for reading in warm])
    spread_mib = max(resident) - min(resident)
    raw = [reading.resident_mib for reading in warm]
    threads = _medians(warm, [float(reading.threads_count) for reading in warm])
    descriptors = _medians(warm, [float(reading.descriptors_count) for reading in warm])
    is_flat = (
        spread_mib <= LIMIT_MIB
        and max(threads) - min(threads) <= _SPREAD_COUNT
        and max(descriptors) - min(descriptors) <= _SPREAD_COUNT
    )
    text = (
        f"after {since_s / 60.0:.0f} min: resident {min(resident):.2f} to {max(resident):.2f} MiB by the minute, "
        f"{spread_mib:.2f} apart (at most {LIMIT_MIB:g}), each reading {min(raw):.2f} to {max(raw):.2f}; "
        f"trend {_trend_mib_per_hour(warm):+.2f} MiB/h; {min(threads):g} to {max(threads):g} threads, "
        f"{min(descriptors):g} to {max(descriptors):g} descriptors: {'PASS' if is_flat else 'FAIL'}"
    )
    return FlatnessVerdict(is_flat, text)


def _medians(readings: Sequence[ProcessReading], values: Sequence[float]) -> list[float]:
    """Returns the median of each minute."""
    minutes: dict[int, list[float]] = {}
    for reading, value in zip(readings, values, strict=True):
        minutes.setdefault(int(reading.at_s / _WINDOW_S), []).append(value)
    return [statistics.median(found) for found in minutes.values()]


def _trend_mib_per_hour(readings: Sequence[ProcessReading]) -> float:
    if len(readings) < 2:
        return 0.0
    times_h = [reading.at_s / 3600.0 for reading in readings]
    return statistics.linear_regression(times_h, [reading.resident_mib for reading in readings]).slope
