"""Data of one update of the replay: the autopilot's data, and what the daemon reported then."""

from __future__ import annotations

from typing import NamedTuple

from ual.types import State, TaskKind, Telemetry
from ual_daemon.backends.values import (
    Condition,
    Control,
    ControlState,
    Estimator,
    Freshness,
    Mode,
    MotionState,
    Sample,
    Snapshot,
)
from ual_daemon.flight.state import Estimate, estimate


class ReplayMoment(NamedTuple):
    """One update of a recorded flight.

    `telemetry` is the sample that was recorded at this update; None without one. If it `is_whole`, all is reported
    as it was. Else the data are decoded again. Only what the autopilot did not say is then taken from the sample: the
    manoeuvre that was in progress, its task, and the reference.
    """

    snapshot: Snapshot
    telemetry: Telemetry | None = None
    is_whole: bool = False

    def estimate(self, snapshot: Snapshot, freshness: Freshness) -> Estimate:
        """Estimates the state; `snapshot` has the data at the time for which that is asked."""
        telemetry = self.telemetry
        if telemetry is None:
            return estimate(snapshot, freshness)
        if self.is_whole:
            return Estimate(
                telemetry.state, telemetry.state_reason, is_link_up=telemetry.state is not State.UNINITIALIZED
            )
        return estimate(snapshot, freshness, _manoeuvre(telemetry))


def decoded(snapshot: Snapshot, telemetry: Telemetry) -> ReplayMoment:
    """Returns data that were decoded again, with what the autopilot did not say."""
    is_ours = telemetry.health is None or not telemetry.health.held_by  # a mode that UAL commanded is held by nobody
    return ReplayMoment(
        snapshot._replace(control=snapshot.control._replace(held_by=None)) if is_ours else snapshot, telemetry
    )


def reported(telemetry: Telemetry, time_s: float) -> ReplayMoment:
    """Returns a sample of a flight without packets, at a time of the player's clock.

    Only what the autopilot had said is in the data, for what is computed from them, such as transforms.
    """
    body = telemetry.odometry
    is_known = telemetry.state is not State.UNINITIALIZED
    snapshot = Snapshot(
        time_s=time_s,
        heard_s=time_s,
        control=ControlState(
            armed=Sample(telemetry.armed, time_s), mode=Sample(Mode(telemetry.flight_mode, Control.OTHER), time_s)
        ),
        motion=MotionState(
            stamp_s=telemetry.stamp_s,
            estimator=Sample(Estimator(is_good=is_known, why=telemetry.state_reason), time_s),
            pose=None if body is None else Sample(body.pose, time_s),
            velocity=None if telemetry.velocity is None else Sample(telemetry.velocity, time_s),
            position_geo=telemetry.position_geo,
        ),
        condition=Condition(
            telemetry.battery, telemetry.gps, telemetry.status_text, telemetry.health, batteries=telemetry.batteries
        ),
    )
    return ReplayMoment(snapshot, telemetry, is_whole=True)


def _manoeuvre(telemetry: Telemetry) -> State | None:
    """Returns TAKING_OFF or LANDING while a take-off or landing of UAL was in progress; else None."""
    task = telemetry.task
    if task is None:
        return None
    if task.kind is TaskKind.TAKE_OFF:
        return State.TAKING_OFF
    lands = task.kind is TaskKind.LAND or (task.kind is TaskKind.RETURN_TO_LAUNCH and telemetry.state is State.LANDING)
    return State.LANDING if lands else None
