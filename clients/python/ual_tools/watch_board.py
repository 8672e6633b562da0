"""State of each UAV in `ual watch`: its newest sample, when it came, and why no newer one comes."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from ual import discovery
from ual.errors import UalError
from ual.types import Telemetry

LOST_UAV_S = 2.0
"""Telemetry that is older than this is shown as lost; at low rates, telemetry that is older than two periods."""
GONE_UAV_S = 10.0
"""Seconds for which a UAV whose daemon has ended is still shown, so that nobody misses it."""


@dataclass(frozen=True, slots=True)
class WatchedUav:
    """Last observation of one UAV: its newest sample, when it came, and why no newer one comes, if that is known."""

    since_s: float
    telemetry: Telemetry | None = None
    why: str = ""
    gone_s: float | None = None
    """Time at which its daemon ended."""


class Board:
    """The newest sample of each UAV. Sets `changed` at every change.

    Args:
        names: The UAVs that are known from the beginning.
        rate_hz: How many samples of each come in a second; 0: every one.
        gone_after_s: For how long a UAV whose daemon has ended is still shown; `GONE_UAV_S` when not given.

    """

    def __init__(self, names: Iterable[str], rate_hz: float, gone_after_s: float | None = None) -> None:
        self.changed = threading.Event()
        self.lost_after_s = max(LOST_UAV_S, 2.0 / rate_hz if rate_hz else 0.0)
        self._gone_after_s = gone_after_s
        self._lock = threading.Lock()
        self._seen = {ns: WatchedUav(time.monotonic()) for ns in names}
        self._new: dict[str, Telemetry] = {}

    def add(self, ns: str) -> None:
        """Adds a UAV whose daemon has appeared."""
        with self._lock:
            self._seen[ns] = WatchedUav(time.monotonic())
        self.changed.set()

    def remove(self, ns: str) -> None:
        """Marks a UAV whose daemon has ended. It vanishes after `GONE_UAV_S`."""
        with self._lock:
            self._seen[ns] = replace(self._seen[ns], gone_s=time.monotonic())
        self.changed.set()

    def forget(self, ns: str) -> None:
        """Drops a UAV at once: it is shown by another name, or was gone for long."""
        with self._lock:
            self._seen.pop(ns, None)
            self._new.pop(ns, None)
        self.changed.set()

    def put(self, ns: str, telemetry: Telemetry) -> None:
        """Stores a sample."""
        with self._lock:
            if not self._is_here(ns):
                return
            self._seen[ns] = WatchedUav(time.monotonic(), telemetry)
            unseen = self._new.get(ns)
            if unseen is not None:  # the unseen sample counts as missed, in addition to those that it had missed
                telemetry = replace(telemetry, missed_count=telemetry.missed_count + unseen.missed_count + 1)
            self._new[ns] = telemetry
        self.changed.set()

    def put_error(self, ns: str, error: UalError) -> None:
        """Stores why no samples come."""
        with self._lock:
            if not self._is_here(ns):
                return
            self._seen[ns] = replace(self._seen[ns], why=f"{error.reason}: {error.message}")
        self.changed.set()

    def take(self) -> Mapping[str, Telemetry]:
        """Returns the newest sample of each UAV that has a new one since the last call. Its `missed_count` includes the
        samples that were replaced.
        """
        with self._lock:
            new, self._new = self._new, {}
        return new

    def watched_uavs(self) -> Mapping[str, WatchedUav]:
        """Returns what is known of each UAV, sorted by name and number, without those that ended a while ago."""
        limit_s = GONE_UAV_S if self._gone_after_s is None else self._gone_after_s
        since_s = time.monotonic() - limit_s
        with self._lock:
            self._seen = {ns: each for ns, each in self._seen.items() if each.gone_s is None or each.gone_s > since_s}
            return dict(sorted(self._seen.items(), key=lambda item: discovery.natural_order(item[0])))

    def _is_here(self, ns: str) -> bool:
        # The last sample of a daemon that has ended may come late: its UAV must not come back by it.
        watched = self._seen.get(ns)
        return watched is not None and watched.gone_s is None
