"""Reads a source on a thread of its own, and opens it again where it breaks."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from queue import Empty, Full, Queue

from typing_extensions import Self

from ual.errors import UalError
from ual.shared.guard import WorkGuard
from ual_tools.rtcm.source import READ_TIMEOUT_S, SOURCE_SILENCE_S, CorrectionsSource, SourceError

FIRST_RECONNECT_PAUSE_S = 1.0
LONGEST_RECONNECT_PAUSE_S = 30.0
MOST_CHUNKS = 64
"""Most chunks that wait while the daemon is away; beyond them the oldest is dropped."""


class CorrectionsReader:
    """Reads a source until it is closed. `tell` gets, human-readable, what happens to it."""

    def __init__(
        self,
        source: CorrectionsSource,
        tell: Callable[[str], object],
        first_pause_s: float = FIRST_RECONNECT_PAUSE_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.failure: UalError | None = None
        """Why the source is of no use: it will not be tried again."""
        self._source = source
        self._tell = tell
        self._first_pause_s = first_pause_s
        self._clock = clock
        self._has_read = False
        self._guard = WorkGuard("rtcm")
        self._chunks: Queue[bytes] = Queue(MOST_CHUNKS)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rtcm", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closed.set()
        self._thread.join(2.0 * READ_TIMEOUT_S)

    def chunks(self, ended: threading.Event) -> Iterator[bytes]:
        """Yields what comes until `ended` is set, or the source is of no use."""
        while not ended.is_set() and self.failure is None:
            try:
                yield self._chunks.get(timeout=READ_TIMEOUT_S)
            except Empty:
                continue

    def _run(self) -> None:
        pause_s = self._first_pause_s
        while not self._closed.is_set():
            self._has_read = False
            try:
                self._read()
                why = "the other end has closed it"
            except SourceError as error:
                why = str(error)
            except UalError as error:
                self.failure = error
                return
            except Exception as error:  # noqa: BLE001  what a caster sends must not end the thread
                self._guard.note(error)
                why = self._guard.last_cause
            if self._closed.is_set():
                return
            pause_s = self._first_pause_s if self._has_read else min(2.0 * pause_s, LONGEST_RECONNECT_PAUSE_S)
            self._tell(f"{self._source.name}: {why}; trying again in {pause_s:g} s")
            self._closed.wait(pause_s)

    def _read(self) -> None:
        """Reads until the source ends, or is silent for too long."""
        heard_s = self._clock()
        with closing(self._source.chunks()) as chunks:
            for chunk in chunks:
                if self._closed.is_set():
                    return
                if chunk:
                    heard_s = self._clock()
                    self._keep(chunk)
                elif self._clock() - heard_s > SOURCE_SILENCE_S:
                    raise SourceError(f"nothing came for {SOURCE_SILENCE_S:g} s")

    def _keep(self, chunk: bytes) -> None:
        if not self._has_read:
            self._has_read = True
            self._tell(f"corrections come from {self._source.name}")
        while True:
            try:
                self._chunks.put_nowait(chunk)
            except Full:
                self._drop_oldest()
            else:
                return

    def _drop_oldest(self) -> None:
        try:
            self._chunks.get_nowait()
        except Empty:  # taken in the meantime
            return
