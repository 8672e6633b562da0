"""Whether UAL flies the present flight, or others do."""

from __future__ import annotations

import logging

from ual.types import State
from ual_daemon import logs
from ual_daemon.backends.values import Cause, Control, LandedState, Snapshot

_log = logging.getLogger(__name__)
_UNINITIALIZED, _FLYING_AUTO, _LANDED_ARMED, _LANDED_DISARMED = (
    State.UNINITIALIZED,
    State.FLYING_AUTO,
    State.LANDED_ARMED,
    State.LANDED_DISARMED,
)
"""As names of the module: Python looks up a member of an enumeration by a call, and each update would pay."""

LONGEST_LINK_GAP_S = 10.0
"""After a longer silence the flight may be another one. Within less no UAV lands, is armed again, and takes off."""
_IN_AIR = (_FLYING_AUTO, State.FLYING_MANUAL, State.TAKING_OFF, State.LANDING)
"""A tuple: each update looks, and the hash of an enumeration's member is a call."""
_UNKNOWN = "it is not known who flies it"
_OTHERS = (State.FLYING_MANUAL, State.TAKING_OFF, State.LANDING)
"""States in which others fly where no manoeuvre of UAL is in progress."""


def _took(by: Cause) -> str:
    whose = "autopilot's " if by.is_failsafe else ""
    return f"the {whose}{by.value} took it"


class Authority:
    """Authority over the present flight, from the first command to the disarming.

    UAL holds it from its first command on. A daemon that was started in flight holds nothing: what it finds in OFFBOARD
    or GUIDED may be the flight of a ground station or of another program. Any take-over of the UAV ends UAL's hold; a
    new command begins it again.

    `is_ours` is an attribute: a method would cost each setpoint of a stream a call.
    """

    def __init__(self) -> None:
        self.is_ours = False
        """Whether UAL was commanded in this flight, and nobody has taken the UAV since."""
        self.is_ground_theirs = False
        """Whether others have flown the UAV since it was disarmed, and UAL has not been commanded since."""
        self.given_up = ""
        """Why UAL has given the flight up by itself, human-readable; empty if it has not."""
        self.taken = ""
        """The taker of the UAV in this flight, or that UAL left it, human-readable; empty if neither."""
        self.holder: Cause | None = None
        """Holder of the control in the mode to which UAL led, where the autopilot's data do not tell. An attribute, as
        each sample looks.
        """
        self._has_flown = False
        """Whether UAL was commanded in this flight."""
        self._heard_s: float | None = None
        self._is_in_air = self._was_in_air = False
        """Whether it was in the air when that was known last, and when it was known before the present update."""
        self._is_blind = self._was_blind = False
        self._boot = 0

    @property
    def is_landing_new(self) -> bool:
        """Whether no update has seen yet that it is on the ground, and so assessed by whose command it landed."""
        return self._is_in_air

    def begin(self) -> None:
        """Notes that UAL is commanded. Called with the flight's lock held."""
        # Messages received by now were there when the command was assessed: a silence before it had already ended.
        self.is_ours, self.is_ground_theirs, self.given_up, self._heard_s = True, False, "", None
        self._has_flown, self.taken, self.holder = True, "", None

    def end(self, snapshot: Snapshot, *, is_taken: bool, left_to: str = "", by: str = "") -> None:
        """Notes that a manoeuvre of UAL has ended, and whether others took the UAV in it. `by` is their name, if it is
        known.

        `left_to` is what UAL leaves to the autopilot: to hold by itself, or to land; empty if nothing.

        They may have selected a mode in which the state is FLYING_AUTO all the time (GUIDED in a landing of UAL).
        """
        self.is_ours = not is_taken
        if left_to:
            self.leave(left_to)
        if is_taken:
            self._note_taken(snapshot, "others took it")
        if is_taken and by == Cause.GROUND_STATION.value and snapshot.control.held_by is None:
            self.taken, self.holder = f"the {by} has brought another mission", Cause.GROUND_STATION

    def leave(self, left_to: str) -> None:
        """Notes what UAL leaves to the autopilot; see `end`. It is named until the autopilot tells another holder."""
        self.taken = f"UAL has had the autopilot {left_to}"

    def follow(self, state: State, snapshot: Snapshot) -> None:
        """Notes what an update shows, also while a manoeuvre is in progress; before `observe`."""
        if snapshot.link.boot != self._boot:  # it has not landed: it boots on the ground
            self._boot, self._is_in_air = snapshot.link.boot, False
        self._was_blind, self._is_blind = self._is_blind, state is _UNINITIALIZED
        self._was_in_air = self._is_in_air
        if not self._is_blind:
            self._is_in_air = state in _IN_AIR
        self._follow_silence(snapshot)

    def observe(self, state: State, snapshot: Snapshot, *, is_sending: bool) -> None:
        """Notes what an update shows while no manoeuvre of UAL is in progress.

        `is_sending` is whether a reference is sent: on the ground a descent that has touched down keeps its stream.
        """
        if state is _UNINITIALIZED:
            self._observe_blind(snapshot)
            return
        if state is not _FLYING_AUTO:
            self.given_up = ""
        if snapshot.control.held_by is not None or state not in _OTHERS:
            self.holder = None
        if state is _LANDED_ARMED and self._was_blind and self._was_in_air:  # the cause of its landing was not observed
            self.is_ours, self.is_ground_theirs = False, True
            self._has_flown, self.taken = False, ""  # it may have been armed again
        elif state is _LANDED_DISARMED:
            self.is_ours = self.is_ground_theirs = self._has_flown = False
            self.taken = ""
        elif state is _LANDED_ARMED:
            self.is_ours = self.is_ours and is_sending
        elif state in _OTHERS:
            self.is_ours, self.is_ground_theirs = False, True
            self._note_taken(snapshot, _UNKNOWN)  # what UAL has begun may go on
        elif state is _FLYING_AUTO:
            self.is_ground_theirs = not self.is_ours

    def _note_taken(self, snapshot: Snapshot, unknown: str) -> None:
        """Notes the holder of a UAV that UAL has flown in this flight; the first one that took it, until that is known.

        `unknown` says it where the autopilot does not tell.
        """
        by, mode = snapshot.control.held_by, snapshot.control.mode
        known = None if by is Cause.OPEN else by
        if not self._has_flown or mode is None or (self.taken and known is None):
            return
        if by is None and snapshot.control.is_of_command:
            unknown = "the autopilot follows a command of UAL from before"
        self.taken = f"{unknown if known is None else _took(known)} (mode {mode.value.text})"

    def _follow_silence(self, snapshot: Snapshot) -> None:
        """Gives the flight up after a long silence."""
        heard_s, before_s = snapshot.heard_s, self._heard_s
        self._heard_s = heard_s
        if not self.is_ours or heard_s is None or before_s is None or heard_s - before_s <= LONGEST_LINK_GAP_S:
            return
        self.is_ours = False
        self.given_up = f"nothing was heard for {heard_s - before_s:.0f} s, and the flight may be another's now"
        remedy = "look who flies it; a new command takes it back"
        logs.event(_log, logging.WARNING, "flight_given_up", why=self.given_up, remedy=remedy)

    def _observe_blind(self, snapshot: Snapshot) -> None:
        """Notes what flies it while the state is not known: the mode may be received all the time."""
        if snapshot.control.landed is not None and snapshot.control.landed.value is LandedState.IN_AIR:
            self._is_in_air = True
        mode = snapshot.control.mode
        if self._is_in_air and mode is not None and mode.value.control is not Control.REFERENCES:
            self.is_ours, self.is_ground_theirs = False, True
            self._note_taken(snapshot, _UNKNOWN)
