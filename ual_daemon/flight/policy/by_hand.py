"""Whether what a pilot flies by hand may lie on the ground, though its autopilot takes it to be in the air."""

from __future__ import annotations

from ual.types import State
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.state import is_at_ground_height, is_still

_UNINITIALIZED, _FLYING_AUTO, _FLYING_MANUAL = State.UNINITIALIZED, State.FLYING_AUTO, State.FLYING_MANUAL
_LANDED = (State.LANDED_ARMED, State.LANDED_DISARMED)
"""As names of the module: Python looks up a member of an enumeration by a call, and each update would pay."""
_MAY_LIE = (
    "a pilot has flown it, and it stood still at the height of the ground from which it took off: it may lie there"
)


class ByHand:
    """A flight by hand, and whether it may have ended on the ground. Only the update thread calls `observe`.

    ArduCopter that was dropped, or set down without the throttle at its lowest, is in the air by its own word. A motion
    would lift it off. So none is accepted until it was seen higher, or on the ground.
    """

    def __init__(self) -> None:
        self.why_it_may_lie = ""
        """Why it may lie on the ground, human-readable; empty where it flies."""
        self._is_flown = False
        """Whether a pilot has flown it since UAL led it last, or since it was on the ground."""

    def observe(self, state: State, snapshot: Snapshot, ground_z_m: float | None, *, is_ours: bool) -> None:
        """Takes an update. `ground_z_m` is the ground from which it took off; None where it is not known."""
        if state is _FLYING_MANUAL:
            mode = snapshot.control.mode
            self._is_flown = self._is_flown or (mode is not None and not mode.value.is_autonomous)
        elif state in _LANDED or (is_ours and state is _FLYING_AUTO and not self.why_it_may_lie):
            self._is_flown, self.why_it_may_lie = False, ""
        if not self._is_flown or state is _UNINITIALIZED:
            return
        if not is_at_ground_height(snapshot, ground_z_m):
            self.why_it_may_lie = ""
        elif is_still(snapshot):
            self.why_it_may_lie = _MAY_LIE
