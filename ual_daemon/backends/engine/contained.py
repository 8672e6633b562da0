"""Keeps defects of parts other than the flight (cameras, gimbals, transfers) and of requests from ending the flight."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable
from typing import ParamSpec

from ual.errors import UalError

_log = logging.getLogger(__name__)

_MOST_LOGGED_ERRORS = 10
P = ParamSpec("P")


def defect(what: str, error: Exception) -> UalError:
    """Logs a defect, and returns the error for the caller that wanted `what` (human-readable: "land")."""
    _log.error("cannot %s; this is a defect of UAL, please report it", what, exc_info=error)
    return UalError(f"cannot {what}: a defect of UAL: {error!r}")


class ErrorBarrier:
    """Calls a part on the thread that flies the UAV. A defect of the part is logged, once, and stays out of it.

    `what` names the part in the log, and `outcome` says what follows from its failure, human-readable.
    """

    def __init__(self, what: str, outcome: str = "the flight goes on") -> None:
        self._what, self._outcome = what, outcome
        self._logged: set[str] = set()

    def call(self, act: Callable[P, object], *args: P.args, **kwargs: P.kwargs) -> bool:
        """Returns whether it was done."""
        try:
            act(*args, **kwargs)
        except Exception as error:  # noqa: BLE001 - what flies goes on
            self.tell(error)
            return False
        return True

    def tell(self, error: Exception) -> None:
        """Logs a defect, once."""
        text = repr(error)
        if text in self._logged or len(self._logged) >= _MOST_LOGGED_ERRORS:
            return
        self._logged.add(text)
        line = "%s failed, and %s; this is a defect of UAL, please report it"
        _log.error(line, self._what, self._outcome, exc_info=error)


def __getattr__(name: str) -> object:
    if name == "Contained":
        warnings.warn("Contained is ErrorBarrier since 0.3; the old name ends in 0.4", DeprecationWarning, stacklevel=2)
        return ErrorBarrier
    raise AttributeError(name)
