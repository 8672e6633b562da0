"""Real time for simulated autopilots: a thread each."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from tests.simulators.autopilot import STEP_S, Autopilot

_LATE_S = 0.3
"""So much lost time is caught up; what is more (a stopped or starved process) passes without the vehicle."""


def run(autopilot: Autopilot, stopped: threading.Event, speed: float = 1.0) -> None:
    """Steps it until stopped, `speed` times as fast as real."""
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
    """While the block runs, time passes for these autopilots; then their links are closed."""
    stopped = threading.Event()
    errors: list[BaseException] = []

    def fly(autopilot: Autopilot) -> None:
        try:
            run(autopilot, stopped, speed)
        except BaseException as error:  # noqa: BLE001 - raised below, in the test's thread
            traceback.print_exc()  # now: what waits for this autopilot may wait for long
            errors.append(error)

    threads = [threading.Thread(target=fly, args=(each,), name=f"autopilot {each.system_id}") for each in autopilots]
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
    if errors:
        raise errors[0]
