"""The autopilot's logs: one download at a time, piece by piece. The manual is docs/how-to/logs.md."""

from __future__ import annotations

import hashlib
import logging
import threading
from collections.abc import Iterator
from concurrent.futures import Future

from typing_extensions import override

from ual import interface
from ual.contract.methods import METHODS
from ual.errors import RejectedByAutopilotError, ResourceExhaustedError
from ual.logs.values import Log, LogChunk
from ual_daemon import logs, validation
from ual_daemon.backends.offers.logs import AutopilotLogs
from ual_daemon.extensions.shipped.vehicle import ServedVehicle, offered, wait

CHUNK = 32_768
"""So much is read at a time: over a slow radio in flight that takes half a minute."""
LIST_S = METHODS["ListLogs"].limit_s
"""How long the list may take, and ..."""
READ_S = METHODS["DownloadLog"].limit_s
"""... a piece. A backend ends by itself before, unless others wait, too."""
LONGEST_ID = 200

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

    def download(self, log_id: str, offset: int) -> Download:
        """Begins a download, to be closed at its end.

        Raises:
            ResourceExhaustedError: Another one is under way.
            InvalidArgumentError: The offset or the identifier cannot be.
            NotSupportedError: The backend has no logs.

        """
        offer = self._offer()
        validation.require_type(log_id, str, "log_id")
        if not log_id or len(log_id) > LONGEST_ID:
            raise validation.refuse("log_id", f"{log_id!r:.80} is no log")
        if offset < 0:
            raise validation.refuse("offset", f"{offset} is negative")
        if not self._busy.acquire(blocking=False):
            text = f"log {self._running} of {self._vehicle.ns} is being downloaded: one at a time"
            raise ResourceExhaustedError(text, {"limit": "1"})
        self._running = log_id
        return Download(offer, log_id, offset, self._busy)

    def _offer(self) -> AutopilotLogs:
        return offered(self._vehicle, AutopilotLogs, "logs")  # type: ignore[type-abstract]  # it is only looked for


class Download:
    """One download: `listed` first, then `read` and `add` by turns until it `is_over`; `close` in any case."""

    def __init__(self, offer: AutopilotLogs, log_id: str, offset: int, busy: threading.Lock) -> None:
        self._offer = offer
        self._log_id = log_id
        self._offset = offset
        self._busy = busy
        self._hash = hashlib.sha256()
        self._log: Log | None = None
        self.is_over = False
        """Whether the last piece was made."""

    def listed(self) -> Future[list[Log]]:
        """Has the logs listed anew, as their numbers may have changed."""
        return self._offer.read_all()

    def choose(self, listed: list[Log]) -> None:
        """Takes the log that is meant. Raises `InvalidArgumentError` where it is not there, or ends before."""
        found = next((each for each in listed if each.id == self._log_id), None)
        if found is None:
            known = ", ".join(each.id for each in listed[-3:]) or "none"
            raise validation.refuse("log_id", f"there is no log {self._log_id:.80}; the newest are {known}")
        if found.is_missing:
            text = f"log {found.id}: the autopilot has it, but does not say how long it is: try again"
            raise RejectedByAutopilotError(text, {"log_id": found.id})
        if self._offset > found.size_bytes:
            raise validation.refuse("offset", f"{found.id} has {found.size_bytes} bytes, not {self._offset}")
        self._log = found
        logs.event(_log, logging.INFO, "log_download", log=found.id, size=found.size_bytes, offset=self._offset)

    def read(self) -> Future[bytes]:
        """Reads the next piece."""
        log = self._chosen()
        size = min(CHUNK, log.size_bytes - self._offset)
        if size:
            return self._offer.read(log.id, self._offset, size)
        nothing: Future[bytes] = Future()
        nothing.set_result(b"")
        return nothing

    def add(self, data: bytes) -> LogChunk:
        """Makes a chunk of a piece. Raises `RejectedByAutopilotError` where the log has become shorter."""
        log, offset = self._chosen(), self._offset
        self._offset += len(data)
        if not data and offset < log.size_bytes:
            text = f"log {log.id} ends at {offset} of {log.size_bytes} bytes: the autopilot has changed it"
            raise RejectedByAutopilotError(text, {"size": str(offset)})
        self._hash.update(data)
        self.is_over = self._offset >= log.size_bytes
        return LogChunk(log, offset, data, self._hash.hexdigest() if self.is_over else "")

    def close(self) -> None:
        """Lets others download. To be called once."""
        self._busy.release()

    def _chosen(self) -> Log:
        assert self._log is not None, "`choose` comes first"
        return self._log


class Logs(interface.Logs):
    """The logs in this process."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._of_vehicle = VehicleLogs(vehicle)

    @override
    def get_all(self) -> list[Log]:
        return wait(self._of_vehicle.get_all(), LIST_S, "listing the logs")

    @override
    def download(self, log_id: str, offset: int = 0) -> Iterator[LogChunk]:
        download = self._of_vehicle.download(log_id, offset)
        try:
            download.choose(wait(download.listed(), LIST_S, "listing the logs"))
            while not download.is_over:
                yield download.add(wait(download.read(), READ_S, f"reading log {log_id}"))
        finally:
            download.close()
