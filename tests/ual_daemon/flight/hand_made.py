"""An autopilot whose data a test sets by hand, to show what the light simulation cannot."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import dataclass

from ual.errors import UalError
from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import TaskKind
from ual_daemon.backends.values import (
    Cause,
    Condition,
    Control,
    ControlState,
    Estimator,
    Freshness,
    LandedState,
    Mode,
    MotionState,
    Sample,
    Snapshot,
)
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre, Step
from ual_daemon.flight.state import estimate
from ual_daemon.flight.tasks import VehicleTask

STEP_S = 0.1
HEIGHT_M = 4.0


@dataclass
class Autopilot:
    """An autopilot: a test sets what it reports."""

    time_s: float = 0.0
    z: float = 0.2  # an estimate on the ground is not exactly 0
    climb_m_s: float = 0.0
    drift_m_s: float = 0.0
    armed: bool = True
    control: Control = Control.OTHER
    landed: LandedState = LandedState.ON_GROUND
    silent_s: float = 0.0
    yaw_rad: float = 0.5
    status_text: str = ""
    mode: str = ""
    held_by: Cause | None = None
    failsafe: Cause | None = None

    def now_s(self) -> float:
        return self.time_s

    def snapshot(self) -> Snapshot:
        heard_s = self.time_s - self.silent_s
        return Snapshot(
            time_s=self.time_s,
            heard_s=heard_s,
            control=ControlState(
                armed=Sample(self.armed, heard_s),
                landed=Sample(self.landed, heard_s),
                mode=Sample(Mode(self.mode or self.control.name, self.control), heard_s),
                failsafe=self.failsafe,
                held_by=self.held_by,
            ),
            motion=MotionState(
                estimator=Sample(Estimator(True), heard_s),
                pose=Sample(Pose(Vector3(1.0, 2.0, self.z), Quaternion.from_yaw(self.yaw_rad)), heard_s),
                velocity=Sample(Twist(Vector3(self.drift_m_s, 0.0, self.climb_m_s)), heard_s),
            ),
            condition=Condition(status_text=self.status_text),
        )

    def step(self, manoeuvre: Manoeuvre) -> Step:
        self.time_s += STEP_S
        self.z += self.climb_m_s * STEP_S
        snapshot = self.snapshot()
        return manoeuvre.step(snapshot, estimate(snapshot, Freshness()))

    def until_end(self, manoeuvre: Manoeuvre, limit_s: float = 300.0) -> UalError | None:
        for _ in range(round(limit_s / STEP_S)):
            step = self.step(manoeuvre)
            if step.has_ended:
                return step.error
        raise AssertionError("it does not end")

    def task(self, kind: TaskKind) -> VehicleTask:
        return VehicleTask(kind, "", self)


def sent(ack: Future[None], autopilot: Autopilot) -> AutopilotCommand:
    command = AutopilotCommand("do it")
    command.send(lambda: ack)
    command.waited_s(autopilot.snapshot())  # the update in which it was sent
    return command
