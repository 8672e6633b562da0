"""Interface of a backend for the logs of the autopilot; see `ual_daemon.services.logs`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from concurrent.futures import Future

from ual.logs.values import Log


class AutopilotLogs(ABC):
    """Reads the logs that one autopilot has written. From any thread; no method waits.

    Each future ends by itself, also where nothing answers: with a `LinkLostError`, or with a `UalTimeoutError`. What
    the autopilot refuses ends with a `RejectedByAutopilotError`. Reading may not delay what flies.
    """

    @abstractmethod
    def read_all(self) -> Future[list[Log]]:
        """Lists the logs, the oldest first, and last those that the autopilot has not described (`Log.is_missing`).

        The future ends with an error only where nothing was listed.
        """

    @abstractmethod
    def read(self, log_id: str, offset: int, size: int) -> Future[bytes]:
        """Reads a part of a log that was in the last list. Less than `size` only where the log ends before."""
