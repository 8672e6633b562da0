"""Origin of an arming that begins a flight by itself."""

from __future__ import annotations

import logging
from dataclasses import replace

from ual.types import State
from ual_daemon import logs
from ual_daemon.backends.values import Cause, Control, Mode, OnArming, Snapshot
from ual_daemon.flight.state import Estimate

_log = logging.getLogger(__name__)

_THEIRS = "; the safety pilot or a ground station has armed it in mode {}, which starts a flight: UAL sends nothing"
_OURS = "; UAL has armed it in mode {}, which starts a flight: abort and land end that"
_SELECTED = "; after UAL has armed it others have selected mode {}, which starts a flight: abort and land end that"


class Arming:
    """The arming of the present flight, and what the autopilot flies by itself because of it.

    Belongs to the update thread, except `order` and `withdraw`, which any thread may call.
    """

    def __init__(self) -> None:
        self.is_ours = False
        """Whether UAL has commanded the arming."""
        self._is_ordered = False
        """Whether UAL has commanded an arming that no update has shown yet."""
        self.is_ours_to_end = False
        """Whether the autopilot flies by itself since UAL has armed it, and nobody has taken it since."""
        self._is_armed: bool | None = None
        self._armed_in = ""
        """The mode in which it was armed, where that begins a flight by itself."""
        self._is_judged = True
        """Whether the mode in which it was armed is known, or never will be."""
        self._is_selected = False
        """Whether others have selected that mode on the ground, after our arming."""
        self._has_stood = False
        """Whether it stands armed, and has done so in a mode that begins no flight."""

    def order(self) -> None:
        """Notes that the next arming is UAL's. The last update may not have shown yet that it was disarmed before."""
        self._is_ordered = True

    def withdraw(self) -> None:
        """Takes `order` back: the arming has failed."""
        self._is_ordered = self.is_ours = False

    def follow(self, snapshot: Snapshot, *, is_idle: bool) -> None:
        """Notes what an update shows. `is_idle` is whether UAL flies nothing, which may be a mission, too."""
        armed, mode = snapshot.control.armed, snapshot.control.mode
        if armed is None or mode is None:
            return
        if armed.value is not self._is_armed:
            self._changed(is_armed=armed.value)
        if not self._is_judged and snapshot.control.settled_mode:
            self._judge(snapshot)
        elif is_idle and self._has_stood and self.is_ours and not self._armed_in and _is_selected_by_others(snapshot):
            self._begins(mode.value, is_selected=True)
        elif self.is_ours_to_end and self.is_taken(snapshot):
            self.is_ours_to_end = False
        if not (armed.value and snapshot.control.is_on_ground):
            self._has_stood = False
        elif not self._has_stood:
            self._has_stood = bool(snapshot.control.settled_mode) and not _begins_a_flight(mode.value)

    def explained(self, found: Estimate) -> Estimate:
        """Returns the same; of a flight that an arming has begun, its reason says whose arming."""
        if not self._armed_in or found.state not in (State.TAKING_OFF, State.FLYING_MANUAL, State.LANDING):
            return found
        if self.is_ours and not self.is_ours_to_end:
            return found
        ours = _SELECTED if self._is_selected else _OURS
        return replace(found, why=found.why + (ours if self.is_ours else _THEIRS).format(self._armed_in))

    def is_taken(self, snapshot: Snapshot) -> bool:
        """Returns whether UAL or others have led it to another mode. The autopilot itself ends in the one in which it
        holds. A snapshot may be newer than the last update.
        """
        mode, by = snapshot.control.mode, snapshot.control.held_by
        assert mode is not None
        if by is Cause.SAFETY_PILOT or mode.value.control is Control.REFERENCES:
            return True
        holds = mode.value.is_autonomous and mode.value.on_arming is OnArming.STANDS
        return by is Cause.GROUND_STATION and mode.value.text != self._armed_in and not holds

    def _changed(self, *, is_armed: bool) -> None:
        was_armed, self._is_armed = self._is_armed, is_armed
        self._armed_in, self._is_selected, self.is_ours_to_end = "", False, False
        self._is_judged = not is_armed or was_armed is None
        if is_armed:
            self.is_ours, self._is_ordered = self._is_ordered, False
        elif was_armed:
            self.is_ours = False

    def _judge(self, snapshot: Snapshot) -> None:
        mode = snapshot.control.mode
        assert mode is not None
        self._is_judged = True
        if _begins_a_flight(mode.value):
            self._begins(mode.value, is_selected=False)

    def _begins(self, mode: Mode, *, is_selected: bool) -> None:
        self._armed_in, self._is_selected, self.is_ours_to_end = mode.text, is_selected, self.is_ours
        who = "UAL" if self.is_ours else "the safety pilot or a ground station"
        logs.event(_log, logging.WARNING, "armed_in_flying_mode", by=who, mode=mode.text, selected_after=is_selected)


def _begins_a_flight(mode: Mode) -> bool:
    return mode.on_arming in (OnArming.FLIES, OnArming.MAY_FLY)


def _is_selected_by_others(snapshot: Snapshot) -> bool:
    """Returns whether others have selected, for the armed UAV on the ground, a mode in which the autopilot begins a
    flight.
    """
    control = snapshot.control
    is_theirs = control.is_on_ground and control.held_by in (Cause.GROUND_STATION, Cause.OPEN)
    return is_theirs and control.mode is not None and _begins_a_flight(control.mode.value)
