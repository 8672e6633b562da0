"""The kernel's count of waiting, by which flights on a starved computer are told from others."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

from tests.campaign.soak import SoakWatch
from tests.campaign.starvation import StarvationWatch, waits_s


def test_the_waiting_of_each_thread_is_counted() -> None:
    found = waits_s(os.getpid())
    assert len(found) >= 1
    assert all(waited_s >= 0.0 for waited_s in found.values())


def test_a_process_that_has_ended_waits_for_nothing() -> None:
    assert waits_s(2**22 + 1) == {}


def test_a_starved_process_is_noted() -> None:
    noted = threading.Event()
    found: list[tuple[float, float]] = []

    def note(began_s: float, ended_s: float) -> None:
        found.append((began_s, ended_s))
        noted.set()

    watch = StarvationWatch(lambda: None, note)
    watch._longest_wait_s = lambda: 1.0  # type: ignore[method-assign]
    try:
        assert noted.wait(30.0)
    finally:
        watch.close()
    assert found[0][0] < found[0][1]


def test_a_soak_reads_a_process_and_judges_it(tmp_path: Path) -> None:
    class This:
        pid = os.getpid()

        def processor_s(self) -> float:
            return time.process_time()

    verdict = SoakWatch(This(), tmp_path / "soak.csv").close()
    assert verdict.is_flat
    assert "threads" in verdict.text
    assert len((tmp_path / "soak.csv").read_text().splitlines()) >= 2
