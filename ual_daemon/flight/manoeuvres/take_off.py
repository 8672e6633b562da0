"""Take-off: straight up, to a height above the ground on which the UAV stands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

from typing_extensions import override

from ual.errors import GeofenceError, TaskAbortedError, UalError, UalTimeoutError
from ual.geometry import Vector3
from ual.types import Limits, State
from ual_daemon.backends.values import Control, LandedState, Setpoint, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.arrival import Dwell
from ual_daemon.flight.manoeuvres.manoeuvre import (
    TIMEOUT_FACTOR,
    TIMEOUT_MARGIN_S,
    Manoeuvre,
    Step,
    failed,
    taken,
    why_blind,
    with_advice,
)
from ual_daemon.flight.manoeuvres.progress_watch import STUCK_TIME_S, ProgressWatch
from ual_daemon.flight.policy.following import Trouble
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import Progress, VehicleTask
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.tracker.references import Hold, Reference, TrajectoryReference, measured_motion
from ual_daemon.trajectory import Motion, StraightTrajectory

_LOST_ACK_S = 1.0
_MODE_NEWS_S = 1.5
"""Seconds for which the mode may be missing from a UAV that has left the ground on our command. PX4 tells it twice a
second.
"""
_HEIGHT_TOLERANCE_RATIO = 0.05
_LEAST_HEIGHT_TOLERANCE_M = 0.1
_HIGHEST_SHARE, _HIGHEST_MARGIN_M = 1.2, 1.0
"""A climb is stopped above this many times the height asked for, plus the margin. An autopilot that climbs by itself
may count heights from elsewhere; the estimate of the ground wanders by 0.7 m."""
_LEFT_GROUND_M = 1.0
"""The estimate of a UAV that stands wanders by less."""
_NEAR_GROUND_M = 2.0
"""Height in metres below which a climb that makes no way ends in a landing: one that stood was at 0.96 m by PX4."""
_LIFT_OFF_S = 6.0
"""Seconds that an autopilot may take to begin its climb. On the ground the estimate wanders by 0.3 m at a time, which a
watch of the distance alone takes for progress.
"""
_REFUSED = "the UAV stays on the ground: disarm it, or remove what the autopilot complains of and take off again"
_STUCK = (
    "let its safety pilot disarm it if it stands on the ground, or take over and land it if it flies, and look at its "
    "propellers, its load and its battery"
)
_STUCK_WITHOUT_PILOT = (
    "abort ends the take-off; disarm the UAV if it stands on the ground, or land it if it flies, and look at its "
    "propellers, its load and its battery"
)


class TakeOffManoeuvre(Manoeuvre):
    """A climb, straight up, to a height above where the UAV stands."""

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
        has_safety_pilot: bool = True,
    ) -> None:
        """`on_setpoints` says whether the autopilot climbs by setpoints (PX4 in OFFBOARD), or by itself."""
        super().__init__("take_off", task)
        self._task = task
        self._command = self.command = command
        self._height_m = height_m
        self._limits = limits
        self._on_setpoints = on_setpoints
        self._slow_m_s = tolerance.speed_m_s
        self._dwell = Dwell(tolerance.dwell_s)
        motion = measured_motion(start)
        self._ground_z = motion.position.z
        self._ground = Hold(motion.position, motion.yaw_rad)
        self._top = Hold(motion.position + Vector3(0.0, 0.0, height_m), motion.yaw_rad)
        self._tolerance_m = max(_LEAST_HEIGHT_TOLERANCE_M, _HEIGHT_TOLERANCE_RATIO * height_m)
        self._highest_m = _HIGHEST_SHARE * height_m + _HIGHEST_MARGIN_M
        self._climb: TrajectoryReference | None = None
        self._stuck = _STUCK if has_safety_pilot else _STUCK_WITHOUT_PILOT
        self._climb_watch = ProgressWatch(task, self._stuck, is_up=True, slowest_m_s=limits.climb_speed_m_s)
        self._has_jumped = False
        # An autopilot that is in OFFBOARD already may first leave it by itself, because it got no setpoints until now.
        self._is_mode_left_over = on_setpoints and _is_ours(start)
        self._was_ours = False
        # A mode from before the arming says nothing: to arm, the autopilot may have been made to leave it.
        self._modes_since_s = -math.inf if start.control.armed is None else start.control.armed.time_s
        self._began_in = self._other_mode(start)
        self._climbing_since_s: float | None = None
        self._air_since_s = math.inf
        """Since when it is in the air, in a mode that is not ours as far as it was reported."""
        self._longest_s = _longest_s(height_m, limits)
        self._has_lifted_off = False

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_blind(estimate, self.name)
        if lost is not None:
            return failed(lost if self._climbing_since_s is not None else self._command.left_behind(lost))
        if estimate.state is State.LANDED_DISARMED:
            return failed(self._disarmed(snapshot))
        if self._climbing_since_s is None:
            if not self._has_begun(snapshot):
                return self._wait_on_ground(snapshot, estimate)
            self._climbing_since_s = snapshot.time_s
        return self._step_climb(snapshot, estimate, self._climbing_since_s)

    def _disarmed(self, snapshot: Snapshot) -> UalError:
        height_m = measured_motion(snapshot).position.z - self._ground_z
        if self._climbing_since_s is not None and height_m > _LEFT_GROUND_M:
            in_air = f"take_off: the motors were disarmed in the air, {height_m:.1f} m above the ground"
            return TaskAbortedError(in_air, {"by": Trouble.DISARMED.value})
        return TaskAbortedError(
            "take_off: the motors were disarmed (after a landing the autopilot does that by itself): arm again",
            {"by": "autopilot"},
        )

    def _wait_on_ground(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        """Makes one update before the autopilot has begun the take-off."""
        if self._is_taken_over(snapshot, estimate):
            return taken(snapshot, self.name)
        failure = self._command.failure(snapshot)
        if failure is not None:
            return failed(with_advice(failure, _REFUSED))
        return Step(self._ground.setpoint(snapshot) if self._on_setpoints else None)

    def _is_taken_over(self, snapshot: Snapshot, estimate: Estimate) -> bool:
        """Returns whether others took over before the climb began: the UAV flies, or another mode than at the start was
        chosen.

        The command must not be repeated then. A repeated OFFBOARD would take control from the safety pilot, and an
        autopilot that climbs by itself may do so in other modes, too (ArduPilot in LOITER).
        """
        is_ours = _is_ours(snapshot)
        is_taken_over = (self._was_ours and not is_ours) or self._is_controlled_by_others(snapshot, estimate)
        self._is_mode_left_over = self._is_mode_left_over and is_ours
        self._was_ours = is_ours and not self._is_mode_left_over
        other = self._other_mode(snapshot)
        self._began_in = self._began_in or other
        return is_taken_over or other not in ("", self._began_in)

    def _is_controlled_by_others(self, snapshot: Snapshot, estimate: Estimate) -> bool:
        """Returns whether it flies in a mode that is not ours.

        On a bad link it may be received to have left the ground before its new mode is. A mode from before that says
        nothing where no pilot can lift off in it.
        """
        if estimate.state is not State.FLYING_MANUAL:
            return False
        self._air_since_s = min(self._air_since_s, snapshot.time_s)
        mode = snapshot.control.mode
        may_be_ours = self._on_setpoints and mode is not None and mode.value.is_autonomous
        is_old = mode is not None and mode.time_s < self._air_since_s
        return not (may_be_ours and is_old and snapshot.time_s - self._air_since_s <= _MODE_NEWS_S)

    def _other_mode(self, snapshot: Snapshot) -> str:
        """Returns the mode, as far as it was received since the arming and is not ours; empty otherwise."""
        mode = snapshot.control.mode
        if mode is None or mode.time_s < self._modes_since_s or _is_ours(snapshot):
            return ""
        return mode.value.name

    def _has_begun(self, snapshot: Snapshot) -> bool:
        """Returns whether the autopilot is in the right mode and has accepted the command, or its acknowledgement was
        lost.
        """
        if not _is_ours(snapshot):
            return False
        is_ack_lost = not self._command.is_answered and self._command.waited_s(snapshot) > _LOST_ACK_S
        return self._command.is_accepted or is_ack_lost

    def _step_climb(self, snapshot: Snapshot, estimate: Estimate, since_s: float) -> Step:
        """Makes one update after the autopilot has begun the take-off."""
        assert snapshot.control.mode is not None
        ours = (Control.REFERENCES,) if self._on_setpoints else (Control.REFERENCES, Control.TAKE_OFF)
        if snapshot.control.mode.value.control not in ours:
            return taken(snapshot, self.name)
        refusal = self._command.refusal()  # a refusal may come late over a bad link
        if refusal is not None and estimate.state is State.LANDED_ARMED:
            return failed(with_advice(refusal, _REFUSED))
        motion = measured_motion(snapshot)
        climbed_m = motion.position.z - self._ground_z
        if climbed_m > self._highest_m:
            return self._stopped(climbed_m)
        setpoint = self._climb_setpoint(snapshot, motion) if self._takes_references(snapshot, estimate) else None
        progress = max(0.0, min(1.0, climbed_m / self._height_m))
        self._task.report(partial(Progress, progress, max(0.0, self._height_m - climbed_m)))
        is_there = self._height_m - climbed_m <= self._tolerance_m
        self._climb_watch.observe(motion.position.z, snapshot.time_s, is_there=is_there)
        passed_s = snapshot.time_s - since_s
        has_lifted_off = is_there or climbed_m >= min(_LEFT_GROUND_M, self._height_m / 2.0)
        self._has_lifted_off = self._has_lifted_off or has_lifted_off
        if self._climb_watch.text:
            return self._end_of_stuck_climb(climbed_m, self._climb_watch.text)
        patience_s = max(STUCK_TIME_S, _LIFT_OFF_S + _LEFT_GROUND_M / self._limits.climb_speed_m_s)
        if not self._has_lifted_off and passed_s > patience_s:
            return self._end_of_stuck_climb(climbed_m, f"it has not lifted off for {passed_s:.0f} s: {self._stuck}")
        if self._has_arrived(snapshot.time_s, climbed_m, motion.velocity.norm(), estimate):
            return Step(setpoint, has_ended=True, next_reference=self._top)
        if passed_s > self._longest_s:
            return failed(
                UalTimeoutError(
                    f"take_off: at {climbed_m:.2f} m after {self._longest_s:.0f} s, not at {self._height_m:g} m; "
                    f"{self._stuck}"
                )
            )
        return Step(setpoint)

    def _stopped(self, climbed_m: float) -> Step:
        """Returns the step that ends a climb that went too high, whatever the autopilot counts its height from."""
        error = TaskAbortedError(
            f"take_off: stopped at {climbed_m:.1f} m above the ground of the take-off, as {self._height_m:g} m were "
            "asked for; the autopilot is to hold its position by itself now; recover_from_manual takes control back",
            {"by": "height", "height_m": f"{climbed_m:.1f}"},
        )
        return Step(has_ended=True, error=error, is_autopilot_to_hold=True)

    def _end_of_stuck_climb(self, climbed_m: float, why: str) -> Step:
        """Returns the step that ends a climb that makes no way: it must not begin later, when nobody expects it.

        A PX4 that was to hold on the ground rose by 0.85 m as its thrust came back.
        """
        is_low = climbed_m < _NEAR_GROUND_M
        does = "land on the spot" if is_low else "hold by itself"
        error = UalTimeoutError(
            f"take_off: at {climbed_m:.2f} m, not at {self._height_m:g} m: {why}; the autopilot is to {does} now",
            {"by": "no way"},
        )
        return Step(has_ended=True, error=error, is_autopilot_to_hold=True, is_autopilot_to_land=is_low)

    def _has_arrived(self, now_s: float, climbed_m: float, speed_m_s: float, estimate: Estimate) -> bool:
        """Returns whether the UAV has been at the height, and slow, for the dwell time, and the climb is over."""
        is_up = abs(climbed_m - self._height_m) <= self._tolerance_m and speed_m_s <= self._slow_m_s
        return self._dwell.has_held(now_s, holds=is_up and self._has_climbed(estimate))

    def _has_climbed(self, estimate: Estimate) -> bool:
        """Returns whether the climb is over.

        The height alone does not show it: a UAV on the ground is within the tolerance of a low take-off. An autopilot
        that climbs by itself says when it is up.
        """
        if estimate.state is State.LANDED_ARMED:
            return False
        if self._on_setpoints:
            return self._climb is not None and self._climb.is_finished
        return estimate.state is not State.TAKING_OFF

    @override
    def fit(self, snapshot: Snapshot, limits: CurrentLimits, geofence: GeofencePolicy) -> Step | None:
        new = limits.get()
        if new != self._limits:
            self._limits = new
            self._longest_s = max(self._longest_s, _longest_s(self._height_m, new))
            self._climb_watch.expect(new.climb_speed_m_s)
            if self._climb is not None:
                self._climb = self._climb_from(self._climb.motion(snapshot), snapshot)
        # The clearance over the floor is for those that fly: a take-off may end lower.
        top = self._top.position
        highest = Vector3(top.x, top.y, max(top.z, self._ground_z + geofence.clearance_m))
        try:
            geofence.require_goal_inside(highest, self.name, snapshot)
        except GeofenceError as error:
            text = f"{error.message}; this has changed in flight: the UAV stops and holds"
            is_ours = self._on_setpoints or self._climb is not None
            changed = GeofenceError(text, error.metadata)
            return Step(has_ended=True, error=changed, is_to_stop=is_ours, is_autopilot_to_hold=not is_ours)
        except UalError:  # it is not known where the geofence lies
            return None
        return None

    def _takes_references(self, snapshot: Snapshot, estimate: Estimate) -> bool:
        """Returns whether the autopilot takes references now.

        One that climbs by itself takes none before it says that it is up. It then gets references to the commanded
        height, because it may count heights from elsewhere (home, the ground below its rangefinder).
        """
        is_in_air = snapshot.control.landed is not None and snapshot.control.landed.value is LandedState.IN_AIR
        return self._on_setpoints or (is_in_air and estimate.state is State.FLYING_AUTO)

    def _climb_setpoint(self, snapshot: Snapshot, measured: Motion) -> Setpoint:
        if self._climb is None:
            is_on_ground = self._on_setpoints and not self._has_jumped
            self._climb = self._climb_from(self._ground.motion(snapshot) if is_on_ground else measured, snapshot)
        return self._climb.setpoint(snapshot)

    def _climb_from(self, start: Motion, snapshot: Snapshot) -> TrajectoryReference:
        top = self._top.motion(snapshot)
        return TrajectoryReference(StraightTrajectory(start, top.position, top.yaw_rad, self._limits), snapshot.time_s)

    @override
    def estimate_jumped(self, jump: EstimateJump, stop: Reference) -> UalError | None:
        """Goes on to the same height above the ground, from where it is, and with the heading that it has."""
        self._ground_z += jump.offset.z
        self._climb_watch.moved(jump.offset.z)
        self._ground, self._top = (each.moved(jump.offset, jump.yaw_rad) for each in (self._ground, self._top))
        self._has_jumped, self._climb = self._has_jumped or self._climb is not None, None
        return None

    @override
    def path_points(self, now_s: float) -> Sequence[Vector3]:
        return self._ground.position, self._top.position

    @override
    def current_reference(self) -> Reference | None:
        return self._climb or self._ground


def _longest_s(height_m: float, limits: Limits) -> float:
    """Returns how long a climb may take."""
    return height_m / limits.climb_speed_m_s * TIMEOUT_FACTOR + TIMEOUT_MARGIN_S


def _is_ours(snapshot: Snapshot) -> bool:
    """Returns whether the autopilot is in a mode in which it climbs by a take-off of ours."""
    return snapshot.control.mode is not None and snapshot.control.mode.value.control in (
        Control.REFERENCES,
        Control.TAKE_OFF,
    )
