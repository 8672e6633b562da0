"""Holding a UAV that does not follow where it is, wherever that is, and landing it on the spot where it has fallen."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass

from typing_extensions import override

from ual.errors import UalError
from ual.geometry import Pose, Quaternion, Vector3
from ual.types import State
from ual_daemon.backends.values import Control, PositionSetpoint, Setpoint, Snapshot, VelocitySetpoint
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.fly_reference import FlyReference
from ual_daemon.flight.manoeuvres.manoeuvre import Handover, Step
from ual_daemon.flight.manoeuvres.recover import Recover
from ual_daemon.flight.policy.following import Following
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.flight.state import Estimate
from ual_daemon.tracker.references import Reference, measured_motion
from ual_daemon.trajectory import Motion

_STILL_DISTANCE_M = 0.5
"""A UAV that stands still is held where it is while its estimate wanders by less."""
_RENEWAL_TIME_S = 0.1
"""Seconds of setpoints of another kind before a landing: several, as one may be lost or not due."""
_AT_REST = VelocitySetpoint(Vector3())


class Here(Reference):
    """The present pose, so that nothing draws the UAV back to where it was when it works again."""

    def __init__(self, snapshot: Snapshot, following: Following) -> None:
        self._following = following
        self._motion = _at_rest(snapshot)

    @override
    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        now = _at_rest(snapshot)
        if not self._following.is_still or (now.position - self._motion.position).norm() > _STILL_DISTANCE_M:
            self._motion = now
        return PositionSetpoint(self._motion.position, self._motion.yaw_rad)

    @override
    def motion(self, snapshot: Snapshot) -> Motion:
        return self._motion

    @override
    def pose(self) -> Pose | None:
        return Pose(self._motion.position, Quaternion.from_yaw(self._motion.yaw_rad))


def _at_rest(snapshot: Snapshot) -> Motion:
    measured = measured_motion(snapshot)
    return Motion(measured.position, measured.yaw_rad)


@dataclass(eq=False, kw_only=True)
class StandBy(FlyReference):
    """Sends the present pose until control is asked back, which then holds.

    Where the UAV has fallen, a landing follows: silence would lead PX4 to a return. An autopilot that keeps its own
    target would climb to it, up to 4 m, also in its landing, when the motors work again. So it is given setpoints of
    another kind at the impact, and again before the landing.
    """

    following: Following
    land: Callable[[Snapshot], Handover | None]
    """Makes the landing on the spot; None where there is none."""
    down_s: float = math.inf
    """Since when it lies; infinity while it is not known to."""

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        step = super().step(snapshot, estimate)
        if step.has_ended:
            return step
        following, keeps_target = self.following, self.rules.backend.info().keeps_target_of_a_kind
        if not following.why:  # it follows again, and holds like any other
            return Step(has_ended=True, is_to_stop=True)
        if not following.is_down:
            self.down_s = math.inf
            return Step(_AT_REST) if keeps_target and following.has_hit else step
        self.down_s = min(self.down_s, snapshot.time_s)
        if keeps_target and snapshot.time_s - self.down_s < _RENEWAL_TIME_S:
            return step if following.has_hit else Step(_AT_REST)
        landing = self.land(snapshot)
        return step if landing is None else Step(handover=landing)

    @override
    def fit(self, snapshot: Snapshot, limits: object, geofence: object) -> None:
        """Holds where it is, also beyond the geofence."""

    @override
    def estimate_jumped(self, jump: EstimateJump, stop: Reference) -> UalError | None:
        return None  # it sends the present pose, wherever that is


class TakeToStandBy(Recover):
    """Takes the control from a mode in which the autopilot flies by itself, so that `StandBy` follows.

    To land at once is the next best. PX4, whose landing has begun above, climbs back by up to 5 m when the motors work
    again: its own reference has stayed there.
    """

    is_replaceable = True
    why_not_pausable = "the UAV does not follow"

    def __init__(
        self,
        out_of: State,
        take_control: Callable[[], Future[None]],
        land: Callable[[Snapshot], Handover | None],
    ) -> None:
        """`land` makes the landing that follows where the control is not given; None where there is none."""
        command = AutopilotCommand("take our references")
        super().__init__(command, take_control, lambda _: None, name="stand_by", out_of=out_of)
        self._land = land

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        mode = snapshot.control.mode
        is_given = mode is not None and mode.value.control is Control.REFERENCES
        if is_given and estimate.state in (State.LANDING, State.TAKING_OFF):  # its landed state is from before
            return self._hold(snapshot)
        step = super().step(snapshot, estimate)
        is_seen = estimate.is_link_up and estimate.state in (self._out_of, State.FLYING_MANUAL, State.LANDING)
        if step.error is None or step.is_taken or not is_seen or self.is_overtaken(snapshot):
            return step
        landing = self._land(snapshot)
        return step if landing is None else Step(handover=landing)
