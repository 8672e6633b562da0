"""One light vehicle without the layers above, its time in the test's hand."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ual.geometry import Pose, Twist, Vector3
from ual.types import Limits
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend, World
from ual_daemon.backends.light.physics import SIM_STEP_S, FlightMode
from ual_daemon.backends.values import LandedState, PositionSetpoint, Setpoint, VelocitySetpoint


class Drone:
    """A light backend, opened (and closed at the end of the test), and the truth behind what it says."""

    opened: ClassVar[list[Drone]] = []

    def __init__(self, world: World | None = None, ns: str = "uav_1", **settings: object) -> None:
        self.world = world or World(speed_factor=0.0)
        self.backend = LightBackend(BackendOptions(ns, settings=settings), self.world)
        self.row = self.world.fleet.count - 1
        self.snapshots = [self.backend.snapshot()]
        self.backend.open(self.snapshots.append)
        self.sim = self.backend.simulation()
        Drone.opened.append(self)

    def run(self, duration_s: float, setpoint: Setpoint | None = None) -> None:
        """Lets time pass; the setpoint, if there is one, is sent at each step."""
        for _ in range(round(duration_s / SIM_STEP_S)):
            if setpoint is not None:
                self.backend.send(setpoint)
            self.world.step(SIM_STEP_S)

    def run_until(self, landed: LandedState, limit_s: float = 60.0) -> float:
        """Lets time pass until it says so; how long that took."""
        begin_s = self.world.now_s()
        while self.landed() is not landed:
            assert self.world.now_s() - begin_s < limit_s
            self.run(SIM_STEP_S)
        return self.world.now_s() - begin_s

    def fly(self, height_m: float = 5.0) -> None:
        """Into the air, at rest, following setpoints."""
        self.sim.pilot_arm()
        self.backend.take_off(height_m, Limits()).result(timeout=0)
        place = self.true("position")
        top = PositionSetpoint(Vector3(place[0], place[1], place[2] + height_m), float(self.true("yaw")))
        self.run(height_m / 1.0 + 4.0, top)

    def true(self, name: str) -> Any:
        """Returns the true value, as nobody but the world knows it."""
        value = getattr(self.world.fleet, name)[self.row]
        return np.array(value) if np.ndim(value) else value

    def mode(self) -> FlightMode:
        return FlightMode(int(self.true("mode")))

    def landed(self) -> LandedState:
        landed = self.backend.snapshot().control.landed
        assert landed is not None
        return landed.value

    @property
    def armed(self) -> bool:
        armed = self.backend.snapshot().control.armed
        assert armed is not None
        return armed.value

    @property
    def pose(self) -> Pose:
        pose = self.backend.snapshot().motion.pose
        assert pose is not None
        return pose.value

    @property
    def twist(self) -> Twist:
        velocity = self.backend.snapshot().motion.velocity
        assert velocity is not None
        return velocity.value


def velocity(x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw_rate_rad_s: float = 0.0) -> VelocitySetpoint:
    return VelocitySetpoint(Vector3(x, y, z), yaw_rate_rad_s)


def hold(x: float, y: float, z: float, yaw_rad: float = 0.0) -> PositionSetpoint:
    return PositionSetpoint(Vector3(x, y, z), yaw_rad)
