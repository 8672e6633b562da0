"""Limits of lateness: late messages are not flown. It needs no ROS.

DDS keeps messages for a node that stands still (stopped, a computer that slept), and sends requests again after an
outage of a network. So it may deliver what was sent for another moment, and whose sender has given up since.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import ual
from ual.contract.methods import METHODS

SETPOINT_S = METHODS["StreamSetpoints"].stale_after_s
"""Most age of a setpoint in s: for this time the daemon flies one that is not followed by another."""
COMMAND_S = METHODS["GoToWaypoint"].stale_after_s
"""Most age of a command's request in s. A person without an answer for this time begins to look for the cause."""
BEAT_S = 0.25
"""Seconds between two notes that the program runs."""
QUEUED_S = 5.0
"""Seconds after a standstill for which messages may have been sent meanwhile: DDS asks for missing ones every 3 s."""

_CLOCKS = "the clocks of the two computers differ: synchronize them, or set refuse_late to false"
_SIMULATED = (
    "its time is not the simulated one of this node (use_sim_time): give its program use_sim_time, too, and see that "
    "/clock is published"
)

_CLOCK = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
"""Linux' other monotonic clock stands still while the computer sleeps."""


def steady_s() -> float:
    """Returns a time that never jumps, and goes on while the computer sleeps."""
    return time.clock_gettime(_CLOCK)


class LatenessCheck:
    """Refuses what was sent too long ago, by the clock of its sender's computer. Any thread may ask it."""

    def __init__(
        self,
        is_refused: bool,
        utc_s: Callable[[], float] = time.time,
        is_time_simulated: Callable[[], bool] = lambda: False,
    ) -> None:
        self._is_refused = is_refused
        self._utc_s = utc_s
        self._is_time_simulated = is_time_simulated

    def require_setpoint(self, sent_s: float, stamp_s: float) -> None:
        """Requires a setpoint of the present.

        Args:
            sent_s: When its message was sent, UTC; 0: not known.
            stamp_s: What its header says, UTC; 0: nothing.

        Raises:
            UalTimeoutError: It is older than 0.5 s, or of the future.

        """
        self._require(sent_s, SETPOINT_S, "was sent", _CLOCKS)
        self._require(stamp_s, SETPOINT_S, "is stamped", _SIMULATED if self._is_time_simulated() else _CLOCKS)

    def require_command(self, sent_s: float) -> None:
        """Requires a request of the present, sent at a time of UTC (0: not known).

        Raises:
            UalTimeoutError: It is older than 3 s, or of the future.

        """
        self._require(sent_s, COMMAND_S, "was sent", _CLOCKS)

    def _require(self, at_s: float, limit_s: float, how: str, advice: str) -> None:
        age_s = self._utc_s() - at_s
        if not self._is_refused or not at_s or abs(age_s) <= limit_s:
            return
        when = "ago" if age_s > 0.0 else "in the future"
        raise ual.UalTimeoutError(  # the age is not in the words: each of a stream would have others
            f"it {how} more than {limit_s:g} s {when}: it is not flown. If it was sent just now, {advice}",
            {"age_s": f"{age_s:.3f}", "limit_s": f"{limit_s:g}"},
        )


class ProgramPulse:
    """Notes that the program stood still, as it does while it is stopped or the computer sleeps.

    It is for goals of actions, of which rclpy does not say when they were sent.
    """

    def __init__(self, clock: Callable[[], float] = steady_s) -> None:
        self._clock = clock
        self._beat_s = clock()
        self._stood_s = 0.0
        self._until_s = 0.0

    def beat(self) -> None:
        """Says that the program runs."""
        now_s = self._clock()
        late_s, self._beat_s = now_s - self._beat_s, now_s
        if late_s > COMMAND_S:
            self._stood_s, self._until_s = late_s, now_s + QUEUED_S

    def require_running(self) -> None:
        """Requires that what comes now was not sent while the program stood still.

        Raises:
            UalTimeoutError: It may have been.

        """
        self.beat()
        if self._beat_s < self._until_s:
            raise ual.UalTimeoutError(
                f"the node stood still for {self._stood_s:.1f} s, and this may have been sent meanwhile: it is not "
                "flown. Send it again",
                {"stood_still_s": f"{self._stood_s:.3f}"},
            )
