"""The autopilot's logs: one download at a time, piece by piece. The manual is docs/how-to/logs.md."""

from __future__ import annotations

import hashlib
import logging
import threading
from collections.abc import Iterator
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

_log = logging.getLogger(__name__)


class VehicleLogs:
    """The logs of one UAV. From any thread."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._vehicle = vehicle
        self._busy = threading.Lock()
        self._running = ""

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
        with self._alone(log_id):
            # Listed again, as their numbers may have changed.
            log = _chosen((yield offer.read_all()), log_id, offset)
            yield from _pieces(offer, log, offset)

    @contextmanager
    def _alone(self, log_id: str) -> Iterator[None]:
        """Refuses a second download. Raises `ResourceExhaustedError`."""
        if not self._busy.acquire(blocking=False):
            text = f"log {self._running} of {self._vehicle.ns} is being downloaded: one at a time"
            raise ResourceExhaustedError(text, {"limit": "1"})
        self._running = log_id
        try:
            yield
        finally:
            self._busy.release()

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


def _pieces(offer: AutopilotLogs, log: Log, offset: int) -> Steps[LogChunk]:
    """Yields a log from an offset on. Raises `RejectedByAutopilotError` where it has become shorter."""
    digest, is_over = hashlib.sha256(), False
    while not is_over:
        size = min(CHUNK_BYTES, log.size_bytes - offset)
        data: bytes = (yield offer.read(log.id, offset, size)) if size else b""
        if size and not data:
            text = f"log {log.id} ends at {offset} of {log.size_bytes} bytes: the autopilot has changed it"
            raise RejectedByAutopilotError(text, {"size": str(offset)})
        digest.update(data)
        is_over = offset + len(data) >= log.size_bytes
        yield LogChunk(log, offset, data, digest.hexdigest() if is_over else "")
        offset += len(data)
