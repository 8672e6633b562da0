"""Keeps what serves no flight (cameras, gimbals, transfers, corrections) from ending one."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import ParamSpec

_log = logging.getLogger(__name__)

_MOST_TOLD = 10
P = ParamSpec("P")


class Contained:
    """Calls it, on the thread that flies the UAV. A defect of it is logged, once, and does not reach that thread.

    `what` names it in the log.
    """

    def __init__(self, what: str) -> None:
        self._what = what
        self._told: set[str] = set()

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
        if text in self._told or len(self._told) >= _MOST_TOLD:
            return
        self._told.add(text)
        _log.error(
            "%s failed, and the flight goes on; this is a defect of UAL, please report it", self._what, exc_info=error
        )
