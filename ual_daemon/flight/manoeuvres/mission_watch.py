"""Whether the autopilot still has the mission that it was started with, or one that another station has brought."""

from __future__ import annotations

import math
from concurrent.futures import Future
from typing import NamedTuple

from ual.errors import UalError
from ual_daemon.backends.offers.missions import AutopilotMissions, KeptMission, MissionReport

READ_RETRY_S = 1.0
"""The time from a read that failed to the next one, ..."""
_FIRST_READ_RETRY_S = 0.2
"""... and the first time: one that was in progress as another station began an upload fails. Each further one is twice
as long.
"""
CHANGE_DELAY_S = 0.15
"""The time from a change to its read: amid an upload ArduPilot refuses it. PX4 tells another checksum once the upload
has ended, and up to a second late: then it is read at once."""
READ_PAUSE_S = 0.3
"""The time from one read to the next where nothing is reported. ArduPilot does not tell as many other items further on,
nor any while it does not fly to a waypoint.
"""
_LONGEST_UPDATE_STEP_S = 0.1
"""The longest time between two steps that follow each other."""
_READ_PAUSE_FACTOR = 2.0
"""Pause between reads without a change, as a multiple of the last read's duration: they get a third of the time. A read
of four items takes 0.15 s on a busy computer.
"""


class _MissionReportKey(NamedTuple):
    """Report of the autopilot about its mission, which changes with it."""

    mission_id: int
    changes: tuple[int, ...]


class MissionWatch:
    """Compares what the autopilot tells of its mission, and reads it again where that does not say enough.

    PX4 tells a checksum. ArduPilot tells the number of items, and by a text that one of the next three has changed. So
    there the mission is read once it is flown, repeatedly, and before it counts as flown to its end.
    """

    def __init__(self, offer: AutopilotMissions, kept: KeptMission) -> None:
        self._offer, self._kept = offer, kept
        self._sure: _MissionReportKey | None = None
        """Report that was valid when the mission was ours; None before the first comparison."""
        self._newest: _MissionReportKey | None = None
        self._asked: _MissionReportKey | None = None
        """Report that was valid when the read in progress began, or the last one."""
        self._reading: Future[KeptMission] | None = None
        self._is_of_end = self._is_end_read = False
        self._began_s, self._next_s, self._next_look_s = 0.0, -math.inf, -math.inf
        self._stepped_s = -math.inf
        self._failures_count = 0
        """Reads in turn that have failed."""
        self.is_other = False
        """Whether the autopilot has another mission."""
        self.failure: UalError | None = None
        """Why the last read failed."""

    def step(self, now_s: float, *, is_end: bool = False) -> None:
        """Compares, takes what was read, and begins to read where that is due. `is_end`: all items seem to be flown."""
        # While the cause of a mode is open no step is made: that is no time of the read.
        looked_s, self._stepped_s = min(now_s, self._stepped_s + _LONGEST_UPDATE_STEP_S), now_s
        if self._reading is not None and self._reading.done():
            self._take(self._reading, now_s, looked_s)
        told = self._report_key()
        if told is None or self._reading is not None or self.is_other:
            return
        if told.mission_id and told.mission_id == self._kept.mission_id:
            self._sure = told
        if self._newest not in (None, told) and not told.mission_id:
            self._next_s = now_s + CHANGE_DELAY_S
        self._newest = told
        is_due = not told.mission_id and now_s >= self._next_look_s
        if now_s >= self._next_s and (is_due or not self.is_sure(is_end=is_end)):
            self._asked, self._is_of_end, self._began_s = told, is_end, now_s
            self._reading = self._offer.download()

    def is_sure(self, *, is_end: bool) -> bool:
        """Returns whether the mission is ours by all that is reported, and by what was read at its end."""
        told = self._report_key()
        if told is None:
            return True
        return told == self._sure and (not is_end or bool(told.mission_id) or self._is_end_read)

    def has_list_of(self, report: MissionReport) -> bool:
        """Returns whether the list reported now is the one that was ours; also while none was reported."""
        return self._sure is None or self._sure == _report_key(report)

    def _report_key(self) -> _MissionReportKey | None:
        report = self._offer.report()
        return None if report is None else _report_key(report)

    def _take(self, reading: Future[KeptMission], now_s: float, looked_s: float) -> None:
        self._reading, self.failure = None, None
        error = None if reading.cancelled() else reading.exception()
        if reading.cancelled() or error is not None:
            self.failure = error if isinstance(error, UalError) else UalError(f"the mission was not read: {error}")
            self._next_s = now_s + min(READ_RETRY_S, _FIRST_READ_RETRY_S * 2.0**self._failures_count)
            self._failures_count += 1
            return
        self._failures_count = 0
        self.is_other = reading.result().digest != self._kept.digest
        self._sure, self._is_end_read = self._asked, self._is_of_end
        self._next_look_s = looked_s + max(READ_PAUSE_S, _READ_PAUSE_FACTOR * (looked_s - self._began_s))


def _report_key(report: MissionReport) -> _MissionReportKey:
    return _MissionReportKey(report.mission_id, report.changes)
