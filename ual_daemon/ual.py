"""The class interface: a UAV in this process, without a server and without delay. See `ual.interface.Uav`."""

from __future__ import annotations

import concurrent.futures
import logging
import math
import os
import re
import time
import weakref
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, cast

from typing_extensions import Self, override

from ual.errors import ClientUnusableError, LeaseLostError, UalError, UalTimeoutError
from ual.geometry import (
    Pose,
    PoseStamped,
    Transform,
    Twist,
    TwistStamped,
    checked_transform,
    stamped_pose,
    stamped_twist,
)
from ual.interface import DryRun, Lease, Simulation, Subscription, Task
from ual.shared import environment, views
from ual.shared.callbacks import Callbacks, Listener
from ual.shared.flags import flag
from ual.shared.time_limit import time_limit
from ual.shared.uncopied import Uncopied
from ual.types import (
    ExternalPose,
    LeaseInfo,
    MotionRequest,
    Plan,
    State,
    TaskInfo,
    TaskKind,
    TaskRequest,
    Telemetry,
)
from ual_daemon import logs, validation
from ual_daemon.backends.base import Backend, BackendOptions
from ual_daemon.choice import make
from ual_daemon.extensions.base import ExtensionContext
from ual_daemon.extensions.loaded import Extensions
from ual_daemon.flight.policy.lease import NOBODY
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.frames.home_file import HomeFile
from ual_daemon.services._derived import PartMembers, Parts, UavMembers
from ual_daemon.settings import NAMESPACE_PATTERN, ConfigError, VehicleSettings
from ual_daemon.vehicle.external_poses import CONTINUED_STREAM_S

if TYPE_CHECKING:
    from ual_daemon.choice import ServedVehicle

_log = logging.getLogger(__name__)

_CLOSE_PATIENCE_S = 60.0
_THIS_PROCESS = "this process"


class UAL(Uncopied, PartMembers, UavMembers):
    """One UAV in this process, without a server and without delay. Its members are those of `ual.interface.Uav`.

    `close`, or the end of its ``with`` block, hands the UAV over to its autopilot. It belongs to this process: in a
    forked one each call raises `ClientUnusableError`. It can be neither copied nor pickled.

    Args:
        backend: The name of a backend, such as ``light`` or ``mavlink``, or a `Backend`.
        ns: The namespace of the UAV.
        url: Where the autopilot is, as the backend expects it.
        settings: Home, frames, limits, tolerances, geofence: a `ual_daemon.settings.VehicleSettings`.
        backend_settings: The settings of the backend, by name: its section of the daemon's configuration.
        allow_arming: Whether `arm` and `disarm` may be used on a real UAV.
        home_file: A file in which home is kept, so that it survives a restart of the process.
        extensions: The extensions to load, by name, each with its settings.
        watch_only: Whether it only reports: every command is refused, and nothing that flies is sent.

    Raises:
        ConfigError: There is no such backend, or a setting is wrong.

    Example:
        >>> with UAL(backend="light", ns="uav_1") as uav:
        ...     uav.arm()
        ...     uav.take_off(3.0)
        ...     uav.land()

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
        watch_only: bool = False,
        home_file: Path | None = None,
        extensions: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> None:
        _warn_of_unknown_variables()
        _check(ns, settings)
        kept = None if home_file is None else HomeFile(home_file)
        options = BackendOptions(ns, url, backend_settings or {})
        vehicle = make(backend, options, settings, allow_arming=allow_arming, home_file=kept, watch_only=watch_only)
        self._begin_with(vehicle, extensions or {})
        vehicle.open()
        self._extensions.start()

    @classmethod
    def over(cls, vehicle: ServedVehicle, extensions: Mapping[str, Any]) -> UAL:
        """Returns the class interface of a vehicle that somebody else opens, and closes after this.

        :meta private:

        Raises:
            ConfigError: An extension is not there, or its settings are wrong.

        """
        uav = cls.__new__(cls)
        uav._begin_with(vehicle, extensions)  # noqa: SLF001  of this class
        return uav

    def _begin_with(self, vehicle: ServedVehicle, extensions: Mapping[str, Any]) -> None:
        self.vehicle = vehicle
        _alive.add(self)
        self._callbacks = Callbacks()
        self._subscriptions: set[_Subscription] = set()
        self._external_pose_s = -math.inf
        """Time of the last external pose that was not refused."""
        self._lease_id = NOBODY
        self._is_closed = self._has_ended = False
        self._served = Parts(vehicle, lambda: self._lease_id)
        self._extensions = Extensions(extensions, ExtensionContext(self, {}, self._require_lease, vehicle.payload()))

    def __repr__(self) -> str:
        return f"<ual_daemon.UAL {self.vehicle.ns}, {'closed' if self._is_closed else 'open'}>"

    @override
    def close(self) -> None:
        """Hands the UAV over to its autopilot, and ends everything.

        A take-off or landing ends first, any other task is cancelled, and the autopilot holds the position by itself.
        If that takes more than 60 s, the UAV is left in motion; the log says so, and what the UAV was doing.
        """
        self._is_closed = True
        if isinstance(self.vehicle, _OfParent):
            return
        try:
            self.vehicle.prepare_shutdown().result(_CLOSE_PATIENCE_S)
        except (concurrent.futures.TimeoutError, UalError) as error:
            slow = f"the UAV was not at rest after {_CLOSE_PATIENCE_S:g} s"
            why = str(error) if isinstance(error, UalError) else slow
            logs.event(_log, logging.ERROR, "closed_in_motion", why=why, **self.vehicle.doing())
        self.release()
        self.vehicle.close()

    def release(self) -> None:
        """Ends the extensions and the subscriptions, and leaves the vehicle as it is.

        :meta private:
        """
        self._is_closed = True
        self._extensions.close()
        for subscription in list(self._subscriptions):
            subscription.close()
        self._has_ended = True  # what ends it may read it until here

    @property
    @override
    def _open(self) -> ServedVehicle:
        """The vehicle, unless this object is closed. Setpoints, of which each costs, are refused by the flight."""
        if self._has_ended:
            raise ClientUnusableError("this UAL is closed")
        return self.vehicle

    @property
    @override
    def _parts(self) -> Parts:
        self._open  # noqa: B018  it raises where this object is closed
        return self._served

    @property
    def extensions(self) -> Extensions:
        """The extensions that are loaded.

        :meta private:
        """
        return self._extensions

    @override
    def extension(self, name: str) -> Any:
        return self._extensions.interface(name)

    def _require_lease(self, command: str, lease_id: str | None = None) -> None:
        """Checks that an extension may move things: by the lease of a call, or else by that of this object."""
        self.vehicle.require_lease(command, self._lease_id if lease_id is None else lease_id)

    # --- What is known ------------------------------------------------------------------------------------------------

    @property
    @override
    def ns(self) -> str:
        return self.vehicle.ns

    @override
    def state(self) -> State:
        return self._open.state()

    @override
    def subscribe(self, callback: Callable[[Telemetry], None], rate_hz: float = 0.0) -> Subscription:
        rate_hz = validation.not_negative(rate_hz, "rate_hz", at_most=validation.MAX_STREAM_RATE_HZ)
        subscription = _Subscription(self._open, self._callbacks.open(callback), rate_hz, self._subscriptions.discard)
        self._subscriptions.add(subscription)
        return subscription

    # --- Frames -------------------------------------------------------------------------------------------------------

    @override
    def add_frame(self, transform: Transform) -> None:
        self._open.frame_editor.add(checked_transform(transform))

    @override
    def remove_frame(self, frame_id: str) -> None:
        self._open.frame_editor.remove(frame_id)

    # --- Commands -----------------------------------------------------------------------------------------------------

    @override
    def arm(self, *, timeout_s: float | None = None) -> None:
        _run(partial(self._open.commands.arm, self._lease_id), timeout_s, "arm")

    @override
    def disarm(self, *, timeout_s: float | None = None) -> None:
        _run(partial(self._open.commands.disarm, self._lease_id), timeout_s, "disarm")

    @override
    def _begin(self, request: TaskRequest, blocking: bool, timeout_s: float | None) -> Task:
        commands, lease_id, is_waited_for = self._open.commands, self._lease_id, flag(blocking, "blocking")
        prepared = commands.prepare(request, lease_id)
        limit_s = time_limit(timeout_s)  # before anything moves
        task = prepared.begin()
        if is_waited_for:
            try:
                _wait(task.future, limit_s, task.kind.name.lower())
            except BaseException:
                # The caller's time limit has passed, or it was interrupted (Ctrl-C): the task must not go on unwatched.
                # A take-off or landing does; cancelling a task that has ended does nothing.
                commands.abandon(task, lease_id)
                raise
        return _Task(task, self)

    @override
    def set_pose(self, pose: PoseStamped | Pose) -> None:
        self.vehicle.commands.setpoints.set_pose(stamped_pose(pose), self._lease_id)

    @override
    def set_velocity(self, velocity: TwistStamped | Twist) -> None:
        twist = velocity if velocity.__class__ is Twist else stamped_twist(velocity)
        self.vehicle.commands.setpoints.set_velocity(twist, self._lease_id)

    @override
    def set_external_pose(
        self,
        pose: PoseStamped | Pose,
        *,
        position_std_dev_m: float | None = None,
        orientation_std_dev_rad: float | None = None,
    ) -> None:
        measured = ExternalPose(stamped_pose(pose), position_std_dev_m, orientation_std_dev_rad)
        poses, now_s = self.vehicle.external_poses, time.monotonic()
        (poses.offer if now_s - self._external_pose_s < CONTINUED_STREAM_S else poses.set)(measured)
        self._external_pose_s = now_s

    @override
    def recover_from_manual(self, *, force: bool = False, timeout_s: float | None = None) -> None:
        prepared = self._open.commands.recover_from_manual(self._lease_id, force=force)
        _run(prepared.begin, timeout_s, "recover_from_manual")

    def _pause(self, task_id: str = "") -> None:
        self._open.commands.pause(task_id, self._lease_id)

    def _resume(self, task_id: str = "") -> None:
        self._open.commands.resume(task_id, self._lease_id)

    def _cancel(self, task: VehicleTask) -> None:
        self.vehicle.commands.cancel(task, self._lease_id)

    @override
    def task(self, task_id: str) -> Task:
        return _Task(self._open.task(task_id), self)

    @override
    def lease(self, holder: str = "", *, take: bool = False) -> Lease:
        """Makes this object the only one that flies the UAV. It lasts until it is released or taken: this process is
        the daemon's.
        """
        self._lease_id = self._open.acquire_lease(
            holder or _THIS_PROCESS, _THIS_PROCESS, take=flag(take, "take"), lasts_s=math.inf, lease_id=self._lease_id
        )
        return _Lease(self, self._lease_id)

    @override
    def lease_info(self) -> LeaseInfo | None:
        return self._open.lease()

    def _end_lease(self, lease_id: str) -> None:
        self.vehicle.release_lease(lease_id)
        if self._lease_id == lease_id:
            self._lease_id = NOBODY

    @property
    @override
    def dry_run(self) -> DryRun[Plan]:
        return DryRun(self._plan)

    def _plan(self, motion: MotionRequest) -> Plan:
        return self._open.commands.plan(motion, self._lease_id)

    @property
    @override
    def simulation(self) -> Simulation:
        return self._open.simulation()


class _Task(Task):
    """The handle of a task in this process."""

    def __init__(self, task: VehicleTask, uav: UAL) -> None:
        self._task = task
        self._uav = uav

    def __repr__(self) -> str:
        return f"<Task {self.id} {self.kind.name} {self.info().status.name}>"

    @property
    @override
    def id(self) -> str:
        return self._task.id

    @property
    @override
    def kind(self) -> TaskKind:
        return self._task.kind

    @override
    def info(self) -> TaskInfo:
        return self._task.info()

    @override
    def done(self) -> bool:
        return self._task.future.done()

    @override
    def wait(self, timeout_s: float | None = None) -> TaskInfo:
        _wait(self._task.future, time_limit(timeout_s), f"wait for {self._task.kind.name.lower()}")
        return self._task.info()

    @override
    def cancel(self) -> None:
        self._uav._cancel(self._task)  # noqa: SLF001  of this module

    @override
    def pause(self) -> None:
        self._uav._pause(self.id)  # noqa: SLF001  of this module

    @override
    def resume(self) -> None:
        self._uav._resume(self.id)  # noqa: SLF001  of this module

    @override
    def watch(self, rate_hz: float = 10.0) -> Iterator[TaskInfo]:
        period_s = validation.watch_period_s(rate_hz)
        while not self._task.future.done():
            yield self._task.info()
            concurrent.futures.wait([self._task.future], timeout=period_s)
        yield self._task.info()


class _Lease(Lease):
    """A lease of an object in this process."""

    def __init__(self, uav: UAL, lease_id: str) -> None:
        self._uav = uav
        self._id = lease_id
        self._is_released = False

    @property
    @override
    def lost(self) -> UalError | None:
        if self._is_released:
            return None
        try:
            self._uav.vehicle.keep_lease(self._id)
        except LeaseLostError as error:
            return error
        return None

    @override
    def release(self) -> None:
        self._is_released = True
        self._uav._end_lease(self._id)  # noqa: SLF001  of this module


class _Subscription(Subscription):
    """Calls back with the newest sample, at most at a rate. Samples that come during a call are counted as missed."""

    def __init__(
        self, vehicle: ServedVehicle, listener: Listener, rate_hz: float, on_close: Callable[[_Subscription], None]
    ) -> None:
        self._ns = vehicle.ns
        self._rate_hz = rate_hz
        self._is_closed = False
        self._listener = listener
        self._period_s = 1.0 / rate_hz if rate_hz else 0.0
        self._next_s = time.monotonic()  # a rate is in real time, as that of the server's streams
        self._on_close = on_close
        self._unsubscribe = vehicle.subscribe(self._offer, lambda: time.monotonic() >= self._next_s, reads_all=False)

    def __repr__(self) -> str:
        return views.subscription_text(self._ns, self._rate_hz, is_closed=self._is_closed)

    def _offer(self, sample: Telemetry) -> None:
        self._next_s = max(self._next_s + self._period_s, time.monotonic())
        self._listener.put(sample)

    @override
    def close(self) -> None:
        """Ends it. No callback runs after this returns (unless it is called from a callback)."""
        self._is_closed = True
        self._unsubscribe()
        self._listener.close()
        self._on_close(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


class _OfParent:
    """Stands for the vehicle in a forked process, which has the socket of the autopilot's link, but none of the threads
    that watch it.
    """

    def __init__(self, ns: str) -> None:
        self.ns = ns

    def __getattr__(self, name: str) -> NoReturn:
        raise ClientUnusableError(
            f"the process from which this one was forked flies {self.ns}: fly it there, or by a daemon (ual.Uav), "
            "which several processes can call"
        )


_alive: weakref.WeakSet[UAL] = weakref.WeakSet()


def _leave_to_parent() -> None:
    for uav in list(_alive):
        uav.vehicle = cast("ServedVehicle", _OfParent(uav.vehicle.ns))


os.register_at_fork(after_in_child=_leave_to_parent)


def _check(ns: str, settings: VehicleSettings | None) -> None:
    """Refuses what a program gives in place of a name and of settings."""
    if not isinstance(ns, str) or not re.fullmatch(NAMESPACE_PATTERN, ns):
        raise ConfigError(f"{ns!r:.100} is no name: letters, digits and _, beginning with a letter or _", "ns")
    if settings is not None and not isinstance(settings, VehicleSettings):
        raise ConfigError(
            f"expected a VehicleSettings, got a {type(settings).__name__}; ual_daemon.settings.convert(values, "
            "VehicleSettings) makes one",
            "settings",
        )


def _warn_of_unknown_variables() -> None:
    """Warns of a misspelled variable: its user expects an effect."""
    if mistake := environment.mistake_in(os.environ):
        logs.event(_log, logging.WARNING, "unknown_variable", why=mistake, effect="none: the class reads no variables")


def _run(begin: Callable[[], Future[None]], timeout_s: float | None, what: str) -> None:
    limit_s = time_limit(timeout_s)  # before anything moves
    _wait(begin(), limit_s, what)


def _wait(future: Future[None], limit_s: float | None, what: str) -> None:
    """Waits for a future. Raises `UalTimeoutError` if it has not ended in time; what it waits for goes on."""
    done, _ = concurrent.futures.wait([future], timeout=limit_s)
    if not done:
        raise UalTimeoutError(f"{what}: not done after the {limit_s:g} s that the caller would wait")
    future.result()
