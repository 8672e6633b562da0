"""The pace of a simulated autopilot that is stepped instead of being waited for."""

from __future__ import annotations

import threading
import time

from tests.waiting import is_at_work

_LATE_S = 0.05
_LOOK_S = 0.0005
_PATIENCE_S = 5.0
_tests = threading.main_thread()


class Pace:
    """Keeps steps of `step_s` at most `speed` times as fast as real time. What a busy computer missed is lost.

    Time stands while the thread of the test has something to do. Nothing happens between an event that a test waits for
    and its next act, however busy the computer is.
    """

    def __init__(self, step_s: float, speed: float) -> None:
        self._period_s = step_s / speed
        self._due_s = time.monotonic()
        self._has_stood_long = False

    def wait(self) -> None:
        """Waits until the next step is due, and until the test waits for it."""
        self._due_s += self._period_s
        wait_s = self._due_s - time.monotonic()
        if wait_s > 0.0:
            time.sleep(wait_s)
        elif wait_s < -_LATE_S:
            self._due_s -= wait_s
        # A test that steps the simulation itself waits for no other thread.
        if threading.get_ident() != _tests.ident and is_at_work(_tests):
            self._stand()
        else:
            self._has_stood_long = False

    def _stand(self) -> None:
        """Lets no time pass, but for a test that waits in a way which `is_at_work` does not know."""
        end_s = time.monotonic() + _PATIENCE_S
        while not self._has_stood_long and is_at_work(_tests):
            time.sleep(_LOOK_S)
            self._has_stood_long = time.monotonic() > end_s
