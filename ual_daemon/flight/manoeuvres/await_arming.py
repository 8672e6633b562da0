"""Waiting until the UAV is armed, before a take-off that was commanded already."""

from __future__ import annotations

from collections.abc import Callable

from typing_extensions import override

from ual.errors import UalError, WrongStateError
from ual.types import State
from ual_daemon.backends.values import Control, Snapshot
from ual_daemon.flight.manoeuvres.manoeuvre import Handover, Manoeuvre, Step, failed, taken, why_blind
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.tracker.references import Reference

_ARMING_TIMEOUT_S = 15.0
"""The automatic arming waits for 1 s of readiness; an autopilot that has just landed takes some seconds to disarm."""
_DISARM_S = 5.0
"""Seconds that an autopilot that has landed may take to disarm itself; PX4 takes 2 s, ArduPilot 0.6 s."""


class AwaitArming(Manoeuvre):
    """Waits on the ground until the UAV was armed, without arming it, and hands over to the take-off.

    A UAV that is armed from before its landing is about to be disarmed by its autopilot: it waits for that, too.
    """

    why_not_pausable = "it waits for the arming"

    def __init__(self, task: VehicleTask, take_off: Callable[[Snapshot], Handover], now_s: float) -> None:
        """`take_off` makes the take-off that begins in a snapshot."""
        super().__init__("take_off", task)
        self._take_off = take_off
        self._since_s = now_s

    @override
    def estimate_jumped(self, jump: EstimateJump, stop: Reference) -> UalError | None:
        """Goes on waiting: it has no way yet."""
        return None

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_blind(estimate, self.name)
        if lost is not None:
            return failed(lost)
        waited_s = snapshot.time_s - self._since_s
        if estimate.state is State.LANDED_ARMED and (waited_s > _DISARM_S or not is_after_landing(snapshot)):
            return Step(handover=self._take_off(snapshot))
        if estimate.state not in (State.LANDED_ARMED, State.LANDED_DISARMED):
            return taken(snapshot, self.name)
        if waited_s > _ARMING_TIMEOUT_S:
            return failed(
                WrongStateError(
                    f"take_off: the UAV was not armed within {_ARMING_TIMEOUT_S:g} s{_why_not_ready(snapshot)}",
                    {"state": estimate.state.name, "needed": State.LANDED_ARMED.name, "command": self.name},
                )
            )
        return Step()


def is_after_landing(snapshot: Snapshot) -> bool:
    """Returns whether the autopilot is in its landing mode: on the ground, it then disarms by itself."""
    return snapshot.control.mode is not None and snapshot.control.mode.value.control is Control.LAND


def _why_not_ready(snapshot: Snapshot) -> str:
    """Returns in words why nobody arms it: what that would start, or which checks of the autopilot fail. Empty where
    neither is known.
    """
    if starts := snapshot.control.arming_starts:
        return f": {starts}"
    health = snapshot.condition.health
    if health is None or health.is_ready_to_arm is not False:
        return ""
    return f": it is not ready to arm ({', '.join(health.failing_checks) or 'it does not say why'})"
