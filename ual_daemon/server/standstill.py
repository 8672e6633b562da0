"""Standstill of the daemon: requests that waited unread meanwhile are old, and move nothing.

A daemon that is stopped, or whose computer sleeps, reads afterwards what was sent to it meanwhile. Its caller may have
given up since. gRPC does not say when a message was sent, so all that is read just after a standstill counts as old.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import Final

from ual.contract.method import Moves
from ual.contract.methods import METHODS
from ual.errors import UalTimeoutError
from ual_daemon import logs
from ual_daemon.backends.clock import steady_s
from ual_daemon.vehicle.refusal_log import RefusalLog

_log = logging.getLogger(__name__)

BEAT_S = 0.5
"""Seconds between two notes that the daemon runs."""
STANDSTILL_S = 2.5
"""Seconds without a beat after which the daemon has stood still. A busy computer holds one up for a second, and its
callers still wait for their answers. After a second what was known of the autopilot is discarded anyway
(`ual_daemon.backends.engine.limits.READER_PAUSE_S`), so that nothing moves before that is known again.
"""
LONGEST_QUEUEING_S = 5.0
"""Longest time in seconds after a standstill for which moving requests are refused. Messages may be read as long after
it as it lasted, as TCP doubles the time until it sends again. What moves is refused for that time, and no longer than
this.
"""

MOVES: Final = frozenset(each.path for each in METHODS.values() if each.moves is not Moves.NOTHING)
"""The methods whose old requests are refused. What ends a motion (Land, Abort, Pause) is obeyed however late it is."""


class Standstill:
    """Notices that the process stood still. Any thread may call."""

    def __init__(self, clock: Callable[[], float] = steady_s) -> None:
        self._clock = clock
        self._beat_s = math.inf
        self._stood_s = 0.0
        self._until_s = 0.0
        self._refusals = RefusalLog()

    def beat(self) -> None:
        """Notes that the daemon runs. It is watched from the first time on."""
        now_s = self._clock()
        if now_s - self._beat_s > STANDSTILL_S:
            self._note(now_s, now_s - self._beat_s)
        self._beat_s = now_s  # at last: a thread that still reads the old one notes the same standstill

    def require_running(self, method: str) -> None:
        """Requires that what is read now was not sent while the daemon stood still. Each setpoint calls it.

        Raises:
            UalTimeoutError: It may have been.

        """
        now_s = self._clock()
        if now_s - self._beat_s <= STANDSTILL_S and now_s >= self._until_s:
            self._beat_s = now_s  # an event loop that is held up is no standstill while setpoints are read
            return
        self.beat()
        error = UalTimeoutError(
            f"{method.rpartition('/')[2]}: the daemon stood still for {self._stood_s:.1f} s, and this may have been "
            "sent meanwhile: nothing moves by it. Look at the state, and send it again",
            {"stood_still_s": f"{self._stood_s:.3f}"},
        )
        self._refusals.log_refusal(method, error)
        raise error

    def _note(self, now_s: float, stood_s: float) -> None:
        until_s = min(stood_s, LONGEST_QUEUEING_S)
        self._stood_s, self._until_s = stood_s, now_s + until_s
        logs.event(
            _log,
            logging.WARNING,
            "stood_still",
            stood_still_s=round(stood_s, 3),
            refuses_what_moves_s=round(until_s, 3),
        )
