"""A light UAV whose time stands still until a test steps it: every run is the same.

It is updated in every second step, 25 times a second as the simulated autopilots of tests, unless a test looks at each
step. Samples are kept where a test wants them. Updates and samples are nearly all that a stepped flight costs.
"""

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
from ual_daemon.backends.light.world import World
from ual_daemon.flight.policy.lease import NOBODY
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.settings import VehicleSettings
from ual_daemon.vehicle.prepared import Prepared
from ual_daemon.vehicle.vehicle import Vehicle

STEP_S = 0.02
UPDATE_S = 2 * STEP_S


class SteppedWorld(World):
    """World whose vehicles are updated after every n-th step (`every`), and when something has changed.

    Its time may run by itself, too.
    """

    every = round(UPDATE_S / STEP_S)

    def _step_once(self, every: int = 1) -> None:
        super()._step_once(self.every)


class Prepare(TaskCommands[Prepared[VehicleTask]]):
    """The tasks of a vehicle, planned but not begun."""

    def __init__(self, vehicle: Vehicle, lease_id: str = NOBODY) -> None:
        """`lease_id` is the lease by which they are commanded."""
        self._vehicle = vehicle
        self._lease_id = lease_id

    def _begin(self, request: TaskRequest, blocking: bool, timeout_s: float | None) -> Prepared[VehicleTask]:
        return self._vehicle.commands.prepare(request, self._lease_id)


class Stepped:
    """A vehicle whose time a test steps."""

    def __init__(self, vehicle: Vehicle, world: SteppedWorld) -> None:
        self.vehicle = vehicle
        self.prepare = Prepare(vehicle)
        self.sim = vehicle.simulation()
        self.world = world
        self._samples: list[Telemetry] | None = None

    def update_each_step(self) -> None:
        """Updates it after each step from now on, instead of every second one."""
        self.world.every = 1

    def keep_samples(self) -> None:
        """Keeps its samples from now on, and forgets earlier ones."""
        if self._samples is None:
            self._samples = []
            # Parts of a sample that no test reads are left out: a place on Earth is a tenth of the work of a step.
            self.vehicle.subscribe(self._samples.append, reads_all=False)
        self._samples.clear()

    @property
    def samples(self) -> list[Telemetry]:
        """Its samples since `keep_samples`."""
        assert self._samples is not None, "no samples are kept: call keep_samples() first"
        return self._samples

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
    world = SteppedWorld(0.0)
    backend = LightBackend(BackendOptions(ns, settings={**(light or {}), "speed_factor": 0}), world)
    vehicle = Vehicle(backend, settings)
    vehicle.open()
    try:
        uav = Stepped(vehicle, world)
        uav.run(STEP_S)
        yield uav
    finally:
        vehicle.close()


def at(x: float, y: float, z: float, yaw_rad: float | None = None, frame_id: str = "") -> PoseStamped:
    """Returns a goal."""
    return PoseStamped(Pose.at(x, y, z, yaw_rad), frame_id)
