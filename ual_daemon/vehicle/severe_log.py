"""The log's events of what an autopilot says that is critical or worse: one for each text, as it comes."""

from __future__ import annotations

import logging

from ual_daemon import logs
from ual_daemon.backends.values import SevereText, Snapshot

_log = logging.getLogger(__name__)


class SevereLog:
    """Logs the severe texts of one UAV. Belongs to the update thread."""

    def __init__(self) -> None:
        self._seen: tuple[SevereText, ...] = ()

    def observe(self, snapshot: Snapshot) -> None:
        """Logs those that are new in a snapshot."""
        texts = snapshot.condition.severe_texts
        if texts is self._seen:
            return
        for each in texts:
            if each not in self._seen:
                level = logging.ERROR if each.severity < _CRITICAL else logging.WARNING
                logs.event(_log, level, "autopilot_says", text=each.text, severity=each.severity)
        self._seen = texts


_CRITICAL = 2
"""MAV_SEVERITY_CRITICAL. Alerts and emergencies are worse."""
