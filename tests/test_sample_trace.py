"""The trace of a sample: its stations are functions that exist, and each stamp belongs to the sample that passed."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from benchmarks.sample_trace.stamps import Stamps, Station
from benchmarks.sample_trace.stations import OF, SENT
from benchmarks.sample_trace.table import markdown


@pytest.mark.parametrize("kind", OF)
def test_each_station_is_a_function(kind: str) -> None:
    for station in OF[kind]():
        assert callable(getattr(station.owner, station.function)), station


def test_a_sample_is_stamped_at_each_station_it_passes() -> None:
    code = SimpleNamespace(receive=lambda: None, decode=lambda number: number, tell=lambda: None)
    stamps = Stamps()
    stamps.wrap(Station(code, "receive", "woken", "received", begins=True))
    stamps.wrap(Station(code, "decode", after="decoded", number=lambda result, _: result or None))
    stamps.wrap(Station(code, "tell", "told"))
    for number in (7, 0, 8):  # 0: a message that is no sample
        code.receive()
        assert code.decode(number) == number
        if number:
            code.tell()
    found = stamps.take()
    assert {number: list(row) for number, row in found.items()} == {
        7: ["woken", "received", "decoded", "told"],
        8: ["woken", "received", "decoded", "told"],
    }
    times_ns = [at_ns for row in found.values() for at_ns, _ in row.values()]
    assert times_ns == sorted(times_ns)
    assert stamps.take() == {}


def test_the_table_shows_the_time_from_each_station_to_the_next() -> None:
    times = {
        number: {"decoded": (begin_ns + 30_000, 0), SENT: (begin_ns, 0), "told": (begin_ns + 50_000, 0)}
        for number, begin_ns in ((1, 1_000_000), (2, 9_000_000))
    }
    calls = {1: {"decoded": (0, 5), "told": (0, 2)}}
    assert markdown("class", times, calls).splitlines() == [
        "| class, 2 samples | µs, p50 | p99 | Python calls |",
        "|---|---|---|---|",
        "| decoded | 30 | 30 | 5 |",
        "| told | 20 | 20 | 2 |",
        "| all (its own p50, p99) | 50 | 50 | 7 |",
    ]
