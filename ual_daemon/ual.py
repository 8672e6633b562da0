"""The class interface: a UAV in the process, without a server and without delay. See `ual.interface.Uav`."""

from __future__ import annotations

import concurrent.futures
import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from typing import Any

from typing_extensions import Self

from ual import _views
from ual._callbacks import Callbacks, Listener
from ual._time_limit import time_limit
from ual.errors import UalTimeoutError
from ual.geometry import (
    PointStamped,
    Pose,
    PoseStamped,
    Transform,
    Twist,
    TwistStamped,
    Vector3,
    stamped_point,
    stamped_pose,
    stamped_twist,
)
from ual.interface import Simulation
from ual.types import (
    AltitudeReference,
    Frame,
    Info,
    Odometry,
    PathHeading,
    State,
    TaskInfo,
    TaskKind,
    Telemetry,
    Waypoints,
)
from ual_daemon import logs, validation
from ual_daemon.backends.base import Backend, BackendOptions
from ual_daemon.backends.registry import make
from ual_daemon.dry_run import DryRun, stamped_waypoints
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.settings import VehicleSettings
from ual_daemon.vehicle.vehicle import Vehicle

_log = logging.getLogger(__name__)

_CLOSE_PATIENCE_S = 60.0


class UAL:
    """One UAV in this process: `with UAL(backend="light", ns="uav_1") as uav: ...`.

    `backend` is a name (see `ual_daemon.backends.registry`) or a `Backend`; `backend_settings` is the backend's section
    of the configuration. Leaving the block (or `close`) cancels what runs, lets a take-off or landing end, and makes
    the autopilot hold its position by itself.
    """

    def __init__(
        self,
        backend: str | Backend = "light",
        ns: str = "uav_1",
        *,
        url: str | None = None,
        settings: VehicleSettings | None = None,
        backend_settings: Mapping[str, Any] | None = None,
        allow_arming: bool = False,
    ) -> None:
        if isinstance(backend, str):
            backend = make(backend, BackendOptions(ns, url, backend_settings or {}))
        self.vehicle = Vehicle(backend, settings, allow_arming=allow_arming)
        self._callbacks = Callbacks()
        self._subscriptions: set[_Subscription] = set()
        self.vehicle.open()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Brings the UAV to where it may be left, and ends everything."""
        try:
            self.vehicle.prepare_shutdown().result(_CLOSE_PATIENCE_S)
        except concurrent.futures.TimeoutError:
            why = f"the UAV was not at rest after {_CLOSE_PATIENCE_S:g} s"
            logs.event(_log, logging.ERROR, "closed_in_motion", why=why)
        for subscription in list(self._subscriptions):
            subscription.close()
        self.vehicle.close()

    # --- What is known ------------------------------------------------------------------------------------------------

    @property
    def ns(self) -> str:
        """The namespace."""
        return self.vehicle.ns

    def info(self) -> Info:
        return self.vehicle.info()

    def is_ready(self) -> bool:
        return _views.is_ready(self.telemetry())

    def is_idle(self) -> bool:
        return _views.is_idle(self.telemetry())

    def state(self) -> State:
        return self.vehicle.state()

    def telemetry(self) -> Telemetry:
        return self.vehicle.telemetry()

    def pose(self) -> PoseStamped:
        return _views.pose(self.telemetry())

    def velocity(self) -> TwistStamped:
        return _views.velocity(self.telemetry())

    def odometry(self) -> Odometry:
        return _views.odometry(self.telemetry())

    def reference_pose(self) -> PoseStamped | None:
        return _views.reference_pose(self.telemetry())

    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        return self.vehicle.transform(target_frame_id, source_frame_id)

    def frames(self) -> list[Frame]:
        return self.vehicle.frames()

    def add_frame(self, transform: Transform) -> None:
        self.vehicle.add_frame(transform)

    def subscribe(self, callback: Callable[[Telemetry], None], rate_hz: float = 0.0) -> _Subscription:
        rate_hz = validation.not_negative(rate_hz, "rate_hz", at_most=1e6)
        subscription = _Subscription(self.vehicle, self._callbacks.open(callback), rate_hz, self._subscriptions.discard)
        self._subscriptions.add(subscription)
        return subscription

    # --- Commands -----------------------------------------------------------------------------------------------------

    def arm(self, *, timeout_s: float | None = None) -> None:
        _run(self.vehicle.arm, timeout_s, "arm")

    def disarm(self, *, timeout_s: float | None = None) -> None:
        _run(self.vehicle.disarm, timeout_s, "disarm")

    def take_off(self, height_m: float, *, blocking: bool = True, timeout_s: float | None = None) -> _Task:
        return _handle(self.vehicle.commands.take_off(height_m).begin, blocking, timeout_s)

    def land(self, *, blocking: bool = True, timeout_s: float | None = None) -> _Task:
        return _handle(self.vehicle.commands.land().begin, blocking, timeout_s)

    def go_to_waypoint(
        self,
        waypoint: PoseStamped | Pose,
        *,
        max_speed_m_s: float | None = None,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> _Task:
        motion = self.vehicle.commands.go_to_waypoint(stamped_pose(waypoint), max_speed_m_s=max_speed_m_s)
        return _handle(motion.begin, blocking, timeout_s)

    def go_to_waypoint_geo(
        self,
        latitude_deg: float,
        longitude_deg: float,
        altitude_m: float,
        altitude_reference: AltitudeReference = AltitudeReference.HOME,
        *,
        yaw_rad: float | None = None,
        max_speed_m_s: float | None = None,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> _Task:
        motion = self.vehicle.commands.go_to_waypoint_geo(
            latitude_deg, longitude_deg, altitude_m, altitude_reference, yaw_rad=yaw_rad, max_speed_m_s=max_speed_m_s
        )
        return _handle(motion.begin, blocking, timeout_s)

    def follow_path(
        self,
        waypoints: Waypoints,
        *,
        corner_radius_m: float = 0.0,
        max_speed_m_s: float | None = None,
        leg_speeds_m_s: Sequence[float] = (),
        heading: PathHeading = PathHeading.WAYPOINTS,
        point_of_interest: PointStamped | Vector3 | None = None,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> _Task:
        motion = self.vehicle.commands.follow_path(
            stamped_waypoints(waypoints),
            corner_radius_m=corner_radius_m,
            max_speed_m_s=max_speed_m_s,
            leg_speeds_m_s=leg_speeds_m_s,
            heading=heading,
            point_of_interest=None if point_of_interest is None else stamped_point(point_of_interest),
        )
        return _handle(motion.begin, blocking, timeout_s)

    def set_pose(self, pose: PoseStamped | Pose) -> None:
        self.vehicle.commands.tell_pose(stamped_pose(pose))

    def set_velocity(self, velocity: TwistStamped | Twist) -> None:
        self.vehicle.commands.tell_velocity(stamped_twist(velocity))

    def recover_from_manual(self, *, timeout_s: float | None = None) -> None:
        _run(self.vehicle.commands.recover_from_manual().begin, timeout_s, "recover_from_manual")

    def set_home(self, set_z: bool = False) -> None:
        self.vehicle.set_home(set_z)

    def abort(self, freeze: bool = False) -> None:
        self.vehicle.abort(freeze)

    def task(self, task_id: str) -> _Task:
        return _Task(self.vehicle.task(task_id))

    @property
    def dry_run(self) -> DryRun:
        """The motions, as questions: what would happen, without anything moving."""
        return DryRun(self.vehicle.commands)

    @property
    def simulation(self) -> Simulation:
        """The world around a simulated UAV."""
        return self.vehicle.simulation()


class _Task:
    """A task's handle; see `ual.interface.Task`."""

    def __init__(self, task: VehicleTask) -> None:
        self._task = task

    @property
    def id(self) -> str:
        return self._task.id

    @property
    def kind(self) -> TaskKind:
        return self._task.kind

    def info(self) -> TaskInfo:
        return self._task.info()

    def done(self) -> bool:
        return self._task.future.done()

    def wait(self, timeout_s: float | None = None) -> TaskInfo:
        _wait(self._task.future, time_limit(timeout_s), f"wait for {self._task.kind.name.lower()}")
        return self._task.info()

    def cancel(self) -> None:
        self._task.cancel()

    def watch(self, rate_hz: float = 10.0) -> Iterator[TaskInfo]:
        period_s = 1.0 / validation.positive(rate_hz, "rate_hz", at_most=1e6)
        while not self._task.future.done():
            yield self._task.info()
            concurrent.futures.wait([self._task.future], timeout=period_s)
        yield self._task.info()


class _Subscription:
    """Calls back with the newest sample, at most at a rate; what comes while it is busy is counted as missed."""

    def __init__(
        self, vehicle: Vehicle, listener: Listener, rate_hz: float, on_close: Callable[[_Subscription], None]
    ) -> None:
        self._listener = listener
        self._period_s = 1.0 / rate_hz if rate_hz else 0.0
        self._next_s = time.monotonic()  # as the server's streams, a caller's rate is by the wall
        self._on_close = on_close
        self._unsubscribe = vehicle.subscribe(self._offer, lambda: time.monotonic() >= self._next_s)

    def _offer(self, sample: Telemetry) -> None:
        self._next_s = max(self._next_s + self._period_s, time.monotonic())
        self._listener.put(sample)

    def close(self) -> None:
        """Ends it; no call comes once this returns (unless called from a callback)."""
        self._unsubscribe()
        self._listener.close()
        self._on_close(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


def _run(begin: Callable[[], Future[None]], timeout_s: float | None, what: str) -> None:
    limit_s = time_limit(timeout_s)  # before anything moves
    _wait(begin(), limit_s, what)


def _wait(future: Future[None], limit_s: float | None, what: str) -> None:
    """Waits for a future. `UalTimeoutError` when it has not ended in time; what it stands for goes on."""
    done, _ = concurrent.futures.wait([future], timeout=limit_s)
    if not done:
        raise UalTimeoutError(f"{what}: not done after the {limit_s:g} s that the caller would wait")
    future.result()


def _handle(begin: Callable[[], VehicleTask], blocking: bool, timeout_s: float | None) -> _Task:
    limit_s = time_limit(timeout_s)  # before anything moves
    task = begin()
    handle = _Task(task)
    if blocking:
        try:
            _wait(task.future, limit_s, task.kind.name.lower())
        except BaseException:
            # The caller's deadline has passed, or he was interrupted (Ctrl-C): what he waited for shall not go on
            # unwatched. Take-off and landing do; cancelling one that has ended does nothing.
            if task.kind not in (TaskKind.TAKE_OFF, TaskKind.LAND):
                task.cancel()
            raise
    return handle
