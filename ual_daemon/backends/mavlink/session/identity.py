"""Whether the messages of one system id come from one vehicle, and which. Pure logic: callers pass the time."""

from __future__ import annotations

import logging
import math

from ual_daemon import logs
from ual_daemon.backends.engine.agreement import Agreement, AirborneWatch
from ual_daemon.backends.engine.boot_time import WRAP_S
from ual_daemon.backends.mavlink.dialects.detection import HeartbeatKind, kind_text
from ual_daemon.backends.mavlink.links import Address

_log = logging.getLogger(__name__)

CONFLICT_S = 5.0
"""A conflict is over once nothing has shown it for this long."""
REPLACED_AUTOPILOT_S = 2.5
"""A vehicle of which no heartbeat comes has been replaced by another kind whose heartbeats come for this long."""
ENDED_AUTOPILOT_S = 5.0
"""Seconds without a heartbeat after which a vehicle needs no such proof to be replaced."""
BOOT_CLOCK_S = 1.0
"""Times since boot that differ by more are of different boots; jitter and late messages make less."""
MOST_COUNTER_STEPS = 16
"""Sequence numbers that differ by no more are taken for those of one counter: two ways to one vehicle carry its numbers
twice, or out of order."""
_UNTIL = "give each vehicle an id of its own; until then UAL flies none of them"


class _Conflict:
    """One way in which two vehicles with one system id show. A reboot or a new address shows it once, not by turns."""

    def __init__(self, span_s: float) -> None:
        self.verdict = Agreement(assumed=False, span_s=span_s, ends_s=CONFLICT_S)
        self.why = ""


class VehicleIdentity:
    """The vehicle of a session, by the kind in its heartbeats, its time since boot, its address and sequence numbers.

    Not thread-safe: belongs to the thread that receives. While `conflict` is not empty, the vehicle must not be flown:
    it says why, human-readable. During a `flight` a conflict is only reported (`doubt`).
    """

    def __init__(self, system_id: int, kind: HeartbeatKind, flight: AirborneWatch) -> None:
        self.conflict = self.doubt = ""
        self._flight = flight
        self._is_calm = False
        """Whether nothing has shown another vehicle of late. Not at first: the verdicts note when they begin."""
        self._heartbeats_count = 0
        self._kind = Agreement(kind, span_s=REPLACED_AUTOPILOT_S, ended_s=ENDED_AUTOPILOT_S)
        self._system_id = system_id
        self._own_heartbeat_s = -math.inf
        self._offsets_s: tuple[float, float] | None = None
        """Our clock minus the time since boot: now, and before the last change of the boot clock."""
        self._kinds, self._clocks, self._addresses_used = _Conflict(span_s=1.0), _Conflict(0.0), _Conflict(0.0)
        self._conflicts = (self._kinds, self._clocks, self._addresses_used)
        self.address: Address | None = None
        """Address of the sender of the last frame. An attribute, as each frame is compared with it; see `on_frame`."""
        self._address_before: Address | None = None
        """The address of the newest message, and the one before the last change."""
        self.sequence = 0

    @property
    def kind(self) -> HeartbeatKind:
        """Kind of the vehicle, by its heartbeats."""
        return self._kind.value

    @property
    def is_stray(self) -> bool:
        """Whether no more than one heartbeat of its kind has come."""
        return self._heartbeats_count <= 1

    def on_heartbeat(self, kind: HeartbeatKind, now_s: float) -> bool:
        """Takes the kind in a heartbeat. Returns whether the vehicle has been replaced by one of this kind."""
        own = self.kind
        if kind == own:
            self._own_heartbeat_s = now_s
            self._heartbeats_count += 1
        elif now_s - self._own_heartbeat_s <= REPLACED_AUTOPILOT_S:
            why = f"{kind_text(own)} and {kind_text(kind)} send as system {self._system_id}"
            self._show(self._kinds, why, now_s)
        self._is_calm = self._is_calm and kind == own
        has_changed = self._kind.note(kind, now_s, is_flying=self._flight.is_flying(now_s))
        if has_changed:
            logs.event(
                _log, logging.WARNING, "vehicle_replaced", system=self._system_id, old=kind_text(own),
                new=kind_text(kind),
            )  # fmt: skip
        return has_changed

    def on_boot_time(self, boot_s: float, now_s: float) -> None:
        """Takes a time since boot: of two vehicles, one and the other come by turns."""
        offset_s = now_s - boot_s
        if self._offsets_s is None:
            self._offsets_s = (offset_s, offset_s)
            return
        current_s, before_s = self._offsets_s
        apart_s = _apart_s(offset_s, current_s)
        if apart_s <= BOOT_CLOCK_S:
            return
        self._offsets_s = (offset_s, current_s)
        if _apart_s(offset_s, before_s) <= BOOT_CLOCK_S:
            why = f"two vehicles, booted {apart_s:.0f} s apart, send as system {self._system_id}"
            self._show(self._clocks, why, now_s)

    def on_frame(self, sequence: int, address: Address | None, now_s: float) -> None:
        """Takes where a frame came from, and its number."""
        last, self.sequence = self.sequence, sequence
        current, before = self.address, self._address_before
        if address == current:
            return
        step = (sequence - last) % 256
        self.address, self._address_before = address, current
        if address == before and not min(step, 256 - step) <= MOST_COUNTER_STEPS:
            where = " and ".join(f"{each[0]}:{each[1]}" for each in (current, address) if each is not None)
            why = f"two vehicles (at {where}) send as system {self._system_id}"
            self._show(self._addresses_used, why, now_s)

    def tick(self, now_s: float) -> None:
        """Ends a conflict that does not show any more, and begins one that had to wait; to be called often."""
        if self._is_calm:
            return
        is_flying = self._flight.is_flying(now_s)
        self._kind.tick(now_s, is_flying=is_flying)
        for each in self._conflicts:
            each.verdict.tick(now_s, is_flying=is_flying)
        self._judge()
        self._is_calm = not (self._kind.is_open or any(v.verdict.is_open or v.verdict.value for v in self._conflicts))

    def _show(self, conflict: _Conflict, why: str, now_s: float) -> None:
        if not (conflict.verdict.value or conflict.verdict.pending):
            conflict.why = why
        self._is_calm = False
        conflict.verdict.note(True, now_s, is_flying=self._flight.is_flying(now_s))
        self._judge()

    def _judge(self) -> None:
        conflict, doubt = self.conflict, self.doubt
        self.conflict = next((f"{each.why}: {_UNTIL}" for each in self._conflicts if each.verdict.value), "")
        self.doubt = next((each.why for each in self._conflicts if each.verdict.pending), "")
        if self.conflict and not conflict:
            logs.event(_log, logging.WARNING, "vehicle_conflict", why=self.conflict)
        elif conflict and not self.conflict:
            logs.event(_log, logging.WARNING, "vehicle_conflict_ended", was=conflict)
        if self.doubt and not doubt:
            logs.event(_log, logging.WARNING, "vehicle_doubtful", why=self.doubt)


def _apart_s(one_s: float, other_s: float) -> float:
    """Returns the distance of two moments of boot. Milliseconds since boot that began again are of the same boot."""
    return abs(math.remainder(one_s - other_s, WRAP_S))
