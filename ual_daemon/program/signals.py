"""The signals that end a daemon: the first in a way that is safe for the UAVs, the second at once."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
from collections.abc import Callable, Sequence
from types import FrameType

from ual_daemon import logs

_log = logging.getLogger(__name__)

SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)


def on_first(
    stop: Callable[[], None], at_once: Callable[[], None] = lambda: None, signals: Sequence[signal.Signals] = SIGNALS
) -> None:
    """Calls `stop` on the running event loop at the first signal. A second one calls `at_once` and ends the process."""
    loop = asyncio.get_running_loop()
    # nohup ignores SIGHUP, and means it. A shell without a terminal ignores SIGINT for what it starts with `&`, but
    # such a signal to a daemon is meant to end it.
    is_kept = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    numbers = [number for number in signals if not (is_kept and number is signal.SIGHUP)]

    def end_at_once(number: int, frame: FrameType | None) -> None:
        del frame
        at_once()
        os._exit(128 + number)

    def on_signal(number: signal.Signals) -> None:
        for each in numbers:
            loop.remove_signal_handler(each)
            signal.signal(each, end_at_once)
        logs.event(_log, logging.INFO, "signal", name=number.name, again="ends at once")  # now it does
        stop()

    for number in numbers:
        loop.add_signal_handler(number, on_signal, number)
