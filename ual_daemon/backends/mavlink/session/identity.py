"""Whether the messages of one system id come from one vehicle, and which. Pure logic: callers pass the time."""

from __future__ import annotations

import logging
import math
from collections import deque

from ual_daemon import logs
from ual_daemon.backends.mavlink.dialects.detection import Kind, kind_text
from ual_daemon.backends.mavlink.links import Address

_log = logging.getLogger(__name__)

CONFLICT_S = 5.0
"""A conflict is over once nothing has shown it for this long."""
REPLACED_S = 3.0
"""A vehicle whose heartbeat is missing for this long, while another kind's comes, has been replaced by that one."""
ALTERNATIONS_COUNT, ALTERNATIONS_S = 3, 5.0
"""So many changes from one sender to the other and back within this time show that there are two. A reboot, a new
address or one wild message makes one of them."""
BOOT_CLOCK_S = 1.0
"""Times since boot that differ by more are of different boots; jitter and late messages make less."""
SAME_COUNTER = 16
"""Sequence numbers that differ by no more are taken for those of one counter: two ways to one vehicle carry its numbers
twice, or out of order."""


class _Alternation:
    """Counts how often a value goes back to the one before the last change."""

    def __init__(self) -> None:
        self._times_s: deque[float] = deque()

    def is_shown(self, now_s: float) -> bool:
        """Takes one return. Returns whether there were enough of them lately."""
        self._times_s.append(now_s)
        while now_s - self._times_s[0] > ALTERNATIONS_S:
            self._times_s.popleft()
        return len(self._times_s) >= ALTERNATIONS_COUNT


class Identity:
    """The vehicle of a session, by the kind in its heartbeats, its time since boot, its address and sequence numbers.

    Not thread-safe: belongs to the thread that receives. While `conflict` is not empty, the vehicle must not be flown:
    it says why, human-readable.
    """

    def __init__(self, system_id: int, kind: Kind) -> None:
        self.kind = kind
        self.conflict = ""
        self._system_id = system_id
        self._shown_s = -math.inf
        self._own_heartbeat_s = -math.inf
        self._offsets_s: tuple[float, float] | None = None
        """Our clock minus the time since boot: now, and before the last change of the boot clock."""
        self._clock_changes = _Alternation()
        self._address_changes = _Alternation()
        self._addresses: tuple[Address | None, Address | None] = (None, None)
        """The address of the newest message, and the one before the last change."""
        self._sequence = 0

    def on_heartbeat(self, kind: Kind, now_s: float) -> bool:
        """Takes the kind in a heartbeat. Returns whether the vehicle has been replaced by one of this kind."""
        if kind == self.kind:
            self._own_heartbeat_s = now_s
            return False
        if now_s - self._own_heartbeat_s > REPLACED_S and self._own_heartbeat_s > -math.inf:
            logs.event(
                _log, logging.WARNING, "vehicle_replaced", system=self._system_id, old=kind_text(self.kind),
                new=kind_text(kind),
            )  # fmt: skip
            return True
        self._show(f"{kind_text(self.kind)} and {kind_text(kind)} send as system {self._system_id}", now_s)
        return False

    def on_boot_time(self, boot_s: float, now_s: float) -> None:
        """Takes a time since boot: of two vehicles, one and the other come by turns."""
        offset_s = now_s - boot_s
        if self._offsets_s is None:
            self._offsets_s = (offset_s, offset_s)
            return
        current_s, before_s = self._offsets_s
        if abs(offset_s - current_s) <= BOOT_CLOCK_S:
            return
        self._offsets_s = (offset_s, current_s)
        is_back = abs(offset_s - before_s) <= BOOT_CLOCK_S
        if is_back and self._clock_changes.is_shown(now_s):
            apart_s = abs(offset_s - current_s)
            self._show(f"two vehicles, booted {apart_s:.0f} s apart, send as system {self._system_id}", now_s)

    def on_frame(self, sequence: int, address: Address | None, now_s: float) -> None:
        """Takes where a frame came from, and its number."""
        step, self._sequence = (sequence - self._sequence) % 256, sequence
        current, before = self._addresses
        if address == current:
            return
        self._addresses = (address, current)
        is_same_counter = min(step, 256 - step) <= SAME_COUNTER
        if address == before and not is_same_counter and self._address_changes.is_shown(now_s):
            where = " and ".join(f"{each[0]}:{each[1]}" for each in (current, address) if each is not None)
            self._show(f"two vehicles (at {where}) send as system {self._system_id}", now_s)

    def tick(self, now_s: float) -> None:
        """Ends a conflict that does not show any more; to be called often."""
        if self.conflict and now_s - self._shown_s > CONFLICT_S:
            logs.event(_log, logging.WARNING, "vehicle_conflict_ended", was=self.conflict)
            self.conflict = ""

    def _show(self, why: str, now_s: float) -> None:
        self._shown_s = now_s
        if not self.conflict:
            self.conflict = f"{why}: give each vehicle an id of its own; until then UAL flies none of them"
            logs.event(_log, logging.WARNING, "vehicle_conflict", why=self.conflict)
