"""How a mission that the autopilot flies by itself is stopped, in each state."""

from __future__ import annotations

from functools import partial

from ual.types import State
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.autopilot_mission import AutopilotMission
from ual_daemon.flight.manoeuvres.manoeuvre import Handover, Manoeuvre
from ual_daemon.flight.manoeuvres.recover import Recover
from ual_daemon.flight.manoeuvres.stay_on_ground import StayOnGround
from ual_daemon.tracker.limits import CurrentLimits

_LANDED = (State.LANDED_ARMED, State.LANDED_DISARMED)
_UNREACHED = (State.TAKING_OFF, State.UNINITIALIZED)
"""In these the control is taken back later: once the take-off has ended, or the autopilot is seen again."""


def mission_stop(
    by: str, flown: Manoeuvre | None, state: State, snapshot: Snapshot, backend: Backend, limits: CurrentLimits
) -> Handover | None:
    """Returns what is flown instead of a mission. None where it only has to end: it lands, or was not sent yet.

    Args:
        by: What stops it, for people.
        flown: What is flown now.
        state: The state that the data show in the snapshot.
        snapshot: The one by which it is judged.
        backend: Commands the autopilot.
        limits: Those of the stop.

    """
    if state in _LANDED:
        if not isinstance(flown, AutopilotMission):
            return None
        stay = StayOnGround(by, flown, backend.hold)
        return Handover(stay, partial(stay.send, snapshot))
    if state is State.LANDING:
        return None
    is_early, is_patient = state is State.FLYING_AUTO, state in _UNREACHED
    command, control = AutopilotCommand("take our references"), backend.take_control
    recover = Recover(command, limits.get(), control, lambda _: None, name=by, is_early=is_early, is_patient=is_patient)
    return Handover(recover, _nothing if is_early or is_patient else partial(recover.send, snapshot))


def _nothing() -> None:
    """The command is sent by its steps."""
