"""Common part of all attacking programs: they attack until their standard input ends, and print a number."""

from __future__ import annotations

import sys
import threading
import time


def stop_at_end_of_input() -> threading.Event:
    """Returns an event that is set when standard input ends."""
    stop = threading.Event()

    def wait() -> None:
        sys.stdin.read()
        stop.set()

    threading.Thread(target=wait, daemon=True).start()
    return stop


class Pace:
    """Spreads acts evenly: at most `rate_hz` of them a second, of all threads together; 0: as many as go."""

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz if rate_hz else 0.0
        self._lock = threading.Lock()
        self._next_s = time.monotonic()

    def wait(self) -> None:
        """Blocks until the next act is due. Acts that were missed are left out."""
        if not self._period_s:
            return
        with self._lock:
            now_s = time.monotonic()
            self._next_s = max(self._next_s + self._period_s, now_s - 0.05)
            pause_s = self._next_s - now_s
        if pause_s > 0.0:
            time.sleep(pause_s)
