"""Runs simulated autopilots in real time, each on a thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from tests.simulators.autopilot import STEP_S, Autopilot

_LATE_S = 0.3
"""The most lost time that is caught up. More (of a process that was stopped or got no processor) is skipped."""


class Stepped(Protocol):
    """Vehicle with a time of its own."""

    def step(self) -> None:
        """Advances it by `STEP_S`."""


def run(autopilot: Stepped, stopped: threading.Event, speed: float = 1.0) -> None:
    """Steps it until stopped, `speed` times as fast as real time."""
    due_s = time.monotonic()
    while not stopped.is_set():
        autopilot.step()
        due_s += STEP_S / speed
        now_s = time.monotonic()
        if due_s > now_s:
            time.sleep(due_s - now_s)
        elif now_s - due_s > _LATE_S:
            due_s = now_s


@contextmanager
def flying(*autopilots: Autopilot, speed: float = 1.0) -> Iterator[None]:
    """Runs these autopilots during the block, and then closes their links."""
    stopped = threading.Event()
    threads = [
        threading.Thread(target=run, args=(each, stopped, speed), name=f"autopilot {each.system_id}")
        for each in autopilots
    ]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        stopped.set()
        for thread in threads:
            thread.join()
        for each in autopilots:
            each.close()
