"""Stop of a mission that the autopilot flies by itself, in each state."""

from __future__ import annotations

from functools import partial

from ual.errors import UalError
from ual.types import State
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.manoeuvres.autopilot_mission import AutopilotMission
from ual_daemon.flight.manoeuvres.await_stop import AwaitStop
from ual_daemon.flight.manoeuvres.manoeuvre import Handover, Manoeuvre
from ual_daemon.flight.manoeuvres.stay_on_ground import StayOnGround
from ual_daemon.flight.manoeuvres.stop_in_air import StopInAir

_LANDED = (State.LANDED_ARMED, State.LANDED_DISARMED)
_UNREACHED = (State.TAKING_OFF, State.UNINITIALIZED)
"""In these it is stopped later: once the take-off has ended, or the autopilot is seen again."""


class MissionStop:
    """Stops one mission. What stops it in one state hands over to what does in the next."""

    def __init__(self, by: str, mission: Manoeuvre, backend: Backend) -> None:
        """`by` is what stops it, human-readable; `mission` is flown now, or stops it already."""
        self._by = by
        self._modes = _modes_of(mission)
        self._backend = backend

    def after(self, state: State, snapshot: Snapshot, old: Manoeuvre) -> Handover | None:
        """Returns what is flown after a manoeuvre, in the state that the data show. None where it only has to end: it
        lands, or was not sent yet.
        """
        handover = self._in(state, snapshot, old)
        if handover is not None:
            handover.manoeuvre.led = old.leads()
            handover.manoeuvre.replaces(old)
        return handover

    def _in(self, state: State, snapshot: Snapshot, old: Manoeuvre) -> Handover | None:
        if state in _UNREACHED:
            return self._wait(old)
        if state in _LANDED:
            return None if self._modes is None else self._stay(self._modes, snapshot)
        return None if state is State.LANDING else self._take_back(snapshot, old, is_early=state is State.FLYING_AUTO)

    def _stay(self, modes: tuple[str, str], snapshot: Snapshot) -> Handover:
        stay = StayOnGround(self._by, modes, self._backend.hold, self.after)
        return Handover(stay, partial(stay.send, snapshot))

    def _hold_instead(self, refused: UalError, old: Manoeuvre) -> Handover:
        handover = self._wait(old, refused)
        handover.manoeuvre.led = old.leads()
        return handover

    def _wait(self, old: Manoeuvre, refused: UalError | None = None) -> Handover:
        return Handover(AwaitStop(self._by, old.mode_seen, self._modes, self._backend.hold, self.after, refused))

    def _take_back(self, snapshot: Snapshot, old: Manoeuvre, *, is_early: bool) -> Handover:
        control, seen = self._backend.take_control, old.mode_seen
        recover = StopInAir(self._by, seen, self._modes, control, self.after, self._hold_instead, is_early=is_early)
        # In a mode that was not assessed yet, its steps send it.
        is_judged = seen in ("", snapshot.control.settled_mode) and not is_early
        return Handover(recover, partial(recover.send, snapshot)) if is_judged else Handover(recover)


def _modes_of(mission: Manoeuvre) -> tuple[str, str] | None:
    """Returns the modes in which the autopilot flies it and holds; None where UAL takes the control back already."""
    return mission.modes if isinstance(mission, AutopilotMission | AwaitStop | StayOnGround | StopInAir) else None
