"""Take-off: straight up to a height above the ground that the UAV stands on."""

from __future__ import annotations

from functools import partial

from ual.errors import TaskAbortedError, UalTimeoutError
from ual.geometry import Vector3
from ual.types import Limits, State
from ual_daemon.backends.values import Control, LandedState, Setpoint, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvre import (
    TIMEOUT_FACTOR,
    TIMEOUT_MARGIN_S,
    Manoeuvre,
    Step,
    failed,
    taken,
    why_blind,
)
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import Progress, VehicleTask
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.references import Follow, Hold, Reference, measured_motion
from ual_daemon.trajectory import Line, Motion

_LOST_ACK_S = 1.0
_TOLERANCE = 0.05
_LEAST_TOLERANCE_M = 0.1


class TakeOff(Manoeuvre):
    """Straight up to a height above where it stands."""

    declares = State.TAKING_OFF
    is_replaceable = False

    def __init__(
        self,
        task: VehicleTask,
        command: AutopilotCommand,
        start: Snapshot,
        height_m: float,
        limits: Limits,
        tolerance: ToleranceSettings,
        *,
        on_setpoints: bool,
    ) -> None:
        super().__init__("take_off", task)
        self._task = task
        self._command = self.command = command
        self._height_m = height_m
        self._limits = limits
        self._on_setpoints = on_setpoints
        self._slow_m_s = tolerance.speed_m_s
        self._dwell_s = tolerance.dwell_s
        motion = measured_motion(start)
        self._ground_z = motion.position.z
        self._ground = Hold(motion.position, motion.yaw_rad)
        self._top = Hold(motion.position + Vector3(0.0, 0.0, height_m), motion.yaw_rad)
        self._tolerance_m = max(_LEAST_TOLERANCE_M, _TOLERANCE * height_m)
        self._climb: Follow | None = None
        # One that is in OFFBOARD already may leave it by itself first, as no setpoints came until now.
        self._is_left_over = on_setpoints and _is_ours(start)
        self._was_ours = False
        self._climbing_since_s: float | None = None
        self._up_since_s: float | None = None
        self._longest_s = height_m / limits.climb_speed_m_s * TIMEOUT_FACTOR + TIMEOUT_MARGIN_S

    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_blind(estimate, self.name)
        if lost is not None:
            return failed(lost)
        if estimate.state is State.LANDED_DISARMED:
            return failed(TaskAbortedError("take_off: the motors were disarmed", {"by": "autopilot"}))
        if self._climbing_since_s is None:
            if not self._has_begun(snapshot):
                if self._is_taken_before(snapshot, estimate):
                    return failed(taken(snapshot, self.name))
                failure = self._command.failure(snapshot)
                if failure is not None:
                    return failed(failure)
                return Step(self._ground.setpoint(snapshot) if self._on_setpoints else None)
            self._climbing_since_s = snapshot.time_s
        return self._climb_on(snapshot, estimate, self._climbing_since_s)

    def _is_taken_before(self, snapshot: Snapshot, estimate: Estimate) -> bool:
        """Whether somebody else flies it, or the mode was right and is no more, before it was told to climb for sure.
        It must not be told again: an OFFBOARD that is repeated would take it from the safety pilot, and an autopilot
        that climbs by itself may do so in other modes, too (ArduPilot in LOITER).
        """
        is_ours = _is_ours(snapshot)
        is_taken = (self._was_ours and not is_ours) or estimate.state is State.FLYING_MANUAL
        self._is_left_over = self._is_left_over and is_ours
        self._was_ours = is_ours and not self._is_left_over
        return is_taken

    def _has_begun(self, snapshot: Snapshot) -> bool:
        if not _is_ours(snapshot):
            return False
        # In the right mode; where the acknowledgement got lost, the mode alone must do.
        is_answer_lost = not self._command.is_answered and snapshot.time_s - self._command.sent_s > _LOST_ACK_S
        return self._command.is_accepted or is_answer_lost

    def _climb_on(self, snapshot: Snapshot, estimate: Estimate, since_s: float) -> Step:
        assert snapshot.mode is not None
        ours = (Control.REFERENCES,) if self._on_setpoints else (Control.REFERENCES, Control.TAKE_OFF)
        if snapshot.mode.value.control not in ours:
            return failed(taken(snapshot, self.name))
        refusal = self._command.refusal()  # one that came late, by a bad link
        if refusal is not None and estimate.state is State.LANDED_ARMED:
            return failed(refusal)
        motion = measured_motion(snapshot)
        setpoint = self._climb_setpoint(snapshot, motion) if self._is_led(snapshot, estimate) else None
        climbed_m = motion.position.z - self._ground_z
        progress = max(0.0, min(1.0, climbed_m / self._height_m))
        self._task.report(partial(Progress, progress, max(0.0, self._height_m - climbed_m)))
        is_up = abs(climbed_m - self._height_m) <= self._tolerance_m and motion.velocity.norm() <= self._slow_m_s
        if not is_up or not self._has_climbed(estimate):
            self._up_since_s = None
        elif self._up_since_s is None:
            self._up_since_s = snapshot.time_s
        if self._up_since_s is not None and snapshot.time_s - self._up_since_s >= self._dwell_s:
            return Step(setpoint, has_ended=True, then=self._top)
        if snapshot.time_s - since_s > self._longest_s:
            return failed(
                UalTimeoutError(
                    f"take_off: at {climbed_m:.2f} m after {self._longest_s:.0f} s, not at {self._height_m:g} m"
                )
            )
        return Step(setpoint)

    def _has_climbed(self, estimate: Estimate) -> bool:
        """Whether the climb is over: a low one is within its tolerance while it still stands on the ground. One that
        climbs by itself is not up before it says so.
        """
        if estimate.state is State.LANDED_ARMED:
            return False
        if self._on_setpoints:
            return self._climb is not None and self._climb.is_finished
        return estimate.state is not State.TAKING_OFF

    def _is_led(self, snapshot: Snapshot, estimate: Estimate) -> bool:
        """Whether it gets references. One that climbs by itself takes none before it says that it has done so. Then it
        is led to the height that was asked for: it may count from elsewhere (home, the ground below its rangefinder).
        """
        is_in_air = snapshot.landed is not None and snapshot.landed.value is LandedState.IN_AIR
        return self._on_setpoints or (is_in_air and estimate.state is State.FLYING_AUTO)

    def _climb_setpoint(self, snapshot: Snapshot, measured: Motion) -> Setpoint:
        if self._climb is None:
            top = self._top.motion(snapshot)
            start = self._ground.motion(snapshot) if self._on_setpoints else measured
            line = Line(start, top.position, top.yaw_rad, self._limits)
            self._climb = Follow(line, snapshot.time_s)
        return self._climb.setpoint(snapshot)

    def pose_reference(self) -> Reference | None:
        return self._climb or self._ground


def _is_ours(snapshot: Snapshot) -> bool:
    """Whether it is in a mode in which a take-off of ours climbs."""
    return snapshot.mode is not None and snapshot.mode.value.control in (Control.REFERENCES, Control.TAKE_OFF)
