"""Whether what calls itself a multirotor is one: a VTOL may be set up to call itself a quadrotor."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable

from ual_daemon import logs
from ual_daemon.backends.engine.agreement import Agreement, AirborneWatch
from ual_daemon.backends.firmwares.autopilot import NO_PARAMETERS
from ual_daemon.backends.firmwares.numbers import VtolState
from ual_daemon.backends.mavlink.dialects.dialect import Dialect

_log = logging.getLogger(__name__)

PARAMETER_REQUEST_S = 0.5
"""Seconds between two reads of a parameter that only planes have, while it is not sure that it is there."""
KNOWN_SHAPE_POLL_S, ENDS_S = 2.0, 10.0
"""Seconds between two reads while the verdict stands, and seconds without an answer after which that ends."""
_DISGUISED = "it calls itself a multirotor, but says that it is a VTOL"


class Shape:
    """Belongs to the thread that receives, and outlives the session: a verdict replaces that.

    `announced` is the dialect of the vehicle that its heartbeats name. `read` reads a parameter again. `flight` is that
    of the session.
    """

    def __init__(self, announced: Dialect, flight: AirborneWatch, read: Callable[[str], None]) -> None:
        self.read = read
        self.flight = flight
        self._is_calm = False
        """Whether nothing says anything else than the verdicts. Not at first: they note when they begin."""
        self._announced = announced
        self._state, self._parameter = Agreement(assumed=False), Agreement(assumed=False, ends_s=ENDS_S)
        self._name = ""
        self._next_s = -math.inf
        self._doubt = ""

    @property
    def is_vtol(self) -> bool:
        """Whether it is a VTOL in truth."""
        return self._state.value or self._parameter.value

    @property
    def doubt(self) -> str:
        """Human-readable doubt that is reported in flight: from the landing on it is only watched; empty if there is
        none.
        """
        return _DISGUISED if self._state.pending or self._parameter.pending else ""

    def on_vtol_state(self, state: int, now_s: float) -> None:
        """Takes its MAV_VTOL_STATE."""
        if self._is_calm and self._state.is_backed and state == VtolState.UNDEFINED:
            return  # nearly always
        is_vtol = not self._announced.is_multirotor(state, NO_PARAMETERS)
        self._state.note(is_vtol, now_s, is_flying=self.flight.is_flying(now_s))
        self._is_calm = self._is_calm and not self._state.is_open

    def on_parameter(self, name: str, now_s: float) -> None:
        """Takes that it has a parameter."""
        if not self._announced.is_multirotor(VtolState.UNDEFINED, {name: 1.0}):
            self._name = name
            self._is_calm = False
            self._parameter.note(True, now_s, is_flying=self.flight.is_flying(now_s))

    def tick(self, now_s: float) -> None:
        """Does what is due; to be called often."""
        if self._is_calm:
            return
        is_flying = self.flight.is_flying(now_s)
        for each in (self._state, self._parameter):
            each.tick(now_s, is_flying=is_flying)
        self._is_calm = not any(each.is_open or each.value for each in (self._state, self._parameter))
        is_wanted = self._parameter.is_open or self._parameter.value
        if is_wanted and now_s >= self._next_s:
            self._next_s = now_s + (KNOWN_SHAPE_POLL_S if self._parameter.value else PARAMETER_REQUEST_S)
            self.read(self._name)
        doubt, self._doubt = self._doubt, self.doubt
        if self._doubt and not doubt:
            logs.event(_log, logging.WARNING, "vehicle_doubtful", why=self._doubt)
