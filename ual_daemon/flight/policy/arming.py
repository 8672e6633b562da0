"""Who armed the UAV where that begins a flight by itself."""

from __future__ import annotations

import logging
from dataclasses import replace

from ual.types import State
from ual_daemon import logs
from ual_daemon.backends.values import Cause, Control, OnArming, Snapshot
from ual_daemon.flight.state import Estimate

_log = logging.getLogger(__name__)

_THEIRS = "; the safety pilot or a ground station has armed it in mode {}, which starts a flight: UAL sends nothing"
_OURS = "; UAL has armed it in mode {}, which starts a flight: abort and land end that"


class Arming:
    """The arming of the present flight, and what the autopilot flies by itself because of it.

    Belongs to the update thread, except `is_ours`, which any thread may set.
    """

    def __init__(self) -> None:
        self.is_ours = False
        """Whether UAL has commanded the arming."""
        self.is_ours_to_end = False
        """Whether the autopilot flies by itself since UAL has armed it, and nobody has taken it since."""
        self._is_armed: bool | None = None
        self._armed_in = ""
        """The mode in which it was armed, where that begins a flight by itself."""
        self._is_judged = True
        """Whether the mode in which it was armed is known, or never will be."""

    def follow(self, snapshot: Snapshot) -> None:
        """Notes what an update shows."""
        armed, mode = snapshot.control.armed, snapshot.control.mode
        if armed is None or mode is None:
            return
        if armed.value is not self._is_armed:
            self._changed(is_armed=armed.value)
        if not self._is_judged and snapshot.control.settled_mode:
            self._judge(snapshot)
        elif self.is_ours_to_end and self._is_taken(snapshot):
            self.is_ours_to_end = False

    def explained(self, found: Estimate) -> Estimate:
        """Returns the same; of a flight that an arming has begun, its reason says whose arming."""
        if not self._armed_in or found.state not in (State.TAKING_OFF, State.FLYING_MANUAL):
            return found
        if self.is_ours and not self.is_ours_to_end:
            return found
        return replace(found, why=found.why + (_OURS if self.is_ours else _THEIRS).format(self._armed_in))

    def _changed(self, *, is_armed: bool) -> None:
        was_armed, self._is_armed = self._is_armed, is_armed
        self._armed_in, self.is_ours_to_end = "", False
        self._is_judged = not is_armed or was_armed is None
        if was_armed:
            self.is_ours = False

    def _judge(self, snapshot: Snapshot) -> None:
        mode = snapshot.control.mode
        assert mode is not None
        self._is_judged = True
        if mode.value.on_arming not in (OnArming.FLIES, OnArming.MAY_FLY):
            return
        self._armed_in, self.is_ours_to_end = mode.value.text, self.is_ours
        who = "UAL" if self.is_ours else "the safety pilot or a ground station"
        logs.event(_log, logging.WARNING, "armed_in_flying_mode", by=who, mode=mode.value.text)

    def _is_taken(self, snapshot: Snapshot) -> bool:
        """Whether UAL or others have led it to another mode. The autopilot itself ends in the one in which it holds."""
        mode, by = snapshot.control.mode, snapshot.control.held_by
        assert mode is not None
        if by is Cause.SAFETY_PILOT or mode.value.control is Control.REFERENCES:
            return True
        holds = mode.value.is_autonomous and mode.value.on_arming is OnArming.STANDS
        return by is Cause.GROUND_STATION and mode.value.text != self._armed_in and not holds
