"""Taking control back from the safety pilot."""

from __future__ import annotations

from typing_extensions import override

from ual.errors import TaskAbortedError, UalError
from ual.geometry import Vector3
from ual.types import Limits, State
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvre import Manoeuvre, Step, failed, why_blind
from ual_daemon.flight.state import Estimate
from ual_daemon.tracker.references import Hold, Reference, brake, measured_motion


class Recover(Manoeuvre):
    """Takes control back from the safety pilot. Holds the present pose until the mode has changed, and then stops."""

    is_replaceable = False

    def __init__(self, command: AutopilotCommand, limits: Limits) -> None:
        super().__init__("recover_from_manual", None)
        self._command = self.command = command
        self._limits = limits

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_blind(estimate, self.name)
        if lost is not None:
            return failed(lost)
        if estimate.state is State.FLYING_AUTO:
            stop = brake(snapshot, self._limits)
            return Step(stop.setpoint(snapshot), has_ended=True, next_reference=stop)
        if estimate.state is not State.FLYING_MANUAL:
            return failed(
                TaskAbortedError(
                    f"recover_from_manual: the state became {estimate.state.name}",
                    {"by": "autopilot", "state": estimate.state.name},
                )
            )
        failure = self._command.failure(snapshot)
        if failure is not None:
            return failed(failure)
        motion = measured_motion(snapshot)
        return Step(Hold(motion.position, motion.yaw_rad).setpoint(snapshot))

    @override
    def estimate_jumped(self, jump: Vector3, stop: Reference) -> UalError | None:
        return None  # it holds the present pose, wherever that is
