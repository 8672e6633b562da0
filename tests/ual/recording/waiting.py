"""Waits for what another thread or process does."""

from __future__ import annotations

import threading
from collections.abc import Callable

LIMIT_S = 60.0


def wait_until(is_so: Callable[[], bool]) -> None:
    """Waits until something is so, on a busy machine, too."""
    pause = threading.Event()
    for _ in range(int(LIMIT_S / 0.01)):
        if is_so():
            return
        pause.wait(0.01)
    raise AssertionError(f"it was not so within {LIMIT_S} s")
