"""The guard of speed: what it reads of callgrind, and what it takes for a rise. `make bench-guard` counts."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.guard.__main__ import Figure
from benchmarks.guard.callgrind import totals
from benchmarks.guard.defects import DEFECTS, install

_FILE = "desc: Trigger: Client Request: {name}:{times}\nevents: Ir\n\ntotals: {total}\n"


def _dump(directory: Path, number: int, name: str, times: int, total: int, thread: int = 1) -> None:
    text = _FILE.format(name=name, times=times, total=total)
    (directory / f"counts.{number}-{thread:02}").write_text(text)


def test_a_count_is_that_of_one_call_on_the_first_thread(tmp_path: Path) -> None:
    _dump(tmp_path, 1, "-", 1, 999)
    _dump(tmp_path, 2, "set_velocity, clear", 40, 8_000_000)
    _dump(tmp_path, 2, "set_velocity, clear", 40, 77, thread=2)
    assert totals(tmp_path, has_all_threads=False) == {"set_velocity, clear": [200_000.0]}


@pytest.mark.parametrize(
    ("figure", "is_over"),
    [
        (Figure(102.0, "instructions"), False),
        (Figure(102.1, "instructions"), True),
        (Figure(80.0, "instructions"), False),
        (Figure(101.0, "MiB"), False),
        (Figure(101.1, "MiB"), True),
    ],
)
def test_two_percent_of_instructions_or_one_mebibyte_more_is_a_rise(figure: Figure, is_over: bool) -> None:
    assert figure.is_over(100.0) is is_over


def test_a_defect_that_it_does_not_know_is_refused() -> None:
    assert len(DEFECTS) == 5
    with pytest.raises(KeyError):
        install("a defect that nobody wrote")
