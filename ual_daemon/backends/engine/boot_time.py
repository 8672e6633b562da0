"""The autopilot's time since boot, and whether it has rebooted: believed only when several messages agree.

Any frame of the autopilot's system may carry any time: a damaged one, or a forged one where messages are not signed.
A reboot that is believed discards parameters and places and requests everything again, so single frames must not do it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

REBOOT_S = 1.0
"""A time since boot that goes back by more than this is of a new boot; one that goes back by less came late."""
PROOFS_COUNT = 3
"""Consecutive messages that must fit one new boot, ..."""
MESSAGE_SILENCE_S = 0.3
"""... within these seconds without one that fits the old boot. An autopilot that boots is silent for longer."""
SHORTEST_BOOT_S = 2.0
"""No autopilot reboots twice within this time."""
LEAP_S = 5.0
"""A time that leaps ahead by no more may be of the present boot: what came between was lost in a full buffer."""
WRAP_S = (1 << 32) / 1000.0
"""Seconds, 49.7 days, after which MAVLink's milliseconds since boot begin again. A UAV in a dock may never be switched
off.
"""
_FASTEST_TIME_FACTOR = 50.0
"""Fastest passage of a simulator's time, relative to ours."""


@dataclass(slots=True)
class _Candidate:
    """A boot that some messages in a row fit."""

    boot_s: float
    received_s: float
    count: int = 1

    def fits(self, boot_s: float, now_s: float) -> bool:
        return _follows(self.boot_s, boot_s, now_s - self.received_s)


class BootTime:
    """Times since boot, from messages of one autopilot. Callers pass the time `now_s`."""

    def __init__(self) -> None:
        self.boot_s = -math.inf
        """The newest time since boot that fits the boot before it."""
        self._received_s = math.inf
        self._rebooted_s = -math.inf
        self._candidate: _Candidate | None = None
        self.is_doubtful = False
        """Whether the last message may be the first of a new boot, to which the places of the old one do not apply."""
        self.is_foreign = False
        """Whether the last message is of another boot than the present one: another vehicle's, or damaged."""

    def goes_on(self, boot_s: float, now_s: float) -> bool:
        """Takes the time since boot from a message where the present boot plainly goes on; else returns False."""
        if 0.0 <= now_s - self._received_s <= REBOOT_S and 0.0 <= boot_s - self.boot_s <= REBOOT_S:
            self.boot_s, self._received_s, self._candidate = boot_s, now_s, None
            self.is_doubtful = self.is_foreign = False
            return True
        return False

    def update(self, boot_s: float, now_s: float) -> bool:
        """Takes the time since boot from a message. Returns whether the autopilot is now known to have rebooted."""
        if self.goes_on(boot_s, now_s):
            return False
        self.is_doubtful = self.is_foreign = False
        passed_s = now_s - self._received_s
        if has_wrapped(self.boot_s, boot_s) and _follows(self.boot_s, boot_s + WRAP_S, passed_s):
            self.boot_s -= WRAP_S
        # After a silence a new boot may have run for longer than the last one had, but not for as long as the silence.
        has_booted_since = boot_s < passed_s - REBOOT_S
        fits = not has_booted_since and _follows(self.boot_s, boot_s, passed_s)
        if fits or self.boot_s == -math.inf:
            self.boot_s, self._received_s, self._candidate = max(self.boot_s, boot_s), now_s, None
            return False
        agreeing_count = self._note(boot_s, now_s)
        is_quiet = now_s - self._received_s >= MESSAGE_SILENCE_S
        self.is_doubtful = is_quiet and agreeing_count < PROOFS_COUNT
        if not is_quiet or agreeing_count < PROOFS_COUNT or now_s - self._rebooted_s < SHORTEST_BOOT_S:
            self.is_foreign = not 0.0 <= boot_s - self.boot_s <= LEAP_S
            return False
        # A time that leapt ahead is no new boot, unless that could have begun in the silence before.
        is_reboot = boot_s < max(self.boot_s, now_s - self._received_s)
        self.boot_s, self._received_s, self._candidate = boot_s, now_s, None
        if is_reboot:
            self._rebooted_s = now_s
        return is_reboot

    def _note(self, boot_s: float, now_s: float) -> int:
        """Returns how many messages in a row, with this one, fit one new boot."""
        candidate = self._candidate
        if candidate is None or not candidate.fits(boot_s, now_s):
            self._candidate = _Candidate(boot_s, now_s)
            return 1
        candidate.boot_s, candidate.received_s = max(candidate.boot_s, boot_s), now_s
        candidate.count += 1
        return candidate.count


def has_wrapped(old_boot_s: float, boot_s: float) -> bool:
    """Returns whether a time since boot is so much smaller than one before it that it may have begun again."""
    return old_boot_s - boot_s > WRAP_S / 2


def _follows(old_boot_s: float, boot_s: float, passed_s: float) -> bool:
    """Returns whether two times since boot can be of one boot, where so long has passed between them by our clock."""
    return -REBOOT_S <= boot_s - old_boot_s <= REBOOT_S + _FASTEST_TIME_FACTOR * passed_s
