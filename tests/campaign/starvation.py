"""Notes when the computer, which has other work, did not run the daemon: by the kernel's own count of waiting."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path

PERIOD_S = 0.2
STARVED_S = 0.15
"""A thread that waited so long within a period for a processor, or this one, which overslept by so much."""


class StarvationWatch:
    """Calls `note` with begin and end of each time in which the process was starved. `pid` is asked each time."""

    def __init__(self, pid: Callable[[], int | None], note: Callable[[float, float], None]) -> None:
        self._pid, self._note = pid, note
        self._closed = threading.Event()
        self._waited_s: dict[Path, float] = {}
        self._thread = threading.Thread(target=self._run, name="starvation watch")
        self._thread.start()

    def close(self) -> None:
        self._closed.set()
        self._thread.join()

    def _run(self) -> None:
        before_s = time.monotonic()
        while not self._closed.wait(PERIOD_S):
            now_s = time.monotonic()
            if self._longest_wait_s() > STARVED_S or now_s - before_s - PERIOD_S > STARVED_S:
                self._note(before_s, now_s)
            before_s = now_s

    def _longest_wait_s(self) -> float:
        """Returns how long a thread of the process waited at most since the last time."""
        pid = self._pid()
        now = {} if pid is None else waits_s(pid)
        longest_s = max((waited_s - self._waited_s.get(path, waited_s) for path, waited_s in now.items()), default=0.0)
        self._waited_s = now
        return longest_s


def waits_s(pid: int) -> dict[Path, float]:
    """Returns how long each thread of a process has been ready but not run, by Linux' schedstat."""
    found = {}
    for path in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        try:
            found[path] = int(path.read_text().split()[1]) / 1e9
        except (OSError, IndexError):
            continue
    return found
