"""Has the items of the autopilot's own fence downloaded, again whenever they may have changed."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future

from ual.errors import ResourceExhaustedError, UalError
from ual_daemon.backends.firmwares.fence_zones import FenceItem, FoundZones, find_zones
from ual_daemon.backends.firmwares.mission_items import MissionList, MissionType
from ual_daemon.backends.mavlink.protocols.mission_transfers import MissionTransfers
from ual_daemon.backends.mavlink.session.conversions import degrees

FIRST_PAUSE_S, LONGEST_PAUSE_S = 5.0, 160.0
"""The time from a download that failed to the next one. It doubles each time: an autopilot need not answer at all."""
POLL_S = 30.0
"""Seconds between two downloads while the autopilot is disarmed: a ground station may upload another fence. In flight
the link is left to what flies; ArduPilot tells of another one by itself (`Autopilot.zones_parameter`).
"""
MAX_ITEMS = 500
"""Most items that are read: the geometry of as many circles takes 0.25 s. ArduPilot keeps 84 on a Pixhawk
(AC_PolyFence_loader::max_items), PX4 64 (DM_KEY_FENCE_POINTS_MAX).
"""

_FENCE = MissionType.FENCE


class FenceDownload:
    """Belongs to the thread that receives, and never blocks.

    PX4 tells by a checksum, each second, whether its fence is the one that was read. Then it is not read again.

    Args:
        transfers: Takes its turn with the other transfers.
        on_found: Takes what the items mean, whenever they have been downloaded, the same as before too.
        on_failed: Called when they could not be downloaded, with the reason. What was found before stays.

    """

    def __init__(
        self,
        transfers: MissionTransfers,
        on_found: Callable[[FoundZones], None],
        on_failed: Callable[[str], None],
    ) -> None:
        self._transfers = transfers
        self._on_found = on_found
        self._on_failed = on_failed
        self._running: Future[MissionList] | None = None
        self._next_s = -math.inf
        """Time at which the next download begins."""
        self._pause_s = FIRST_PAUSE_S
        self._is_wanted = True
        self._was_armed: bool | None = None
        self._changes_count = transfers.changes_count(_FENCE)
        self._read_id = 0
        """The autopilot's checksum of what was read; 0 where it tells none."""
        self._reported_id = 0
        """The newest that it has reported."""

    def want(self) -> None:
        """Downloads it again, soon: what is in progress may be of the fence before, and ends first."""
        self._is_wanted = True
        self._pause_s = FIRST_PAUSE_S

    def tick(self, now_s: float, *, is_armed: bool | None) -> None:
        """Begins what is due; to be called often. `is_armed` is None while that is not known."""
        is_changed = self._is_changed()
        if is_changed or (is_armed and self._was_armed is False):
            self.want()
        self._was_armed = is_armed
        running = self._running
        if running is not None:
            if not running.done():
                return
            self._running = None
            self._take(running, now_s)
        if self._is_wanted or (now_s >= self._next_s and self._needs_poll(is_armed)):
            self._begin()

    def _is_changed(self) -> bool:
        """Takes what is reported of the list. Returns whether it may be another one than at the last tick."""
        before = self._changes_count, self._reported_id
        ids = self._transfers.opaque_ids
        self._changes_count, self._reported_id = self._transfers.changes_count(_FENCE), 0 if ids is None else ids.fence
        is_reported = self._reported_id not in (before[1], self._read_id)
        return is_reported or self._changes_count != before[0]

    def _needs_poll(self, is_armed: bool | None) -> bool:
        """Returns whether a pause has ended by a new download: while disarmed, or because the last one failed."""
        is_known = self._read_id != 0 and self._read_id == self._reported_id
        return self._pause_s > FIRST_PAUSE_S or not (is_armed or is_known)

    def _begin(self) -> None:
        self._is_wanted = False
        self._running = Future()
        self._transfers.download(_FENCE, self._running, MAX_ITEMS)

    def _take(self, done: Future[MissionList], now_s: float) -> None:
        error = done.exception()
        if error is None:
            read = done.result()
            self._read_id = read.opaque_id
            items = [
                FenceItem(each.command, each.frame, each.param1, degrees(each.x), degrees(each.y))
                for each in read.items
            ]
            self._end(find_zones(items), now_s)
        elif isinstance(error, ResourceExhaustedError) and "items" in error.message:
            self._end(FoundZones(why=error.message), now_s)
        else:
            self._fail(error.message if isinstance(error, UalError) else str(error), now_s)

    def _end(self, found: FoundZones, now_s: float) -> None:
        self._next_s, self._pause_s = now_s + POLL_S, FIRST_PAUSE_S
        self._on_found(found)

    def _fail(self, why: str, now_s: float) -> None:
        self._next_s = now_s + self._pause_s
        self._pause_s = min(2.0 * self._pause_s, LONGEST_PAUSE_S)
        self._on_failed(why)
