"""The sources of the position in flight: satellites or poses from outside that end, long before the autopilot says so.

Autopilots fly on by inertia for 5 to 7 s, and the estimate drifts by metres meanwhile. What ends is reported at once,
and tasks wait on their way. Where the estimate stays good for longer, the autopilot has another source, and they go on.
"""

from __future__ import annotations

import logging
import math

from ual.types import GpsFix
from ual_daemon import logs
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.external_silence import ExternalSilence

_log = logging.getLogger(__name__)

INERTIA_S = 12.0
"""Seconds for which no autopilot calls its estimate good without a source: PX4 does for 5 s, ArduPilot for 7."""
LOST_POSITION_S = 0.3
"""A fix that is gone for less is none that was lost."""
RECOVERED_POSITION_S = 1.0
"""Seconds after which a source that has come back counts."""
CHECK_PERIOD_S = 0.1
DRIFTS = "the position drifts"


class _PositionSource:
    """One source of the position: whether it was used, and is gone."""

    def __init__(self, gone_s: float) -> None:
        self._noticed_s = gone_s
        self._was_used = False
        """Whether it was there in flight while the estimate was good, and was not seen to be needless since."""
        self._gone_s: float | None = None
        self._back_s: float | None = None

    def is_lost(self, now_s: float, *, is_there: bool, is_good: bool) -> bool:
        """Makes one update in flight. `is_good` is whether the estimate is, by the autopilot's word."""
        if not self._was_used:
            self._was_used = is_there and is_good
            self._gone_s = None
            return False
        if is_there:
            self._back_s = now_s if self._back_s is None else self._back_s
            if self._gone_s is None or now_s - self._back_s >= RECOVERED_POSITION_S:
                self._gone_s = None
                return False
        else:
            self._back_s = None
            self._gone_s = now_s if self._gone_s is None else self._gone_s
        passed_s = now_s - self._gone_s
        if is_good and passed_s > INERTIA_S:
            self._was_used = False
        return self._was_used and passed_s >= self._noticed_s

    def stand_by(self) -> None:
        """Takes note that the UAV is not in the air, or that another source is there: nothing is lost."""
        self._gone_s = self._back_s = None


class PositionWatch:
    """Watches the sources of one UAV's position. Belongs to the update thread; its attributes are for any."""

    def __init__(self, external: ExternalSilence) -> None:
        self._external = external
        self.trouble = ""
        """Human-readable trouble with the position; empty if none is known."""
        self.due_s = -math.inf
        """Time of the next update."""
        self.waits = ""
        """The same, as far as tasks wait for its end."""
        self._boots_count, self._fix, self._lost = 0, "", (False, False)
        self._satellites, self._outside = _PositionSource(LOST_POSITION_S), _PositionSource(0.0)

    def update(self, snapshot: Snapshot) -> None:
        """Makes one update."""
        if snapshot.link.boots_count != self._boots_count:
            self._boots_count = snapshot.link.boots_count
            self._satellites, self._outside = _PositionSource(LOST_POSITION_S), _PositionSource(0.0)
        self.due_s = snapshot.time_s + CHECK_PERIOD_S
        now_s, gps, control = snapshot.time_s, snapshot.condition.gps, snapshot.control
        has_fix = gps is not None and gps.fix >= GpsFix.FIX_3D
        no_fix = outside = ""
        if control.armed is None or not control.armed.value or control.is_on_ground:
            self._satellites.stand_by()
            self._outside.stand_by()
        else:
            estimator = snapshot.motion.estimator
            is_good = estimator is not None and estimator.value.is_good
            external, is_measured = self._external, False
            if external.is_heard:  # no call for each update of others
                is_measured = external.is_source(now_s)
                if self._outside.is_lost(now_s, is_there=is_measured, is_good=is_good):
                    outside = f"{external.why_ended(now_s)}, and {DRIFTS}"
            if is_measured or snapshot.condition.aids:
                self._satellites.stand_by()
            elif gps is not None and self._satellites.is_lost(now_s, is_there=has_fix, is_good=is_good):
                self._fix = self._fix if has_fix else gps.fix.name
                no_fix = f"no satellite fix ({self._fix}), and {DRIFTS}"
        self.waits = no_fix or ("" if has_fix else outside)
        if no_fix or outside or self.trouble:
            self._tell("; ".join(filter(None, (no_fix, outside))), (no_fix != "", outside != ""))

    def doubts(self, now_s: float) -> str:
        """Returns what is wrong with the position, and with the poses that come from outside; empty if nothing is."""
        external = self._external
        doubt = external.doubt(now_s) if external.is_doubtful else ""
        return f"{self.trouble}; {doubt}" if self.trouble and doubt else self.trouble or doubt

    def _tell(self, trouble: str, lost: tuple[bool, bool]) -> None:
        """Takes what is wrong, and logs that where another source is lost: the texts may have figures."""
        self.trouble = trouble
        if lost != self._lost:
            self._lost = lost
            level = logging.WARNING if trouble else logging.INFO
            logs.event(_log, level, "position_trouble", why=trouble or "over")
