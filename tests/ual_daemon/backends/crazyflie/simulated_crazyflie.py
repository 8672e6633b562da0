"""All of UAL below its interface, and a simulated Crazyflie, in stepped time."""

from __future__ import annotations

from concurrent.futures import Future
from pathlib import Path

from typing_extensions import override

from tests.simulators.crazyflie import STEP_S, Crazyflie
from tests.simulators.lockstep_crazyflie import LockstepCrazyflie
from tests.simulators.ports import MemoryPort
from tests.ual_daemon.backends.crazyflie.flights import FlightTrace
from ual.geometry import IDENTITY, Pose, PoseStamped, Vector3
from ual.types import ExternalPose, GoToWaypointRequest, LandRequest, State, TakeOffRequest
from ual_daemon.backends.crazyflie.packets import SETPOINT
from ual_daemon.vehicle.vehicle import Vehicle

_NO_SHIFT = Vector3()


class SimulatedCrazyflie(FlightTrace):
    """One that arms itself, on the ground, with its state. `settings` are those of the backend."""

    vehicle: Vehicle
    _source_is: Vector3 | None = None
    """By how much the poses from outside are off; None: there are none."""

    def __init__(self, cache: Path, positioning_deck: str = "", *, arms_itself: bool = True) -> None:
        crazyflie = Crazyflie(MemoryPort(), arms_itself=arms_itself)
        super().__init__(cache, crazyflie, positioning_deck=positioning_deck)
        self.ready()

    @override
    def _make_backend(self) -> LockstepCrazyflie:
        backend = super()._make_backend()
        self.vehicle = Vehicle(backend, allow_arming=True)
        backend._session = backend._make_session(self.vehicle._on_update)
        backend._loop = backend._session.loop
        return backend

    @property
    def state(self) -> State:
        return self.vehicle.state()

    @override
    def take_off(self, height_m: float = 1.0) -> None:
        self.end(self.vehicle.commands.prepare(TakeOffRequest(height_m)).begin().future)

    def land(self) -> None:
        self.end(self.begin_landing())

    def begin_landing(self) -> Future[None]:
        return self.vehicle.commands.prepare(LandRequest()).begin().future

    def begin_go_to(self, waypoint: Pose) -> None:
        self.vehicle.commands.prepare(GoToWaypointRequest(PoseStamped(waypoint))).begin()

    def lift(self, climb_m_s: float, duration_s: float) -> None:
        """A hand lifts it, whatever its motors do."""
        body = self.crazyflie.body
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            x, y, z = body.position
            body.position, body.velocity = (x, y, z - climb_m_s * STEP_S), (0.0, 0.0, -climb_m_s)
            body.is_on_ground = False
            self._turn()

    def move_origin(self, by: Vector3) -> None:
        """Moves the estimate by this: what tells it where it is counts from another place now."""
        body = self.crazyflie.body
        x, y, z = body.position
        body.position = (x + by.x, y - by.y, z - by.z)
        body.ground_z_m -= by.z

    def measure_outside(self, shift: Vector3 = _NO_SHIFT) -> None:
        """Gives its poses from outside from now on, 50 a second, in the default frame, shifted by this.

        Once a shifted one is taken, its estimate follows.
        """
        self._source_is = shift

    @override
    def _turn(self) -> None:
        super()._turn()
        shift = self._source_is
        if shift is not None and round(self.now_s / STEP_S) % 2 == 0:
            pose = Pose(Vector3(*self.crazyflie.current_position) + shift, IDENTITY)
            is_taken = not self.vehicle.external_poses.offer(ExternalPose(PoseStamped(pose)))
            if is_taken and shift != _NO_SHIFT:
                self.move_origin(shift)
                self.measure_outside()

    def lose_notifications(self, count: int) -> None:
        """Loses the next notifications that setpoints stop."""
        take = self.crazyflie._on_setpoints_stop
        lost = iter(range(count))

        def lossy(_: bytes) -> None:
            if next(lost, None) is None:
                take(_)

        self.crazyflie._on_setpoints_stop = lossy  # type: ignore[method-assign]

    def setpoints_since(self, since_s: float) -> int:
        return sum(p.port == SETPOINT and p.channel == 0 and t >= since_s for t, p in self.crazyflie.received)
