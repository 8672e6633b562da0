"""Two multirotors on one clock, as PX4 and ArduCopter fly them, with estimates that err; and what flies them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import Limits
from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.firmwares.feed_forward import GRAVITY_M_S2, FeedForward
from ual_daemon.backends.firmwares.px4 import Px4
from ual_daemon.backends.values import MotionState, PositionSetpoint, Sample, Setpoint, Snapshot, VelocityResponses
from ual_daemon.flight.stopping import motion_if_near
from ual_daemon.tracker.drift import DriftCorrection
from ual_daemon.tracker.references import Reference, Velocity


def at_most(vector: Vector3, length: float) -> Vector3:
    """The vector, or one of this length in its direction."""
    own = vector.norm()
    return vector if own <= length else vector * (length / own)


STEP_S = 0.02
"""The daemon steps as often."""
_MEASURED_EVERY = 2
"""Positions come at 25 Hz ..."""
_MEASURED_AFTER = 2
"""... and 0.04 s late."""
_SENT_AFTER = 1
_TILT_S = 0.15
_MOST_M_S2 = 9.0
PX4 = Px4().velocity_responses({"MPC_XY_VEL_P_ACC": 1.8, "MPC_XY_VEL_D_ACC": 0.2, "MPC_Z_VEL_P_ACC": 4.0})
ARDUPILOT = ArduCopter().velocity_responses(
    {"WPNAV_ACCEL": 250.0, "PSC_JERK_XY": 5.0, "WPNAV_ACCEL_Z": 100.0, "PSC_JERK_Z": 5.0}
)
LIMITS = Limits(10.0, 3.0, 1.5, 1.5, 1.0, 1.0)

ErrorAt = Callable[[float], Vector3]


def no_error(time_s: float) -> Vector3:
    del time_s
    return Vector3()


@dataclass
class Craft:
    """One multirotor. An error is its estimate minus the truth. `push` is what the wind accelerates it by."""

    responses: VelocityResponses
    velocity_error: ErrorAt = no_error
    position_error: ErrorAt = no_error
    push: ErrorAt = no_error
    drag_1_s: float = 0.0
    is_drag_known: bool = True
    position: Vector3 = field(default_factory=Vector3)
    velocity: Vector3 = field(default_factory=Vector3)
    acceleration: Vector3 = field(default_factory=Vector3)
    is_stuck: bool = False
    now_s: float = 0.0

    def __post_init__(self) -> None:
        self._count = 0
        self._measured: deque[tuple[Pose, Vector3]] = deque(maxlen=_MEASURED_AFTER + 1)
        self._sent: deque[Setpoint] = deque(maxlen=_SENT_AFTER + 1)
        self._integral = Vector3()
        self._aim: tuple[Vector3, Vector3, Vector3] | None = None
        self._newest = Sample(Pose.at(0.0, 0.0, 0.0), 0.0), Sample(Twist(), 0.0)
        self._feed_forward = FeedForward(self.drag_1_s if self.is_drag_known else 0.0)
        self._measure()

    @property
    def estimate(self) -> Vector3:
        """Estimated position."""
        return self.position + self.position_error(self.now_s)

    @property
    def estimated_velocity(self) -> Vector3:
        return self.velocity + self.velocity_error(self.now_s)

    def snapshot(self) -> Snapshot:
        pose, velocity = self._newest
        return Snapshot(self.now_s, updated_s=self.now_s, motion=MotionState(pose=pose, velocity=velocity))

    def step(self, setpoint: Setpoint) -> None:
        """Lets a fiftieth of a second pass."""
        if self.responses is PX4:
            setpoint = self._feed_forward.apply(setpoint, self.now_s)
        self._sent.append(setpoint)
        old = self._sent[0]
        wanted = self._px4(old) if self.responses is PX4 else self._ardupilot(old)
        level = at_most(Vector3(wanted.x, wanted.y, 0.0), _MOST_M_S2)
        wanted = Vector3(level.x, level.y, max(-5.0, min(5.0, wanted.z)))
        self.acceleration += (wanted - self.acceleration) * (STEP_S / _TILT_S)
        drag = Vector3(self.velocity.x, self.velocity.y, 0.0) * self.drag_1_s
        self.velocity += (self.acceleration - drag + self.push(self.now_s)) * STEP_S
        if self.is_stuck:
            self.velocity = Vector3()
        self.position += self.velocity * STEP_S
        self.now_s += STEP_S
        self._count += 1
        self._measure()

    def _measure(self) -> None:
        self._measured.append((Pose(self.estimate, _tilted(self.acceleration)), self.estimated_velocity))
        if self._count % _MEASURED_EVERY == 0:
            pose, velocity = self._measured[0]
            self._newest = Sample(pose, self.now_s), Sample(Twist(velocity), self.now_s)
            self._feed_forward.learn(self.now_s, pose, velocity)

    def _px4(self, setpoint: Setpoint) -> Vector3:
        """PositionControl.cpp: P 1.8, I 0.4 and D 0.2 horizontally; P 4 and I 2 vertically."""
        error = self._wanted_velocity(setpoint) - self.estimated_velocity
        self._integral += Vector3(error.x * 0.4, error.y * 0.4, error.z * 2.0) * STEP_S
        damped = Vector3(self.acceleration.x, self.acceleration.y, 0.0) * 0.2
        return (
            (setpoint.acceleration or Vector3())
            + Vector3(error.x * 1.8, error.y * 1.8, error.z * 4.0)
            + self._integral
            - damped
        )

    def _wanted_velocity(self, setpoint: Setpoint) -> Vector3:
        if isinstance(setpoint, PositionSetpoint):
            return setpoint.velocity + (setpoint.position - self.estimate) * 0.95
        return setpoint.velocity

    def _ardupilot(self, setpoint: Setpoint) -> Vector3:
        """Shapes what comes (AP_Math/control.cpp) to an aim that moves, and flies to that."""
        position, velocity, acceleration = self._aim or (self.estimate, self.estimated_velocity, Vector3())
        led = setpoint.velocity
        if isinstance(setpoint, PositionSetpoint):
            led += setpoint.acceleration * self.responses.horizontal.time_s + (setpoint.position - position)
        wanted = at_most((led - velocity) / self.responses.horizontal.time_s, 2.5)
        acceleration += at_most(wanted - acceleration, 5.0 * STEP_S)
        velocity += acceleration * STEP_S
        position += velocity * STEP_S
        self._aim = position, velocity, acceleration
        flown = velocity + (position - self.estimate)
        self._integral += (flown - self.estimated_velocity) * STEP_S
        return acceleration + (flown - self.estimated_velocity) * 2.0 + self._integral


def _tilted(acceleration: Vector3) -> Quaternion:
    """Returns the attitude of this acceleration, with the nose to the east."""
    up = Vector3(acceleration.x, acceleration.y, acceleration.z + GRAVITY_M_S2)
    up = up / up.norm()
    half = math.sqrt((1.0 + up.z) / 2.0)
    return Quaternion(-up.y / (2.0 * half), up.x / (2.0 * half), 0.0, half)


class FlightTrace:
    """Flight of a craft: references as the flight steps them, one after the other."""

    def __init__(self, craft: Craft) -> None:
        self.craft = craft
        self.drift = DriftCorrection()
        self._is_led = False
        self.changes_m_s2: list[float] = []
        """Speed of changes of the correction, at each update of the last `fly`."""

    def velocity(self, velocity: Vector3) -> Velocity:
        return Velocity(Twist(velocity), self.drift, in_body=False, expires_s=math.inf)

    def fly(self, reference: Reference, duration_s: float) -> list[Vector3]:
        """Returns where it took itself to be, at each step."""
        places, self.changes_m_s2 = [], []
        for _ in range(round(duration_s / STEP_S)):
            self.craft.step(self._update(reference))
            places.append(self.craft.estimate)
        return places

    def _update(self, reference: Reference) -> Setpoint:
        snapshot = self.craft.snapshot()
        if isinstance(reference, Velocity):
            before = self.drift.velocity
            reference.correct_drift(snapshot, LIMITS, self.craft.responses)
            if self._is_led:
                self.changes_m_s2.append((self.drift.velocity - before).horizontal_norm() / STEP_S)
            self._is_led = True
        else:
            self._is_led = False
            self.drift.stand_by(lambda seen: motion_if_near(reference, seen), snapshot)
        return reference.setpoint(snapshot)
