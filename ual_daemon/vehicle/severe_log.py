"""The log's events of what an autopilot says that is critical or worse: one for each text, as it comes."""

from __future__ import annotations

import logging

from ual_daemon import logs
from ual_daemon.backends.values import SevereText

_log = logging.getLogger(__name__)


class SevereLog:
    """Logs the severe texts of one UAV. Belongs to the update thread."""

    def __init__(self) -> None:
        self.seen: tuple[SevereText, ...] = ()
        """Severe texts of the last update."""

    def observe(self, texts: tuple[SevereText, ...]) -> None:
        """Logs those that are new."""
        for each in texts:
            if each not in self.seen:
                level = logging.ERROR if each.severity < _CRITICAL else logging.WARNING
                logs.event(_log, level, "autopilot_says", text=each.text, severity=each.severity)
        self.seen = texts


_CRITICAL = 2
"""MAV_SEVERITY_CRITICAL. Alerts and emergencies are worse."""
