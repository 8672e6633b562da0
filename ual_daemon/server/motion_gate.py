"""Refuses what starts or continues a flight while this daemon must not fly (``--audit-required``)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from ual.contract.method import Moves
from ual.contract.methods import METHODS
from ual.errors import WrongStateError
from ual_daemon.vehicle.refusal_log import RefusalLog

FLIES: Final = frozenset(each.path for each in METHODS.values() if each.moves is Moves.FLIGHT)
"""The methods that start or continue a flight. What ends one (Land, Abort, Pause, Disarm) or gives it up is none."""


class MotionGate:
    """Refuses motions. Any thread may call; each setpoint does.

    `trouble` returns why the calls of this daemon cannot be accounted for, human-readable; empty if they can.
    """

    def __init__(self, trouble: Callable[[], str]) -> None:
        self._trouble = trouble
        self._refusals = RefusalLog()

    def require_open(self, method: str) -> None:
        """Requires that what a motion does can be accounted for.

        Raises:
            WrongStateError: It cannot.

        """
        trouble = self._trouble()
        if not trouble:
            return
        error = WrongStateError(
            f"{method.rpartition('/')[2]}: the audit cannot be written ({trouble}), and without it this daemon accepts "
            "no motion (--audit-required). Make room for its file, or put it back; motions are accepted as soon as it "
            "is written again. Land, abort, pause and disarm are always accepted",
            {"needed": "audit", "why": trouble},
        )
        self._refusals.log_refusal(method, error)
        raise error
