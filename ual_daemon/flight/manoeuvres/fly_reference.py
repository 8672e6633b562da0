"""Flying a reference: a pose, a velocity, or a stop. It is sent until something else is flown."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from typing_extensions import override

from ual.errors import GeofenceError, UalError
from ual.geometry import Vector3
from ual.types import State
from ual_daemon import logs
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Control, Setpoint, Snapshot
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre, Step
from ual_daemon.flight.policy.authority import Authority
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.flight.state import Estimate
from ual_daemon.tracker.drift import DriftCorrection
from ual_daemon.tracker.limits import CurrentLimits, scaled_down
from ual_daemon.tracker.references import VELOCITY_TIMEOUT_S, Hold, Reference, Velocity, brake

_log = logging.getLogger(__name__)

HOLDS = "the UAV stops, and holds until it is commanded again"
_LONGEST_STAND_S = 5.0
"""Seconds of standing after which a reference holds for good: the reason to go on may come when nobody expects it any
more.
"""
_GOES_ON_S = 1.0
"""Seconds for which it must go on before that is reported: a goal at the edge of a fence may come and go."""


@dataclass(frozen=True, slots=True)
class ReferenceRules:
    """Rules for sending the references of one UAV, and their bounds. Only the update thread calls its methods."""

    backend: Backend
    limits: CurrentLimits
    geofence: GeofencePolicy
    authority: Authority
    drift: DriftCorrection
    is_in_control: Callable[[], bool]

    def may_send(self, snapshot: Snapshot, raw: Estimate, *, is_begun: bool) -> bool:
        """Returns whether a reference may be sent now, and lets the authority note what flies it.

        On the ground none begins. One that has begun goes on while the autopilot follows UAL: a descent that has
        touched down must not lose its stream before the autopilot disarms.
        """
        may_send = raw.state is State.FLYING_AUTO
        if not may_send and is_begun and raw.state is State.LANDED_ARMED:
            mode = snapshot.control.mode
            may_send = mode is not None and mode.value.control is Control.REFERENCES
        self.authority.observe(raw.state, snapshot, is_sending=may_send and is_begun)
        if may_send and self.is_in_control():
            return True
        self.drift.forget()
        return False

    def why_ended(self, velocity: Velocity, snapshot: Snapshot) -> str:
        """Returns why a velocity may not go on; empty while it may."""
        if snapshot.time_s > velocity.expires_s:
            return f"no new one within {VELOCITY_TIMEOUT_S:g} s"
        try:
            self.geofence.admit("velocity", velocity, self.limits.get(), snapshot)
        except UalError as error:  # it would leave the geofence, or it is not known any more where that lies
            return str(error)
        return ""


@dataclass(eq=False)
class FlyReference(Manoeuvre):
    """Sends a reference. No caller waits for its end, and a new command may always end it.

    A velocity that has ended is followed by a stop. Where the autopilot does not follow UAL, any reference ends. One
    that stands for long is followed by a hold.
    """

    is_awaited = False
    is_goal_moving = True
    why_not_pausable = "it is no task"

    name: str
    reference: Reference
    rules: ReferenceRules
    trouble: str = ""
    stands_since_s: float = math.inf
    """Since when it stands; infinite while it goes on."""
    stood_s: float = -math.inf
    """Time at which it stood last; infinitely long ago once it is reported that it goes on."""

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        rules, reference = self.rules, self.reference
        if not rules.may_send(snapshot, estimate, is_begun=True):
            return Step(has_ended=True)
        if isinstance(reference, Velocity):
            if why := rules.why_ended(reference, snapshot):
                logs.event(_log, logging.INFO, "velocity_ended", why=why)
                return Step(has_ended=True, next_reference=brake(snapshot, rules.limits.stop()))
            reference.correct_drift(snapshot, rules.limits.get(), rules.backend.info().velocity_responses)
        setpoint = reference.setpoint(snapshot)
        if reference.stop_reason is not None:
            return self._stands(reference.stop_reason, setpoint, snapshot.time_s)
        if self.stood_s != -math.inf:
            self._leads(snapshot.time_s)
        return Step(setpoint)

    def _stands(self, why: UalError, setpoint: Setpoint, now_s: float) -> Step:
        """Tells that the reference stands, once. Ends it where that has lasted."""
        if self.stood_s == -math.inf:
            logs.event(_log, logging.WARNING, "reference_stands", why=why, remedy="the UAV stops")
        self.trouble, self.stood_s = f"it does not follow: {why}", now_s
        self.stands_since_s = min(self.stands_since_s, now_s)
        if now_s - self.stands_since_s < _LONGEST_STAND_S:
            return Step(setpoint)
        logs.event(_log, logging.WARNING, "reference_ended", why=why, remedy=HOLDS)
        return Step(has_ended=True, error=why, is_to_stop=True)

    def _leads(self, now_s: float) -> None:
        """Takes note that the reference does not stand any more."""
        self.stands_since_s = math.inf
        if now_s - self.stood_s >= _GOES_ON_S:
            self.trouble, self.stood_s = "", -math.inf
            logs.event(_log, logging.INFO, "reference_goes_on")

    @override
    def fit(self, snapshot: Snapshot, limits: CurrentLimits, geofence: GeofencePolicy) -> Step | None:
        """A goal that moves looks at the world by itself each time it plans, and a stop is as good as it gets."""
        if isinstance(self.reference, Velocity):  # each update looks at the geofence
            self.reference.twist = scaled_down(self.reference.twist, limits.get())
        elif isinstance(self.reference, Hold):
            return self._fit_hold(self.reference, snapshot, limits, geofence)
        return None

    def _fit_hold(self, hold: Hold, snapshot: Snapshot, limits: CurrentLimits, geofence: GeofencePolicy) -> Step | None:
        try:
            geofence.admit("set_pose", hold, limits.get(), snapshot)
        except GeofenceError as error:
            logs.event(_log, logging.WARNING, "reference_ended", why=str(error), remedy=HOLDS)
            return Step(has_ended=True, error=error, is_to_stop=True)
        except UalError:  # it is not known where the geofence lies: nothing that is known speaks against it
            return None
        return None

    @override
    def current_reference(self) -> Reference:
        return self.reference

    @override
    def path_points(self, now_s: float) -> Sequence[Vector3]:
        return self.reference.path_points(now_s)

    @override
    def estimate_jumped(self, jump: EstimateJump, stop: Reference) -> UalError | None:
        return None if isinstance(self.reference, Velocity) else super().estimate_jumped(jump, stop)

    @override
    def end(self, error: UalError | None) -> None:
        """Does nothing: no caller waits for it."""
