"""One UAV above its backend: what may be commanded, and what is told of it. Nothing here blocks."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import fields, replace

from ual.errors import (
    InvalidArgumentError,
    LinkLostError,
    NotSupportedError,
    PermissionDeniedError,
    UalError,
    WrongStateError,
)
from ual.geometry import PoseStamped, Transform, Twist, TwistStamped, Vector3
from ual.interface import Simulation
from ual.types import AltitudeReference, Capability, Frame, Info, Limits, State, TaskKind, Telemetry
from ual_daemon import logs, validation
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Snapshot
from ual_daemon.estimator import Estimate
from ual_daemon.flight import Flight
from ual_daemon.frames import MAP
from ual_daemon.manoeuvres import Command, FollowTrajectory, Land, Recover, TakeOff
from ual_daemon.places import Goal, Places
from ual_daemon.references import VELOCITY_TIMEOUT_S, Hold, Reference, Velocity, brake, measured_motion
from ual_daemon.sample import make_sample
from ual_daemon.settings import VehicleSettings
from ual_daemon.tasks import VehicleTask
from ual_daemon.trajectory import Waypoint, path
from ual_daemon.version import __version__

_log = logging.getLogger(__name__)

_REMEMBERED_TASKS = 200
_REPEATED_REFUSAL_S = 1.0
_MAX_WAYPOINTS = 100_000

_LANDED = (State.LANDED_DISARMED, State.LANDED_ARMED)


class Vehicle:
    """One UAV. Every member may be called from any thread and returns at once; see `ual.interface.Uav` for their
    meaning. Refusals raise errors of `ual.errors`; what takes time ends a future or a `VehicleTask`.
    """

    def __init__(
        self, backend: Backend, settings: VehicleSettings | None = None, *, allow_arming: bool = False
    ) -> None:
        self.ns = backend.options.ns
        self.backend = backend
        self._settings = settings or VehicleSettings()
        self._allow_arming = allow_arming
        self._places = Places(self.ns, self._settings)
        self._flight = Flight(backend, self._limits)
        self._lock = threading.Lock()
        self._tasks: OrderedDict[str, VehicleTask] = OrderedDict()
        self._subscribers: tuple[Callable[[Telemetry], None], ...] = ()
        self._sequence = 0
        self._last_state: State | None = None
        self._own_limits: Limits | None = None
        self._smaller_limits = Limits()
        self._last_refusal = ("", 0.0)

    # --- Life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Begins to connect; see `Backend.open`."""
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

    def subscribe(self, callback: Callable[[Telemetry], None]) -> Callable[[], None]:
        """Calls back at every update, on the update thread: the callback must not block. Returns what ends it."""
        with self._lock:
            self._subscribers = (*self._subscribers, callback)

        def unsubscribe() -> None:
            with self._lock:
                self._subscribers = tuple(other for other in self._subscribers if other is not callback)

        return unsubscribe

    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        """What takes coordinates in the source frame (default the body) to the target (default ``map``)."""
        snapshot = self.backend.snapshot()
        return replace(self._places.transform(target_frame_id, source_frame_id, snapshot), stamp_s=snapshot.stamp_s)

    def frames(self) -> list[Frame]:
        """All frames."""
        return self._places.tree.frames(self._places.body(self.backend.snapshot()))

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
        return make_sample(snapshot, found, self._places, self._flight, self._settings.pose_frame_id, self._sequence)

    # --- Commands -----------------------------------------------------------------------------------------------------

    def add_frame(self, transform: Transform) -> None:
        """Adds a frame, or moves one that was added."""
        with self._refusing("add_frame"):
            self._places.tree.add(validation.transform(transform, "transform"))
            _accepted("add_frame", frame=transform.child_frame_id, parent=transform.frame_id or MAP)

    def arm(self) -> Future[None]:
        """Arms; the future ends when the autopilot says so."""
        return self._arm_or_disarm("arm", State.LANDED_DISARMED, is_armed=True)

    def disarm(self) -> Future[None]:
        """Disarms; the future ends when the autopilot says so."""
        return self._arm_or_disarm("disarm", State.LANDED_ARMED, is_armed=False)

    def _arm_or_disarm(self, name: str, needed: State, *, is_armed: bool) -> Future[None]:
        with self._refusing(name):
            self._require_capability(Capability.ARM, name)
            if not self._is_arming_allowed():
                raise PermissionDeniedError(
                    f"{name}: arming belongs to the safety pilot; this daemon may arm only when started with "
                    "--allow-arming"
                )
            snapshot = self._require_state(name, needed)
            if not is_armed:
                self._flight.require_replaceable(name)  # a take-off that has begun
            command = Command(name, snapshot.time_s)
            future = self._flight.watch(
                command, lambda newer: newer.armed is not None and newer.armed.value is is_armed
            )
            command.send(self.backend.arm if is_armed else self.backend.disarm)
            _accepted(name)
            return future

    def take_off(self, height_m: float) -> VehicleTask:
        """Climbs to a height above where it stands."""
        with self._refusing("take_off"):
            self._require_capability(Capability.TAKE_OFF, "take_off")
            height_m = validation.positive(height_m, "height_m", at_most=validation.MAX_DISTANCE_M)
            self._flight.require_replaceable("take_off")
            snapshot = self._require_state("take_off", State.LANDED_ARMED)
            task = self._new_task(TaskKind.TAKE_OFF, f"take off to {height_m:g} m")
            command = Command("take off", snapshot.time_s)
            on_setpoints = self.backend.info().flies_takeoff_on_setpoints
            climb = TakeOff(
                task, command, snapshot, height_m, self._limits(), self._settings.tolerance, on_setpoints=on_setpoints
            )
            self._flight.begin(climb)
            command.send(lambda: self.backend.take_off(height_m))
            _accepted("take_off", task_id=task.id, height_m=height_m)
            return task

    def land(self) -> VehicleTask:
        """Lands where it is."""
        with self._refusing("land"):
            self._require_capability(Capability.LAND, "land")
            self._flight.require_replaceable("land")
            snapshot = self._require_state("land", State.FLYING_AUTO)
            task = self._new_task(TaskKind.LAND, "land")
            command = Command("land", snapshot.time_s)
            self._flight.begin(Land(task, command, brake(snapshot, self._limits()), snapshot))
            command.send(self.backend.land)
            _accepted("land", task_id=task.id)
            return task

    def go_to_waypoint(self, waypoint: PoseStamped) -> VehicleTask:
        """Flies straight to a pose in any frame."""
        with self._refusing("go_to_waypoint"):
            self._require_capability(Capability.POSITION, "go_to_waypoint")
            goal = self._places.goal(waypoint, "waypoint")
            snapshot = self._require_state("go_to_waypoint", State.FLYING_AUTO)
            local = self._places.to_local(goal, snapshot)
            return self._follow(TaskKind.GO_TO_WAYPOINT, f"go to {_text(goal)}", [local], 0.0, snapshot)

    def go_to_waypoint_geo(
        self,
        latitude_deg: float,
        longitude_deg: float,
        altitude_m: float,
        altitude_reference: AltitudeReference = AltitudeReference.HOME,
        yaw_rad: float | None = None,
    ) -> VehicleTask:
        """Flies straight to a geographic position."""
        with self._refusing("go_to_waypoint_geo"):
            self._require_capability(Capability.GEO, "go_to_waypoint_geo")
            latitude_deg = validation.latitude(latitude_deg)
            longitude_deg = validation.longitude(longitude_deg)
            altitude_m = validation.number(altitude_m, "altitude_m", at_most=validation.MAX_DISTANCE_M)
            altitude_reference = validation.altitude_reference(altitude_reference)
            if yaw_rad is not None:
                yaw_rad = validation.number(yaw_rad, "yaw_rad", at_most=validation.MAX_ANGLE_RAD)
            snapshot = self._require_state("go_to_waypoint_geo", State.FLYING_AUTO)
            position = validation.position(
                self._places.geo_to_local(latitude_deg, longitude_deg, altitude_m, altitude_reference, snapshot),
                "latitude_deg, longitude_deg, altitude_m (in the local frame)",
            )
            what = f"go to {latitude_deg:.7f}, {longitude_deg:.7f} at {altitude_m:g} m ({altitude_reference.name})"
            return self._follow(TaskKind.GO_TO_WAYPOINT_GEO, what, [Waypoint(position, yaw_rad)], 0.0, snapshot)

    def follow_path(self, waypoints: Sequence[PoseStamped], corner_radius_m: float = 0.0) -> VehicleTask:
        """Flies through waypoints."""
        with self._refusing("follow_path"):
            self._require_capability(Capability.POSITION, "follow_path")
            if not waypoints:
                raise validation.refuse("waypoints", "there are none; a path needs at least one")
            if len(waypoints) > _MAX_WAYPOINTS:
                raise validation.refuse("waypoints", f"{len(waypoints)} are more than {_MAX_WAYPOINTS}")
            radius_m = validation.not_negative(corner_radius_m, "corner_radius_m", at_most=validation.MAX_DISTANCE_M)
            goals = [self._places.goal(waypoint, f"waypoints[{i}]") for i, waypoint in enumerate(waypoints)]
            snapshot = self._require_state("follow_path", State.FLYING_AUTO)
            local = [self._places.to_local(goal, snapshot) for goal in goals]
            what = f"follow {len(waypoints)} waypoints to {_text(goals[-1])}"
            return self._follow(TaskKind.FOLLOW_PATH, what, local, radius_m, snapshot)

    def _follow(
        self, kind: TaskKind, what: str, goals: Sequence[Waypoint], corner_radius_m: float, snapshot: Snapshot
    ) -> VehicleTask:
        name = kind.name.lower()
        self._flight.require_replaceable(name)
        trajectory = path(self._flight.start(snapshot), goals, corner_radius_m, self._limits())
        task = self._new_task(kind, what)
        self._flight.begin(FollowTrajectory(name, task, trajectory, self._settings.tolerance))
        _accepted(name, task_id=task.id, what=what, length_m=round(trajectory.length_m, 2))
        return task

    def set_pose(self, pose: PoseStamped) -> None:
        """A pose reference, sent as it is; it has left when this returns."""
        with self._refusing("set_pose"):
            self._require_capability(Capability.POSITION, "set_pose")
            goal = self._places.goal(pose, "pose")
            snapshot = self._require_state("set_pose", State.FLYING_AUTO)
            local = self._places.to_local(goal, snapshot)
            yaw_rad = self._flight.start(snapshot).yaw_rad if local.yaw_rad is None else local.yaw_rad
            self._flight.refer(Hold(local.position, yaw_rad), "set_pose", snapshot)

    def set_velocity(self, velocity: TwistStamped) -> None:
        """A velocity reference; it has left when this returns."""
        with self._refusing("set_velocity"):
            self._require_capability(Capability.VELOCITY, "set_velocity")
            twist, frame_id = self._places.velocity(velocity, "velocity")
            snapshot = self._require_state("set_velocity", State.FLYING_AUTO)
            in_body = frame_id == self._places.tree.body
            if not in_body:
                twist = self._places.velocity_to_local(twist, frame_id, snapshot)
            scaled = within_limits(twist, self._limits())
            expires_s = snapshot.time_s + VELOCITY_TIMEOUT_S
            self._flight.refer(Velocity(scaled, in_body=in_body, expires_s=expires_s), "set_velocity", snapshot)

    def recover_from_manual(self) -> Future[None]:
        """Takes control back; the future ends when the state is FLYING_AUTO."""
        with self._refusing("recover_from_manual"):
            self._require_capability(Capability.RECOVER, "recover_from_manual")
            self._flight.require_replaceable("recover_from_manual")
            snapshot = self._require_state("recover_from_manual", State.FLYING_MANUAL)
            command = Command("take our references", snapshot.time_s)
            recover = Recover(command, self._limits())
            self._flight.begin(recover)
            command.send(self.backend.take_control)
            _accepted("recover_from_manual")
            return recover.future

    def set_home(self, set_z: bool = False) -> None:
        """Makes the present position the origin of ``<ns>/odom``."""
        with self._refusing("set_home"):
            snapshot = self._require_state("set_home", *_LANDED)
            self._places.set_home(measured_motion(snapshot).position, snapshot, set_z=set_z)
            _accepted("set_home", set_z=set_z)

    def abort(self, freeze: bool = False, task_id: str = "") -> None:
        """Cancels the running task (or, with `task_id`, only that one) or reference, and stops."""
        with self._refusing("abort"):
            if task_id and self.task(task_id).future.done():
                return
            snapshot = self._require_state("abort", State.FLYING_AUTO)
            motion = measured_motion(snapshot)
            stop: Reference = Hold(motion.position, motion.yaw_rad) if freeze else brake(snapshot, self._limits())
            self._flight.refer(stop, "abort", snapshot, only_task_id=task_id)
            _accepted("abort", freeze=freeze, task_id=task_id or "any")

    def _cancel(self, task: VehicleTask) -> None:
        if task.future.done():
            return
        if task.kind in (TaskKind.TAKE_OFF, TaskKind.LAND):
            raise WrongStateError(f"{task.kind.name.lower()} can be aborted by the safety pilot only")
        snapshot = self.backend.snapshot()
        if self._flight.raw_estimate(snapshot).state is State.FLYING_AUTO:
            stop = brake(snapshot, self._limits())
            self._flight.refer(stop, "cancel", snapshot, only_task_id=task.id)
        else:
            self._flight.drop(task.id, "cancel")
        _accepted("cancel", task_id=task.id)

    def _new_task(self, kind: TaskKind, description: str) -> VehicleTask:
        task = VehicleTask(kind, description, self.backend.clock, self._cancel)
        with self._lock:
            self._tasks[task.id] = task
            if len(self._tasks) > _REMEMBERED_TASKS:
                self._tasks.popitem(last=False)
        return task

    # --- Checks -------------------------------------------------------------------------------------------------------

    @contextlib.contextmanager
    def _refusing(self, command: str) -> Iterator[None]:
        """Logs a refusal; the same one, again and again (a stream of setpoints), only once in a while."""
        try:
            yield
        except UalError as error:
            text, now_s = f"{command}: {error}", time.monotonic()
            last_text, last_s = self._last_refusal
            if text != last_text or now_s - last_s > _REPEATED_REFUSAL_S:
                self._last_refusal = (text, now_s)
                logs.event(_log, logging.WARNING, "refused", command=command, reason=error.reason, why=str(error))
            raise

    def _require_capability(self, capability: Capability, command: str) -> None:
        capabilities = self.backend.info().capabilities
        if capability in capabilities:
            return
        # An autopilot that has not been heard yet is not one that cannot.
        _require_link(command, self._flight.estimate(self.backend.snapshot()))
        known = ", ".join(sorted(c.name for c in capabilities)) or "nothing of the kind"
        raise NotSupportedError(f"{command}: the backend {self.backend.name} cannot (it can: {known})")

    def _require_state(self, command: str, *allowed: State) -> Snapshot:
        """The snapshot in which the state is one of those. Raises `WrongStateError`, or `LinkLostError`."""
        if self._flight.is_closing:
            raise WrongStateError(f"{command}: UAL is shutting down and takes no more commands")
        snapshot = self.backend.snapshot()
        found = self._flight.estimate(snapshot)
        if found.state in allowed:
            return snapshot
        _require_link(command, found)
        needed = " or ".join(state.name for state in allowed)
        raise WrongStateError(
            f"{command} needs the state {needed}, but it is {found.state.name}: {found.why}",
            {"state": found.state.name, "needed": needed, "command": command},
        )

    def _is_arming_allowed(self) -> bool:
        return self._allow_arming or self.backend.simulation() is not None

    def _limits(self) -> Limits:
        """The smaller of the autopilot's limits, which it may tell anew, and the user's."""
        own = self.backend.info().limits
        if self._own_limits is not own:
            ours = self._settings.limits
            self._smaller_limits = Limits(
                *(min(getattr(ours, field.name), getattr(own, field.name)) for field in fields(Limits))
            )
            self._own_limits = own
        return self._smaller_limits

    # --- Updates ------------------------------------------------------------------------------------------------------

    def _on_update(self, snapshot: Snapshot) -> None:
        """One update, on the backend's update thread. An error here must not end the thread that flies the UAV."""
        try:
            self._update(snapshot)
        except Exception:  # noqa: BLE001  told loudly; the next update goes on
            _log.exception("an update failed; this is a defect of UAL, please report it")

    def _update(self, snapshot: Snapshot) -> None:
        self._sequence += 1
        self._places.update(snapshot)
        self._flight.step(snapshot)
        found = self._flight.estimate(snapshot)
        self._log_change(found)
        subscribers = self._subscribers
        if subscribers:
            sample = self._sample(snapshot, found)
            for callback in subscribers:
                callback(sample)

    def _log_change(self, found: Estimate) -> None:
        last, self._last_state = self._last_state, found.state
        if last is not found.state:
            level = logging.WARNING if found.state in (State.UNINITIALIZED, State.FLYING_MANUAL) else logging.INFO
            old = None if last is None else last.name
            logs.event(_log, level, "state", old=old, new=found.state.name, why=found.why)


def _require_link(command: str, found: Estimate) -> None:
    if not found.is_link_up:
        raise LinkLostError(f"{command}: {found.why}", {"state": found.state.name})


def _accepted(command: str, **fields: object) -> None:
    logs.event(_log, logging.INFO, "command", command=command, **fields)


def within_limits(twist: Twist, limits: Limits) -> Twist:
    """The velocity, scaled down where it is beyond the limits, its direction kept; the turn is limited by itself."""
    v = twist.linear
    vertical = limits.climb_speed_m_s if v.z > 0 else limits.descent_speed_m_s
    excess = max(1.0, v.horizontal_norm() / limits.horizontal_speed_m_s, abs(v.z) / vertical)
    turn = max(-limits.yaw_rate_rad_s, min(limits.yaw_rate_rad_s, twist.angular.z))
    return Twist(v / excess, Vector3(0.0, 0.0, turn))


def _text(goal: Goal) -> str:
    p = goal.position
    return f"{p.x:g}, {p.y:g}, {p.z:g} in {goal.frame_id}"
