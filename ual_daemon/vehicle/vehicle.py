"""One UAV above its backend: what may be commanded, and what is told of it. Nothing here blocks."""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from typing import NamedTuple

from ual.errors import InvalidArgumentError, NotSupportedError, PermissionDeniedError, WrongStateError
from ual.geometry import Transform
from ual.interface import Simulation
from ual.types import Capability, Frame, Info, Limits, State, TaskKind, Telemetry
from ual_daemon import logs, validation
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.flight import Flight
from ual_daemon.flight.geofence import Geofence
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.frames.tree import MAP
from ual_daemon.settings import VehicleSettings
from ual_daemon.tracker import limits
from ual_daemon.tracker.references import Hold, Reference, measured_motion
from ual_daemon.vehicle.commands import Commands
from ual_daemon.vehicle.preconditions import Preconditions, accepted
from ual_daemon.vehicle.telemetry import make_telemetry
from ual_daemon.version import __version__

_log = logging.getLogger(__name__)

_REMEMBERED_TASKS = 200
_LANDED = (State.LANDED_DISARMED, State.LANDED_ARMED)


class _Subscriber(NamedTuple):
    """See `Vehicle.subscribe`."""

    callback: Callable[[Telemetry], None]
    is_due: Callable[[], bool]


class Vehicle:
    """One UAV. Every member may be called from any thread and returns at once; see `ual.interface.Uav` for their
    meaning. Refusals raise errors of `ual.errors`; what takes time ends a future or a `VehicleTask`. The commands
    that move it are those of `motions`.
    """

    def __init__(
        self, backend: Backend, settings: VehicleSettings | None = None, *, allow_arming: bool = False
    ) -> None:
        self.ns = backend.options.ns
        self.log_name = ""
        """What its lines in the log call it, where there are several in the process."""
        self.backend = backend
        self._settings = settings or VehicleSettings()
        self._allow_arming = allow_arming
        self._resolver = FrameResolver(self.ns, self._settings)
        fence = self._settings.geofence
        geofence = None if fence is None else Geofence(fence, self._resolver)
        self._flight = Flight(backend, self._limits, geofence)
        self._preconditions = Preconditions(backend, self._flight)
        self.commands = Commands(
            backend,
            self._flight,
            self._resolver,
            self._preconditions,
            self._settings,
            self._limits,
            self._new_task,
            geofence,
        )
        self._lock = threading.Lock()
        self._tasks: OrderedDict[str, VehicleTask] = OrderedDict()
        self._subscribers: tuple[_Subscriber, ...] = ()
        self._state_listeners: tuple[Callable[[State], None], ...] = ()
        self._sequence = 0
        self._last_state: State | None = None
        self._own_limits: Limits | None = None
        self._smaller_limits = Limits()

    # --- Life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Begins to connect; see `Backend.open`."""
        self.backend.is_update_needed = self._is_update_needed
        self.backend.open(self._on_update)

    def close(self) -> None:
        """Ends everything at once; what still runs ends as aborted. See `prepare_shutdown` for what is safe before."""
        self.backend.close()
        self._flight.close()

    def prepare_shutdown(self) -> Future[None]:
        """Brings the UAV to where it may be left: a take-off or landing ends first, any other task and reference is
        cancelled, and the autopilot is told to hold its position by itself. Refuses new commands from now on.
        """
        return self._flight.prepare_shutdown()

    # --- What is known ------------------------------------------------------------------------------------------------

    def info(self) -> Info:
        """Who it is, and what it can do."""
        vehicle = self.backend.info()
        return Info(
            namespace=self.ns,
            backend=self.backend.name,
            autopilot=vehicle.autopilot,
            autopilot_version=vehicle.autopilot_version,
            is_simulation=vehicle.is_simulation,
            capabilities=vehicle.capabilities,
            limits=self._limits(),
            ual_version=__version__,
            is_arming_allowed=self._is_arming_allowed(),
            url=self.backend.options.url or "",
        )

    def state(self) -> State:
        """The state, estimated now."""
        return self._flight.estimate(self.backend.snapshot()).state

    def telemetry(self) -> Telemetry:
        """The newest sample of everything known."""
        snapshot = self.backend.snapshot()
        return self._sample(snapshot, self._flight.estimate(snapshot))

    def subscribe(
        self, callback: Callable[[Telemetry], None], is_due: Callable[[], bool] = lambda: True
    ) -> Callable[[], None]:
        """Calls back at each update for which `is_due` says so. Returns what ends it.

        Both run on the update thread and must not block. A sample that is due for nobody is not made.
        """
        subscriber = _Subscriber(callback, is_due)
        with self._lock:
            self._subscribers = (*self._subscribers, subscriber)

        def unsubscribe() -> None:
            with self._lock:
                self._subscribers = tuple(other for other in self._subscribers if other is not subscriber)

        return unsubscribe

    def listen_to_state(self, callback: Callable[[State], None]) -> Callable[[], None]:
        """Calls back with the new state whenever it has changed, on the update thread, before the sample that shows it:
        the callback must not block. Returns what ends it.
        """
        with self._lock:
            self._state_listeners = (*self._state_listeners, callback)

        def end() -> None:
            with self._lock:
                self._state_listeners = tuple(other for other in self._state_listeners if other is not callback)

        return end

    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        """What takes coordinates in the source frame (default the body) to the target (default ``map``)."""
        snapshot = self.backend.snapshot()
        return replace(self._resolver.transform(target_frame_id, source_frame_id, snapshot), stamp_s=snapshot.stamp_s)

    def frames(self) -> list[Frame]:
        """All frames."""
        return self._resolver.tree.frames(self._resolver.body(self.backend.snapshot()))

    def task(self, task_id: str) -> VehicleTask:
        """A task by its id, running or ended lately."""
        found = self._tasks.get(task_id)
        if found is None:
            raise InvalidArgumentError(f"task_id: there is no task {task_id[:100]!r}", {"field": "task_id"})
        return found

    def simulation(self) -> Simulation:
        """The world around a simulated UAV."""
        found = self.backend.simulation()
        if found is None:
            raise NotSupportedError(f"{self.ns} ({self.backend.name}) is not a simulation of ours")
        return found

    def _sample(self, snapshot: Snapshot, found: Estimate) -> Telemetry:
        sequence = snapshot.sequence or self._sequence
        return make_telemetry(snapshot, found, self._resolver, self._flight, self._settings.pose_frame_id, sequence)

    # --- Commands -----------------------------------------------------------------------------------------------------

    def add_frame(self, transform: Transform) -> None:
        """Adds a frame, or moves one that was added; that may come often, and is not logged."""
        with self._preconditions.refusing("add_frame"):
            transform = validation.transform(transform, "transform")
            is_new = transform.child_frame_id not in self._resolver.tree.names()
            self._resolver.tree.add(transform, self.backend.clock.now_s())
            if is_new:
                accepted("add_frame", frame=transform.child_frame_id, parent=transform.frame_id or MAP)

    def arm(self) -> Future[None]:
        """Arms; the future ends when the autopilot says so."""
        return self._arm_or_disarm("arm", State.LANDED_DISARMED, is_armed=True)

    def disarm(self) -> Future[None]:
        """Disarms; the future ends when the autopilot says so."""
        return self._arm_or_disarm("disarm", State.LANDED_ARMED, is_armed=False)

    def _arm_or_disarm(self, name: str, needed: State, *, is_armed: bool) -> Future[None]:
        with self._preconditions.refusing(name):
            self._preconditions.require_capability(Capability.ARM, name)
            if not self._is_arming_allowed():
                raise PermissionDeniedError(
                    f"{name}: arming belongs to the safety pilot; this daemon may arm only when started with "
                    "--allow-arming"
                )
            snapshot = self._preconditions.require_state(name, needed)
            if not is_armed:
                self._flight.require_replaceable(name)  # a take-off that has begun
            command = AutopilotCommand(name, snapshot.time_s)
            future = self._flight.watch(
                command, lambda newer: newer.armed is not None and newer.armed.value is is_armed
            )
            command.send(self.backend.arm if is_armed else self.backend.disarm)
            accepted(name)
            return future

    def set_home(self, set_z: bool = False) -> None:
        """Makes the present position the origin of ``<ns>/odom``."""
        with self._preconditions.refusing("set_home"):
            snapshot = self._preconditions.require_state("set_home", *_LANDED)
            self._resolver.set_home(measured_motion(snapshot).position, snapshot, set_z=set_z)
            accepted("set_home", set_z=set_z)

    def abort(self, freeze: bool = False, task_id: str = "") -> None:
        """Cancels the running task (or, with `task_id`, only that one) or reference, and stops."""
        with self._preconditions.refusing("abort"):
            if task_id and self.task(task_id).future.done():
                return
            snapshot = self._preconditions.require_state("abort", State.FLYING_AUTO)
            motion = measured_motion(snapshot)
            stop: Reference = Hold(motion.position, motion.yaw_rad) if freeze else self._flight.brake(snapshot)
            self._flight.refer(stop, "abort", snapshot, only_task_id=task_id)
            accepted("abort", freeze=freeze, task_id=task_id or "any")

    def _cancel(self, task: VehicleTask) -> None:
        if task.future.done():
            return
        if task.kind in (TaskKind.TAKE_OFF, TaskKind.LAND):
            raise WrongStateError(f"{task.kind.name.lower()} can be aborted by the safety pilot only")
        snapshot = self.backend.snapshot()
        if self._flight.raw_estimate(snapshot).state is State.FLYING_AUTO:
            stop = self._flight.brake(snapshot)
            self._flight.refer(stop, "cancel", snapshot, only_task_id=task.id)
        else:
            self._flight.drop(task.id, "cancel")
        accepted("cancel", task_id=task.id)

    def _new_task(self, kind: TaskKind, description: str) -> VehicleTask:
        task = VehicleTask(kind, description, self.backend.clock, self._cancel)
        with self._lock:
            self._tasks[task.id] = task
            if len(self._tasks) > _REMEMBERED_TASKS:
                self._tasks.popitem(last=False)
        return task

    def _is_arming_allowed(self) -> bool:
        return self._allow_arming or self.backend.simulation() is not None

    def _limits(self) -> Limits:
        """The smaller of the autopilot's limits, which it may tell anew, and the user's."""
        own = self.backend.info().limits
        if self._own_limits is not own:
            self._smaller_limits = limits.smaller(own, self._settings.limits)
            self._own_limits = own
        return self._smaller_limits

    # --- Updates ------------------------------------------------------------------------------------------------------

    def _is_update_needed(self) -> bool:
        """See `Backend.is_update_needed`."""
        return self._flight.is_busy or any(each.is_due() for each in self._subscribers)

    def _on_update(self, snapshot: Snapshot) -> None:
        """One update, on the backend's update thread. An error here must not end the thread that flies the UAV."""
        if self.log_name:
            logs.uav.set(self.log_name)
        try:
            self._update(snapshot)
        except Exception:  # noqa: BLE001  told loudly; the next update goes on
            _log.exception("an update failed; this is a defect of UAL, please report it")

    def _update(self, snapshot: Snapshot) -> None:
        self._sequence = snapshot.sequence or self._sequence + 1
        self._resolver.update(snapshot)
        self._flight.step(snapshot)
        found = self._flight.estimate(snapshot)
        self._tell_change(found)
        due = [each for each in self._subscribers if each.is_due()]
        if due:
            sample = self._sample(snapshot, found)
            for subscriber in due:
                subscriber.callback(sample)

    def _tell_change(self, found: Estimate) -> None:
        last, self._last_state = self._last_state, found.state
        if last is not found.state:
            level = logging.WARNING if found.state in (State.UNINITIALIZED, State.FLYING_MANUAL) else logging.INFO
            old = None if last is None else last.name
            logs.event(_log, level, "state", old=old, new=found.state.name, why=found.why)
            for listener in self._state_listeners:
                listener(found.state)
