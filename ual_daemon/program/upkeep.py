"""Upkeep of what the daemon has on the disk: it is looked at each second, on a thread that flies nothing."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial

from ual.shared.guard import WorkGuard

UPKEEP_PERIOD_S = 1.0
_CLOSE_TIMEOUT_S = 1.0
"""A disk that does not answer must not delay the end."""


class Upkeep:
    """Calls back each second, until `close`: each gets the time of a clock that does not jump, in seconds."""

    def __init__(self, works: Sequence[Callable[[float], object]]) -> None:
        self._works = works
        self._guard = WorkGuard("upkeep")
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="upkeep", daemon=True)

    def start(self) -> None:
        """Begins."""
        self._thread.start()

    def close(self) -> None:
        """Ends it."""
        self._closing.set()
        if self._thread.ident is not None:
            self._thread.join(_CLOSE_TIMEOUT_S)

    def _run(self) -> None:
        while not self._closing.wait(UPKEEP_PERIOD_S):
            now_s = time.monotonic()
            for work in self._works:
                self._guard.contain(partial(work, now_s))
