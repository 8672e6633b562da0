"""Ctrl-C as an event, for loops that send without a pause."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interruption() -> Iterator[threading.Event]:
    """The first Ctrl-C sets the event; the second raises `KeyboardInterrupt`, as usual. For the main thread only.

    `KeyboardInterrupt` may come amid gRPC's own steps. The channel then reads no more, and a stop takes seconds.
    """
    interrupted = threading.Event()

    def note(*_: object) -> None:
        signal.signal(signal.SIGINT, before)
        interrupted.set()

    before = signal.signal(signal.SIGINT, note)
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, before)
