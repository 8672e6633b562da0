"""Logs once that telemetry is interrupted, and once that it is back."""

from __future__ import annotations

import logging

from ual.errors import UalError


class InterruptionLog:
    """Remembers which interruption of one telemetry stream was logged, so that no retry logs it again."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._logged_reason = ""

    def interrupted(self, error: UalError) -> None:
        """Logs the error, unless the last one logged has the same reason."""
        if error.reason != self._logged_reason:
            self._logged_reason = error.reason
            self._log.warning("telemetry is interrupted: %s: %s", error.reason, error.message)

    def resumed(self) -> None:
        """Logs that samples come again, if an interruption was logged."""
        if self._logged_reason:
            self._logged_reason = ""
            self._log.info("telemetry is back")
