"""The autopilot's logs: one download at a time, piece by piece. The manual is docs/how-to/logs.md."""

from __future__ import annotations

import hashlib
import logging
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager

from ual.errors import RejectedByAutopilotError, ResourceExhaustedError
from ual.logs.values import Log, LogChunk
from ual_daemon import logs, validation
from ual_daemon.backends.offers.logs import AutopilotLogs
from ual_daemon.services.answers import Steps
from ual_daemon.services.vehicle import ServedVehicle, driver_of

CHUNK_BYTES = 32_768
"""Bytes that are read at a time: over a slow radio in flight that takes half a minute."""
LONGEST_ID_CHARACTERS = 200
UNTAKEN_S = 60.0
"""Seconds for which a piece may wait for its caller before another download replaces the one that it belongs to: a
caller that is suspended would keep all others out.
"""

_log = logging.getLogger(__name__)


class _Download:
    """A download that runs. `offered_s` is the time since which a piece waits for its caller."""

    def __init__(self, log_id: str) -> None:
        self.log_id = log_id
        self.offered_s: float | None = None


class VehicleLogs:
    """The logs of one UAV. From any thread. `now_s` is a clock's time that never goes back."""

    def __init__(self, vehicle: ServedVehicle, now_s: Callable[[], float] = time.monotonic) -> None:
        self._vehicle = vehicle
        self._now_s = now_s
        self._lock = threading.Lock()
        self._running: _Download | None = None

    def get_all(self) -> Future[list[Log]]:
        """See `ual.interface.Logs`."""
        return self._offer().read_all()

    def download(self, log_id: str, offset: int) -> Steps[LogChunk]:
        """See `ual.interface.Logs`."""
        offer = self._offer()
        validation.require_type(log_id, str, "log_id")
        if not log_id or len(log_id) > LONGEST_ID_CHARACTERS:
            raise validation.refuse("log_id", f"{log_id!r:.80} is no log")
        if offset < 0:
            raise validation.refuse("offset", f"{offset} is negative")
        with self._alone(log_id) as mine:
            # Listed again, as their numbers may have changed.
            log = _chosen((yield offer.read_all()), log_id, offset)
            yield from self._pieces(offer, log, offset, mine)

    @contextmanager
    def _alone(self, log_id: str) -> Iterator[_Download]:
        """Refuses a second download, unless nothing is taken of the first. Raises `ResourceExhaustedError`."""
        mine = _Download(log_id)
        with self._lock:
            running = self._running
            if running is not None and not self._is_untaken(running):
                text = f"log {running.log_id} of {self._vehicle.ns} is being downloaded: one at a time"
                raise ResourceExhaustedError(text, {"limit": "1"})
            self._running = mine
        try:
            yield mine
        finally:
            with self._lock:
                if self._running is mine:
                    self._running = None

    def _is_untaken(self, running: _Download) -> bool:
        offered_s = running.offered_s
        return offered_s is not None and self._now_s() - offered_s > UNTAKEN_S

    def _pieces(self, offer: AutopilotLogs, log: Log, offset: int, mine: _Download) -> Steps[LogChunk]:
        """Yields a log from an offset on. Raises `RejectedByAutopilotError` where it has become shorter, and
        `ResourceExhaustedError` where another download has replaced this one.
        """
        digest, is_over = hashlib.sha256(), False
        while not is_over:
            size = min(CHUNK_BYTES, log.size_bytes - offset)
            data: bytes = (yield offer.read(log.id, offset, size)) if size else b""
            if size and not data:
                text = f"log {log.id} ends at {offset} of {log.size_bytes} bytes: the autopilot has changed it"
                raise RejectedByAutopilotError(text, {"size": str(offset)})
            digest.update(data)
            is_over = offset + len(data) >= log.size_bytes
            chunk = LogChunk(log, offset, data, digest.hexdigest() if is_over else "")
            offset += len(data)
            mine.offered_s = self._now_s()
            yield chunk
            mine.offered_s = None
            if self._running is not mine and not is_over:
                text = (
                    f"log {log.id}: nothing was taken for {UNTAKEN_S:g} s and another download began: go on at {offset}"
                )
                raise ResourceExhaustedError(text, {"limit": "1"})

    def _offer(self) -> AutopilotLogs:
        return driver_of(self._vehicle, AutopilotLogs, "logs")  # type: ignore[type-abstract]  # it is only looked for


def _chosen(listed: list[Log], log_id: str, offset: int) -> Log:
    """Returns the log that is meant. Raises `InvalidArgumentError` where it is not there, or ends before."""
    found = next((each for each in listed if each.id == log_id), None)
    if found is None:
        known = ", ".join(each.id for each in listed[-3:]) or "none"
        raise validation.refuse("log_id", f"there is no log {log_id:.80}; the newest are {known}")
    if found.is_missing:
        text = f"log {found.id}: the autopilot has it, but does not say how long it is: try again"
        raise RejectedByAutopilotError(text, {"log_id": found.id})
    if offset > found.size_bytes:
        raise validation.refuse("offset", f"{found.id} has {found.size_bytes} bytes, not {offset}")
    logs.event(_log, logging.INFO, "log_download", log=found.id, size=found.size_bytes, offset=offset)
    return found
