"""The kernel's count of waiting, by which flights on a starved computer are told from others."""

from __future__ import annotations

import os
import threading

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
