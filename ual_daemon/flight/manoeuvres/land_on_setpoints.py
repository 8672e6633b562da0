"""Landing by velocities, for vehicles without a landing of their own that UAL may use (`flies_landing_on_setpoints`).

The velocities lead straight down until the vehicle stands. Then its motors are stopped.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import TaskAbortedError, UalError, UalTimeoutError
from ual.geometry import Vector3
from ual.types import State
from ual_daemon.backends.values import Control, Sample, Snapshot, VelocitySetpoint
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.land import SLOWEST_LANDING_M_S, Landing, OnHeight, ignore_height
from ual_daemon.flight.manoeuvres.manoeuvre import Step, failed, taken, why_blind, with_advice
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.tracker.references import Reference, measured_motion

FAST_M_S, SLOW_M_S = 1.0, 0.5
SLOW_DESCENT_HEIGHT_M = 5.0
"""The height of the ground from which it took off says little about the ground here: it descends slowly early."""
STILL_SPEED_M_S = 0.5
"""It descends once it is slower than this, and over the place where it then is."""
LONGEST_STOP_S = 10.0
POSITION_PER_S, ASIDE_M_S = 0.8, 1.0
"""Speed with which it is led back over its landing point: in m/s per metre, and at most."""
MODE_AGE_LIMIT_S = 0.5
"""No velocity is sent while the mode is older: the vehicle then holds by itself."""
UNSEEN_MARKER_S = 2.0
"""Seconds without the mode, or without an update, after which others may fly, whose velocities look like ours. A
backend that discards the mode, after a silence or a pause of its own, ends it sooner.
"""
MEASUREMENT_AGE_LIMIT_S = 1.0
"""With an older position it is not led aside, and an older velocity does not show whether it has stopped."""
STOP_AGAIN_S, MOST_STOPS = 3.0, 3
LOST_CONTROL_S = 1.0
"""Motors that stop end the control, too, which may show first. After longer, others have taken it over."""
_UNSEEN = "others may fly, as UAL has not seen for {:.1f} s what the autopilot does; the UAV is not landed any further"
_MOTORS_RUN = "it stands, and its motors do not stop: stop them by hand, or disarm it"


class LandOnSetpoints(Landing):
    """A landing by velocities. It ends when the motors have stopped or cannot be stopped, or when others fly."""

    def __init__(
        self,
        task: VehicleTask,
        disarm: Callable[[], Future[None]],
        reference: Reference,
        start: Snapshot,
        name: str = "land",
        on_height: OnHeight = ignore_height,
        *,
        has_safety_pilot: bool = True,
    ) -> None:
        """`disarm` stops the motors where the vehicle still follows UAL, and `reference` brings it to rest."""
        super().__init__(task, reference, start, name, on_height, has_safety_pilot=has_safety_pilot)
        self._landing_task = task
        self._disarm = disarm
        self._place: Vector3 | None = None
        """Position at which it descends; None until it has come to rest."""
        self._descent_m_s = SLOW_M_S
        self._ground_z_m = math.inf
        self._stepped_s = start.time_s
        self._stops_count = 0
        self._stopped_s = self._ours_s = -math.inf

    @override
    def fit(self, snapshot: Snapshot, limits: CurrentLimits, geofence: GeofencePolicy) -> Step | None:
        self._descent_m_s = limits.get().descent_speed_m_s
        self._ground_z_m = geofence.ground_z_m(snapshot)
        return None

    @property
    @override
    def _slowest_m_s(self) -> float:
        return min(SLOWEST_LANDING_M_S, self._descent_m_s / 2.0)

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        error = self._why_unseen(snapshot, estimate)
        self._stepped_s = snapshot.time_s
        if error is not None:
            return failed(error)
        assert snapshot.control.mode is not None
        if estimate.state is State.LANDED_DISARMED and not self._stops_count:  # not by UAL, on the ground
            return Step(has_ended=self._touch_down.has_landed(snapshot, estimate))
        if snapshot.control.armed is not None and not snapshot.control.armed.value:
            return Step(has_ended=True)
        if snapshot.control.is_on_ground:
            return self._step_on_ground(snapshot)
        if snapshot.control.mode.value.control is not Control.REFERENCES:
            return taken(snapshot, self.name)
        has_position = estimate.state is not State.UNINITIALIZED and _is_new(snapshot.motion.pose, snapshot)
        return self._step_in_air(snapshot, has_position=has_position)

    def _why_unseen(self, snapshot: Snapshot, estimate: Estimate) -> UalError | None:
        """Returns why the flight may have become another's unseen; None if it cannot."""
        if not estimate.is_link_up or snapshot.link.conflict:
            return why_blind(estimate, self.name)
        unseen_s = snapshot.time_s - min(
            self._stepped_s, -math.inf if snapshot.control.mode is None else snapshot.control.mode.time_s
        )
        if unseen_s <= UNSEEN_MARKER_S:
            return None
        why = _UNSEEN.format(unseen_s) if unseen_s < math.inf else f"the mode is not known: {estimate.why}"
        return TaskAbortedError(f"{self.name}: {why}; command land again", {"by": "silence"})

    # --- In the air ---------------------------------------------------------------------------------------------------

    def _step_in_air(self, snapshot: Snapshot, *, has_position: bool) -> Step:
        reference = self._reference
        if reference is not None and has_position and not self._is_at_rest(snapshot):
            return Step(reference.setpoint(snapshot) if _is_new_mode(snapshot) else None)
        self._reference = None
        if self._place is None and has_position:
            self._place = measured_motion(snapshot).position
        late = self._watch_descent(snapshot) if has_position else None
        if late is not None:
            return failed(late)
        self._note_lacking(snapshot, has_position=has_position)
        return self._down(snapshot, self._speed_m_s(snapshot, has_position), self._back(snapshot, has_position))

    def _is_at_rest(self, snapshot: Snapshot) -> bool:
        velocity = snapshot.motion.velocity
        if velocity is None or not _is_new(velocity, snapshot):
            return True  # it does not show whether it is
        is_slow = velocity.value.linear.horizontal_norm() < STILL_SPEED_M_S
        return is_slow or snapshot.time_s - self._begun_s > LONGEST_STOP_S

    def _speed_m_s(self, snapshot: Snapshot, has_position: bool) -> float:
        is_high = has_position and measured_motion(snapshot).position.z - self._ground_z_m > SLOW_DESCENT_HEIGHT_M
        return min(self._descent_m_s, FAST_M_S if is_high else SLOW_M_S)

    def _back(self, snapshot: Snapshot, has_position: bool) -> Vector3:
        """Returns the velocity back over the place; none where its position is not known."""
        if not has_position or self._place is None:
            return Vector3()
        back = (self._place - measured_motion(snapshot).position) * POSITION_PER_S
        return back * min(1.0, ASIDE_M_S / max(back.horizontal_norm(), 1e-9))

    def _note_lacking(self, snapshot: Snapshot, *, has_position: bool) -> None:
        """Tells what it descends without."""
        has_velocity = _is_new(snapshot.motion.velocity, snapshot)
        measured = {"a position": has_position, "a velocity": has_velocity}
        lacking = " and ".join(name for name, is_there in measured.items() if not is_there)
        if lacking:
            self._landing_task.note = f"it descends without {lacking}: take over where it drifts or stops"

    def _down(self, snapshot: Snapshot, speed_m_s: float, aside: Vector3 | None = None) -> Step:
        if not _is_new_mode(snapshot):
            return Step()
        aside = aside or Vector3()
        return Step(VelocitySetpoint(Vector3(aside.x, aside.y, -speed_m_s)))

    # --- On the ground ------------------------------------------------------------------------------------------------

    def _step_on_ground(self, snapshot: Snapshot) -> Step:
        """Stops the motors, again where that failed, but not those of others. Until then it presses on the ground."""
        assert snapshot.control.mode is not None
        now_s, is_ours = snapshot.time_s, snapshot.control.mode.value.control is Control.REFERENCES
        self._landing_task.note = ""
        if is_ours or not self._stops_count:
            self._ours_s = now_s
        elif now_s - self._ours_s > LOST_CONTROL_S:
            return taken(snapshot, self.name)
        if now_s - self._stopped_s > STOP_AGAIN_S and (is_ours or not self._stops_count):
            if self._stops_count >= MOST_STOPS:
                return failed(self._why_motors_run())
            self._stop_motors(now_s)
        return self._down(snapshot, min(self._descent_m_s, SLOW_M_S)) if is_ours else Step()

    def _stop_motors(self, now_s: float) -> None:
        if self.command is not None:
            self.command.withdraw()
        self._stops_count, self._stopped_s = self._stops_count + 1, now_s
        self.command = AutopilotCommand("stop its motors")
        self.command.send(self._disarm)

    def _why_motors_run(self) -> UalError:
        refusal = None if self.command is None else self.command.refusal()
        late = UalTimeoutError(f"{self.name}: {_MOTORS_RUN}")
        return late if refusal is None else with_advice(refusal, _MOTORS_RUN)

    @override
    def estimate_jumped(self, jump: EstimateJump, stop: Reference) -> UalError | None:
        if self._place is not None:
            self._place += jump.offset
        return super().estimate_jumped(jump, stop)


def _is_new(sample: Sample[object] | None, snapshot: Snapshot) -> bool:
    return sample is not None and snapshot.time_s - sample.time_s <= MEASUREMENT_AGE_LIMIT_S


def _is_new_mode(snapshot: Snapshot) -> bool:
    return snapshot.control.mode is not None and snapshot.time_s - snapshot.control.mode.time_s <= MODE_AGE_LIMIT_S
