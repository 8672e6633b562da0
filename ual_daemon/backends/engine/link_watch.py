"""Watches the link to one autopilot: silence, what may be believed after it, reboots. Callers pass the time `now_s`."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from enum import Enum

from ual.shared.renamed import renamed
from ual_daemon import logs
from ual_daemon.backends.engine.boot_time import BootTime
from ual_daemon.backends.engine.limits import BLIND_SILENCE_S, RESTART_SILENCE_S
from ual_daemon.backends.values import LinkReport

_log = logging.getLogger(__name__)

STALE_LINK_S = 0.5
"""A link that is silent for this long is degraded: of every stream of 4 Hz or more two messages did not come."""


class LinkWatchState(Enum):
    """CONNECTING: no autopilot yet. STALE: silent for `STALE_LINK_S`. LOST: silent so long that nothing is known."""

    CONNECTING = "connecting"
    CONNECTED = "connected"
    STALE = "stale"
    LOST = "lost"


def _nothing() -> None:
    """Nothing depends on it."""


class LinkWatch:
    """Belongs to the thread that receives; others may read its attributes and ask `is_up`.

    `lost_s` is after how long a silence the link counts as lost; it may be changed. `on_lost` is called before the
    first message after such a silence is taken: it discards all that may have changed. `on_anew` is called where the
    silence was so long that everything must be requested again.
    """

    def __init__(
        self,
        url: str,
        lost_s: float,
        *,
        on_lost: Callable[[], None] = _nothing,
        on_anew: Callable[[], None] = _nothing,
    ) -> None:
        self.lost_s = lost_s
        self.on_lost = on_lost
        self.on_anew = on_anew
        self.state = LinkWatchState.CONNECTING
        self.heard_s: float | None = None
        """Time of the last message that shows that the autopilot is there."""
        self.spoken_s = -math.inf
        """Time before which reports do not count for commands: a silence, or a time without checks, came after it."""
        self.lost_count = self.reboots_count = 0
        self._url = url
        self._boots_count = 0
        self._boot_time = BootTime()
        self.is_boot_doubtful = self.is_boot_foreign = False
        """See `BootTime`."""

    # --- What is noted ------------------------------------------------------------------------------------------------

    def on_message(self, now_s: float) -> float:
        """Notes a message of the autopilot, before its content is taken. Returns the silence before it, in seconds."""
        heard_s, self.heard_s = self.heard_s, now_s
        silence_s = 0.0 if heard_s is None else now_s - heard_s
        if silence_s > BLIND_SILENCE_S or heard_s is None:
            self._end_silence(silence_s, now_s)
        if self.state is not LinkWatchState.CONNECTED:
            self._change(LinkWatchState.CONNECTED, silence_s)
        return silence_s

    on_heard = renamed(on_message, "LinkWatch.on_heard")

    def on_blind(self, until_s: float) -> None:
        """Notes that what is read until then may be old: our thread did not look for a while."""
        self.spoken_s = max(self.spoken_s, until_s)

    def on_boot_time(self, boot_s: float, now_s: float) -> bool:
        """Takes the autopilot's time since boot from a message. Returns whether it is now known to have rebooted."""
        boot_time = self._boot_time
        if boot_time.goes_on(boot_s, now_s):  # nearly always
            self.is_boot_doubtful = self.is_boot_foreign = False
            return False
        has_rebooted = boot_time.update(boot_s, now_s)
        self.is_boot_doubtful, self.is_boot_foreign = boot_time.is_doubtful, boot_time.is_foreign
        if has_rebooted:
            self.on_reboot(now_s)
        return has_rebooted

    def on_reboot(self, now_s: float) -> None:
        """Notes a reboot, for which a backend may have a proof of its own."""
        self.reboots_count += 1
        self.spoken_s = max(self.spoken_s, now_s)
        logs.event(_log, logging.WARNING, "autopilot_rebooted", url=self._url, reboots_count=self.reboots_count)

    def begin_boot(self) -> int:
        """Returns the number of a boot that begins for us: with each session, and with each reboot."""
        self._boots_count += 1
        return self._boots_count

    def tick(self, now_s: float) -> None:
        """Detects silence; to be called often."""
        if self.heard_s is None:
            return
        silence_s = now_s - self.heard_s
        if silence_s > self.lost_s:
            if self.state is not LinkWatchState.LOST:
                self.lost_count += 1
                self._change(LinkWatchState.LOST, silence_s)
        elif silence_s > STALE_LINK_S and self.state is LinkWatchState.CONNECTED:
            self._change(LinkWatchState.STALE, silence_s)

    # --- What follows -------------------------------------------------------------------------------------------------

    @property
    def boot_s(self) -> float:
        """The newest time since boot."""
        return self._boot_time.boot_s

    def is_silent(self, now_s: float, for_s: float) -> bool:
        """Returns whether it was received once, and not for so long by now."""
        return self.heard_s is not None and now_s - self.heard_s > for_s

    def is_up(self, now_s: float) -> bool:
        """Returns whether it was received so lately that setpoints and commands make sense. From any thread."""
        return self.heard_s is not None and now_s - self.heard_s <= self.lost_s

    def report(self) -> LinkReport:
        """Returns what it has counted. From any thread."""
        return LinkReport(lost_count=self.lost_count, reboots_count=self.reboots_count)

    def why_silent(self, now_s: float) -> str:
        """Returns why a command must not leave now, human-readable; empty if the link does not forbid it."""
        if self.heard_s is None:
            return "nothing was heard of the autopilot yet"
        if now_s - self.heard_s > BLIND_SILENCE_S:
            return f"nothing was heard of the autopilot for {now_s - self.heard_s:.1f} s"
        if now_s < self.spoken_s:
            return "this computer did not run UAL for a moment, and what came meanwhile is being read"
        if self.is_boot_doubtful:
            return "the autopilot may have rebooted"
        return ""

    def _end_silence(self, silence_s: float, now_s: float) -> None:
        self.spoken_s = max(self.spoken_s, now_s)
        if silence_s > self.lost_s:
            self.on_lost()
        if silence_s > RESTART_SILENCE_S:
            self.on_anew()

    def _change(self, state: LinkWatchState, silence_s: float) -> None:
        old, self.state = self.state, state
        level = {LinkWatchState.LOST: logging.WARNING, LinkWatchState.CONNECTED: logging.INFO}.get(state, logging.DEBUG)
        if old is LinkWatchState.STALE and state is LinkWatchState.CONNECTED:
            level = logging.DEBUG  # a short interruption
        fields = {"silence_s": round(silence_s, 2)} if silence_s else {}
        logs.event(_log, level, "link_changed", old=old.value, new=state.value, url=self._url, **fields)
