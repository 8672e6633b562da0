"""Bounds the end of the process in time, whatever hangs in it."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Callable

from ual_daemon import logs

_log = logging.getLogger(__name__)

_NOT_IN_TIME_STATUS = 3


def _exit() -> None:
    for handler in logging.getLogger().handlers:
        handler.close()
    os._exit(_NOT_IN_TIME_STATUS)


def within(limit_s: float, exit_: Callable[[], None] = _exit) -> threading.Timer:
    """Ends the process with status 3 if it still runs after the limit: a thread or a driver does not end by itself."""

    def end() -> None:
        logs.event(_log, logging.ERROR, "end_too_slow", why=f"it did not end within {limit_s:g} s", limit_s=limit_s)
        exit_()

    timer = threading.Timer(limit_s, end)
    timer.name, timer.daemon = "end", True
    timer.start()
    return timer
