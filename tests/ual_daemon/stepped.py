"""A light UAV whose time stands still until a test steps it: every run is the same."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any

from ual.geometry import Pose, PoseStamped
from ual.interface import TaskCommands
from ual.types import State, TaskRequest, Telemetry
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend
from ual_daemon.flight.policy.lease import NOBODY
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.settings import VehicleSettings
from ual_daemon.vehicle.prepared import Prepared
from ual_daemon.vehicle.vehicle import Vehicle

STEP_S = 0.02


class Prepare(TaskCommands[Prepared[VehicleTask]]):
    """The tasks of a vehicle, planned but not begun."""

    def __init__(self, vehicle: Vehicle, lease_id: str = NOBODY) -> None:
        """`lease_id` is the lease by which they are commanded."""
        self._vehicle = vehicle
        self._lease_id = lease_id

    def _begin(self, request: TaskRequest, blocking: bool, timeout_s: float | None) -> Prepared[VehicleTask]:
        return self._vehicle.commands.prepare(request, self._lease_id)


class Stepped:
    """A vehicle whose time a test steps, and its samples."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.prepare = Prepare(vehicle)
        self.sim = vehicle.simulation()
        self.samples: list[Telemetry] = []
        # What no test reads is not made: a place on Earth is a tenth of the work of a step.
        self.unsubscribe = vehicle.subscribe(self.samples.append, reads_all=False)

    def by(self, lease_id: str) -> Prepare:
        """The tasks, commanded by a lease."""
        return Prepare(self.vehicle, lease_id)

    def run(self, duration_s: float) -> None:
        """Lets time pass."""
        self.sim.step(duration_s)

    def until(self, condition: Callable[[], bool], limit_s: float = 120.0) -> None:
        """Lets time pass until a condition holds."""
        for _ in range(round(limit_s / STEP_S)):
            if condition():
                return
            self.sim.step(STEP_S)
        raise AssertionError(f"not within {limit_s} simulated seconds")

    def end(self, future: Future[None], limit_s: float = 120.0) -> None:
        """Lets time pass until a future has ended, and raises its error."""
        self.until(future.done, limit_s)
        future.result()

    def arm(self) -> None:
        """The safety pilot arms."""
        self.sim.pilot_arm()
        self.run(STEP_S)
        assert self.state is State.LANDED_ARMED

    def fly(self, height_m: float = 3.0) -> None:
        """Arms and takes off."""
        self.arm()
        self.end(self.prepare.take_off(height_m).begin().future)
        assert self.state is State.FLYING_AUTO
        self.samples.clear()

    def is_in(self, state: State) -> bool:
        """Returns whether the UAV is in a state."""
        return self.state is state

    @property
    def state(self) -> State:
        return self.vehicle.state()

    @property
    def pose(self) -> Pose:
        pose = self.vehicle.telemetry().pose
        assert pose is not None
        return pose

    @property
    def speed(self) -> float:
        velocity = self.vehicle.telemetry().velocity
        assert velocity is not None
        return velocity.linear.norm()

    @property
    def states(self) -> list[State]:
        """The states of the samples, without repetitions."""
        result: list[State] = []
        for sample in self.samples:
            if not result or result[-1] is not sample.state:
                result.append(sample.state)
        return result


@contextmanager
def stepped(
    settings: VehicleSettings | None = None, ns: str = "uav_1", light: Mapping[str, Any] | None = None
) -> Iterator[Stepped]:
    """Opens a stepped light UAV, ready to arm."""
    backend = LightBackend(BackendOptions(ns, settings={**(light or {}), "speed_factor": 0}))
    vehicle = Vehicle(backend, settings)
    vehicle.open()
    try:
        uav = Stepped(vehicle)
        uav.run(STEP_S)
        yield uav
    finally:
        vehicle.close()


def at(x: float, y: float, z: float, yaw_rad: float | None = None, frame_id: str = "") -> PoseStamped:
    """Returns a goal."""
    return PoseStamped(Pose.at(x, y, z, yaw_rad), frame_id)
