"""One UAV above its backend: states, validation, tasks and references. Nothing here blocks.

Two kinds of threads meet here. The backend's update thread runs `_on_update` at each new snapshot: it steps the
manoeuvre, sends the setpoint and tells subscribers. Any other thread calls the members: they check, and change what is
flown. `_lock` guards what is flown; it is never held over a call to the backend, a callback, or the end of a future.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, InvalidStateError
from dataclasses import replace

from ual.errors import (
    InvalidArgumentError,
    LinkLostError,
    NotSupportedError,
    PermissionDeniedError,
    TaskAbortedError,
    UalError,
    WrongStateError,
)
from ual.geometry import Pose, PoseStamped, Quaternion, Transform, Twist, TwistStamped, Vector3
from ual.interface import Simulation
from ual.types import (
    AltitudeReference,
    Capability,
    Frame,
    Info,
    Limits,
    Odometry,
    State,
    TaskKind,
    Telemetry,
)

from ual_daemon import logs, validation
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Control, Setpoint, Snapshot
from ual_daemon.estimator import Estimate, estimate
from ual_daemon.frames import MAP, FrameTree, horizontal
from ual_daemon.geodesy import EllipsoidProjection
from ual_daemon.manoeuvres import Command, FollowTrajectory, Land, Manoeuvre, Recover, TakeOff
from ual_daemon.references import VELOCITY_TIMEOUT_S, Hold, Reference, Velocity, brake, measured_motion
from ual_daemon.settings import VehicleSettings
from ual_daemon.tasks import VehicleTask
from ual_daemon.trajectory import Motion, Trajectory, Waypoint, path
from ual_daemon.version import __version__

_log = logging.getLogger(__name__)

_SEND_PERIOD_S = 0.018
"""Setpoints go out at most so often (50 Hz with a margin for the updates' own jitter)."""
_REMEMBERED_TASKS = 200
_NEAR_REFERENCE_M = 1.0
_REPEATED_REFUSAL_S = 1.0
_HOLD_PATIENCE_S = 5.0
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
        self._tree = FrameTree(self.ns, self._settings)
        self._odom_origin = Vector3()  # in the backend's local frame
        self._lock = threading.Lock()
        self._manoeuvre: Manoeuvre | None = None
        self._reference: Reference | None = None
        self._watches: tuple[tuple[Command, Callable[[Snapshot], bool], Future[None]], ...] = ()
        self._closing: Future[None] | None = None
        self._hold: Command | None = None
        self._tasks: OrderedDict[str, VehicleTask] = OrderedDict()
        self._subscribers: tuple[Callable[[Telemetry], None], ...] = ()
        self._sequence = 0
        self._sent_s = float("-inf")
        self._last_estimate: Estimate | None = None
        self._last_refusal: tuple[str, float] = ("", 0.0)

    # --- Life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Begins to connect; see `Backend.open`."""
        self.backend.open(self._on_update)

    def close(self) -> None:
        """Ends everything at once; what still runs ends as aborted. See `prepare_shutdown` for what is safe before."""
        self.backend.close()
        with self._lock:
            manoeuvre, self._manoeuvre, self._reference = self._manoeuvre, None, None
            watches, self._watches = self._watches, ()
            closing, self._closing = self._closing, self._closing or Future()
        error = TaskAbortedError(f"{self.ns} was closed", {"by": "close"})
        if manoeuvre is not None:
            manoeuvre.end(error)
        for _, _, future in watches:
            future.set_exception(error)
        if closing is not None and not closing.done():
            closing.set_result(None)

    def prepare_shutdown(self) -> Future[None]:
        """Brings the UAV to where the daemon may leave it: a take-off or landing ends first, any other task and
        reference is cancelled, and the autopilot is told to hold its position by itself. Refuses new commands.
        """
        with self._lock:
            if self._closing is not None:
                return self._closing
            self._closing = Future()
            manoeuvre = self._manoeuvre
            if manoeuvre is not None and manoeuvre.is_replaceable:
                self._manoeuvre, self._reference = None, None
            else:
                manoeuvre = None
        if manoeuvre is not None:
            self._end(manoeuvre, TaskAbortedError(f"{manoeuvre.name}: the daemon is shutting down", {"by": "shutdown"}))
        self._shut_down_on(self.backend.snapshot())
        return self._closing

    def _shut_down_on(self, snapshot: Snapshot) -> None:
        """One step of the shutdown."""
        closing = self._closing
        if closing is None or closing.done() or self._manoeuvre is not None:
            return
        state = self._raw_estimate(snapshot).state
        if state is State.FLYING_AUTO:
            if self._hold is None:
                self._hold = Command("hold its position", snapshot.time_s)
                self._hold.send(self.backend.hold)
                logs.event(_log, logging.INFO, "hold_by_autopilot", why="the daemon is shutting down")
            if snapshot.time_s - self._hold.sent_s < _HOLD_PATIENCE_S:
                return
            failure = self._hold.failure(snapshot)
            logs.event(_log, logging.ERROR, "hold_failed", why=str(failure or "its mode did not change"))
        with self._lock:
            self._reference = None
        with contextlib.suppress(InvalidStateError):  # another thread was first
            closing.set_result(None)

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
        return self.estimate(self.backend.snapshot()).state

    def estimate(self, snapshot: Snapshot) -> Estimate:
        """The state that a snapshot says, our own manoeuvre considered."""
        manoeuvre = self._manoeuvre
        return estimate(snapshot, self.backend.freshness, None if manoeuvre is None else manoeuvre.declares)

    def telemetry(self) -> Telemetry:
        """The newest sample of everything known."""
        snapshot = self.backend.snapshot()
        return self._telemetry(snapshot, self.estimate(snapshot))

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
        found = self._tree.lookup(target_frame_id or MAP, source_frame_id or self._tree.body, self._body(snapshot))
        return replace(found, stamp_s=snapshot.stamp_s)

    def frames(self) -> list[Frame]:
        """All frames."""
        return self._tree.frames(self._body(self.backend.snapshot()))

    def add_frame(self, transform: Transform) -> None:
        """Adds a frame, or moves one that was added."""
        with self._commanded("add_frame", frame=transform.child_frame_id):
            self._tree.add(validation.transform(transform, "transform"))

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

    # --- Commands -----------------------------------------------------------------------------------------------------

    def arm(self) -> Future[None]:
        """Arms; the future ends when the autopilot says so."""
        return self._arm_or_disarm("arm", State.LANDED_DISARMED, is_armed=True)

    def disarm(self) -> Future[None]:
        """Disarms; the future ends when the autopilot says so."""
        return self._arm_or_disarm("disarm", State.LANDED_ARMED, is_armed=False)

    def take_off(self, height_m: float) -> VehicleTask:
        """Climbs to a height above where it stands."""
        with self._commanded("take_off", height_m=height_m):
            self._require_capability(Capability.TAKE_OFF, "take_off")
            height_m = validation.positive(height_m, "height_m", at_most=validation.MAX_DISTANCE_M)
            snapshot = self._require_state("take_off", State.LANDED_ARMED)
            self._require_replaceable("take_off")
            task = self._new_task(TaskKind.TAKE_OFF, f"take off to {height_m:g} m")
            command = Command("take off", snapshot.time_s)
            on_setpoints = self.backend.info().flies_takeoff_on_setpoints
            self._begin(
                TakeOff(
                    task,
                    command,
                    snapshot,
                    height_m,
                    self._limits(),
                    self._settings.tolerance,
                    on_setpoints=on_setpoints,
                )
            )
            command.send(lambda: self.backend.take_off(height_m))
            return task

    def land(self) -> VehicleTask:
        """Lands where it is."""
        with self._commanded("land"):
            self._require_capability(Capability.LAND, "land")
            snapshot = self._require_state("land", State.FLYING_AUTO)
            self._require_replaceable("land")
            task = self._new_task(TaskKind.LAND, "land")
            stop = brake(snapshot, self._limits())
            command = Command("land", snapshot.time_s)
            self._begin(Land(task, command, stop, snapshot))
            command.send(self.backend.land)
            return task

    def go_to_waypoint(self, waypoint: PoseStamped) -> VehicleTask:
        """Flies straight to a pose in any frame."""
        with self._commanded("go_to_waypoint", waypoint=waypoint):
            self._require_capability(Capability.POSITION, "go_to_waypoint")
            goal = self._goal(waypoint, "waypoint")
            snapshot = self._require_state("go_to_waypoint", State.FLYING_AUTO)
            goals = [self._to_local(goal, waypoint.frame_id, "waypoint", snapshot)]
            return self._follow(TaskKind.GO_TO_WAYPOINT, f"go to {_text(waypoint)}", goals, 0.0, snapshot)

    def go_to_waypoint_geo(
        self,
        latitude_deg: float,
        longitude_deg: float,
        altitude_m: float,
        altitude_reference: AltitudeReference = AltitudeReference.HOME,
        yaw_rad: float | None = None,
    ) -> VehicleTask:
        """Flies straight to a geographic position."""
        with self._commanded(
            "go_to_waypoint_geo",
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            altitude_m=altitude_m,
            altitude_reference=altitude_reference.name,
        ):
            self._require_capability(Capability.GEO, "go_to_waypoint_geo")
            latitude_deg = validation.latitude(latitude_deg)
            longitude_deg = validation.longitude(longitude_deg)
            altitude_m = validation.number(altitude_m, "altitude_m", at_most=validation.MAX_DISTANCE_M)
            if yaw_rad is not None:
                yaw_rad = validation.number(yaw_rad, "yaw_rad", at_most=1e6)
            snapshot = self._require_state("go_to_waypoint_geo", State.FLYING_AUTO)
            if snapshot.projection is None:
                raise WrongStateError("the autopilot has not said where its local frame is on Earth")
            altitude_amsl_m = _altitude_amsl_m(altitude_m, altitude_reference, snapshot)
            position = snapshot.projection.to_local(latitude_deg, longitude_deg, altitude_amsl_m)
            what = f"go to {latitude_deg:.7f}, {longitude_deg:.7f} at {altitude_m:g} m ({altitude_reference.name})"
            return self._follow(TaskKind.GO_TO_WAYPOINT_GEO, what, [Waypoint(position, yaw_rad)], 0.0, snapshot)

    def follow_path(self, waypoints: Sequence[PoseStamped], corner_radius_m: float = 0.0) -> VehicleTask:
        """Flies through waypoints."""
        with self._commanded("follow_path", waypoints=len(waypoints), corner_radius_m=corner_radius_m):
            self._require_capability(Capability.POSITION, "follow_path")
            if not waypoints:
                raise validation.refuse("waypoints", "there are none; a path needs at least one")
            if len(waypoints) > _MAX_WAYPOINTS:
                raise validation.refuse("waypoints", f"{len(waypoints)} are more than {_MAX_WAYPOINTS}")
            radius_m = validation.not_negative(corner_radius_m, "corner_radius_m", at_most=validation.MAX_DISTANCE_M)
            goals = [self._goal(waypoint, f"waypoints[{i}]") for i, waypoint in enumerate(waypoints)]
            snapshot = self._require_state("follow_path", State.FLYING_AUTO)
            local = [
                self._to_local(goal, waypoint.frame_id, f"waypoints[{i}]", snapshot)
                for i, (goal, waypoint) in enumerate(zip(goals, waypoints, strict=True))
            ]
            what = f"follow {len(waypoints)} waypoints to {_text(waypoints[-1])}"
            return self._follow(TaskKind.FOLLOW_PATH, what, local, radius_m, snapshot)

    def set_pose(self, pose: PoseStamped) -> None:
        """A pose reference, sent as it is; it has left when this returns."""
        with self._refusing("set_pose"):
            self._require_capability(Capability.POSITION, "set_pose")
            goal = self._goal(pose, "pose")
            snapshot = self._require_state("set_pose", State.FLYING_AUTO)
            local = self._to_local(goal, pose.frame_id, "pose", snapshot)
            yaw_rad = self._start(snapshot).yaw_rad if local.yaw_rad is None else local.yaw_rad
            self._refer(Hold(local.position, yaw_rad), "set_pose", snapshot)

    def set_velocity(self, velocity: TwistStamped) -> None:
        """A velocity reference; it has left when this returns."""
        with self._refusing("set_velocity"):
            self._require_capability(Capability.VELOCITY, "set_velocity")
            twist = validation.twist(velocity.twist, "velocity.twist")
            frame_id = velocity.frame_id
            self._require_frame(frame_id, "velocity")
            snapshot = self.backend.snapshot()
            in_body = frame_id == self._tree.body
            if not in_body and frame_id and frame_id != self._tree.odom:
                body = self._body(snapshot)
                turn = self._tree.lookup(self._tree.odom, frame_id, body and horizontal(body)).rotation
                twist = Twist(turn.rotate(twist.linear), turn.rotate(twist.angular))
            self._require_state("set_velocity", State.FLYING_AUTO, snapshot=snapshot)
            scaled = within_limits(twist, self._limits())
            expires_s = snapshot.time_s + VELOCITY_TIMEOUT_S
            self._refer(Velocity(scaled, in_body=in_body, expires_s=expires_s), "set_velocity", snapshot)

    def recover_from_manual(self) -> Future[None]:
        """Takes control back; the future ends when the state is FLYING_AUTO."""
        with self._commanded("recover_from_manual"):
            self._require_capability(Capability.RECOVER, "recover_from_manual")
            snapshot = self._require_state("recover_from_manual", State.FLYING_MANUAL)
            self._require_replaceable("recover_from_manual")
            command = Command("take our references", snapshot.time_s)
            recover = Recover(command, self._limits())
            self._begin(recover)
            command.send(self.backend.take_control)
            return recover.future

    def set_home(self, set_z: bool = False) -> None:
        """Makes the present position the origin of ``<ns>/odom``."""
        with self._commanded("set_home", set_z=set_z):
            snapshot = self._require_state("set_home", *_LANDED)
            here = measured_motion(snapshot).position
            with self._lock:
                self._odom_origin = here if set_z else Vector3(here.x, here.y, self._odom_origin.z)
            self._place_home(snapshot, is_moved=True)

    def abort(self, freeze: bool = False, task_id: str = "") -> None:
        """Cancels the running task (or, with `task_id`, only that one) or reference, and stops."""
        with self._commanded("abort", freeze=freeze, task_id=task_id or "any"):
            snapshot = self._require_state("abort", State.FLYING_AUTO)
            if task_id and self.task(task_id).future.done():
                return
            motion = measured_motion(snapshot)
            stop: Reference = Hold(motion.position, motion.yaw_rad) if freeze else self._brake_reference(snapshot)
            self._refer(stop, "abort", snapshot, only_task_id=task_id)

    def _cancel(self, task: VehicleTask) -> None:
        manoeuvre = self._manoeuvre
        if task.future.done() or manoeuvre is None or manoeuvre.task is not task:
            return
        if not manoeuvre.is_replaceable:
            raise WrongStateError(f"{manoeuvre.name} can be aborted by the safety pilot only")
        snapshot = self.backend.snapshot()
        logs.event(_log, logging.INFO, "command", command="cancel", task_id=task.id)
        can_stop = snapshot.pose is not None and self._raw_estimate(snapshot).state is State.FLYING_AUTO
        if can_stop:
            self._refer(self._brake_reference(snapshot), "cancel", snapshot, only_task_id=task.id)
        else:
            self._begin(None, replaced=manoeuvre, by="cancel")

    # --- Checks -------------------------------------------------------------------------------------------------------

    @contextlib.contextmanager
    def _commanded(self, command: str, **fields: object) -> Iterator[None]:
        """Logs a command, or its refusal."""
        with self._refusing(command):
            if self._closing is not None:
                raise WrongStateError("the daemon is shutting down and takes no more commands")
            yield
        logs.event(_log, logging.INFO, "command", command=command, **fields)

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
        info = self.backend.info()
        if capability not in info.capabilities:
            snapshot = self.backend.snapshot()
            self._require_link(command, self.estimate(snapshot))
            known = ", ".join(sorted(c.name for c in info.capabilities)) or "nothing"
            raise NotSupportedError(f"{command}: the backend {self.backend.name} cannot (it can: {known})")

    def _require_link(self, command: str, found: Estimate) -> None:
        if not found.is_link_up:
            raise LinkLostError(f"{command}: {found.why}", {"state": found.state.name})

    def _require_state(self, command: str, *allowed: State, snapshot: Snapshot | None = None) -> Snapshot:
        """The snapshot in which the state is one of those. Raises `WrongStateError`, or `LinkLostError`."""
        if self._closing is not None:
            raise WrongStateError(f"{command}: the daemon is shutting down and takes no more commands")
        if snapshot is None:
            snapshot = self.backend.snapshot()
        found = self.estimate(snapshot)
        if found.state in allowed:
            return snapshot
        self._require_link(command, found)
        needed = " or ".join(state.name for state in allowed)
        raise WrongStateError(
            f"{command} needs the state {needed}, but it is {found.state.name}: {found.why}",
            {"state": found.state.name, "needed": needed, "command": command},
        )

    def _require_replaceable(self, command: str) -> None:
        manoeuvre = self._manoeuvre
        if manoeuvre is not None and not manoeuvre.is_replaceable:
            state = self.state().name
            raise WrongStateError(
                f"{command}: {manoeuvre.name} is under way and can be aborted by the safety pilot only",
                {"state": state, "command": command},
            )

    def _is_arming_allowed(self) -> bool:
        return self._allow_arming or self.backend.simulation() is not None

    def _limits(self) -> Limits:
        ours, own = self._settings.limits, self.backend.info().limits
        return Limits(
            min(ours.horizontal_speed_m_s, own.horizontal_speed_m_s),
            min(ours.climb_speed_m_s, own.climb_speed_m_s),
            min(ours.descent_speed_m_s, own.descent_speed_m_s),
            min(ours.horizontal_acceleration_m_s2, own.horizontal_acceleration_m_s2),
            min(ours.vertical_acceleration_m_s2, own.vertical_acceleration_m_s2),
            min(ours.yaw_rate_rad_s, own.yaw_rate_rad_s),
        )

    # --- Frames -------------------------------------------------------------------------------------------------------

    def _body(self, snapshot: Snapshot) -> Pose | None:
        """The body in ``<ns>/odom``."""
        if snapshot.pose is None:
            return None
        pose = snapshot.pose.value
        return Pose(pose.position - self._odom_origin, pose.orientation)

    def _require_frame(self, frame_id: str, field: str) -> None:
        if frame_id:
            self._tree.require(validation.frame_id(frame_id, f"{field}.header.frame_id"))

    def _goal(self, goal: PoseStamped, field: str) -> tuple[Vector3, Quaternion | None]:
        """A goal in its own frame, checked: position and orientation (None: keep the heading)."""
        self._require_frame(goal.frame_id, field)
        return (
            validation.position(goal.pose.position, f"{field}.pose.position"),
            validation.orientation(goal.pose.orientation, f"{field}.pose.orientation"),
        )

    def _to_local(
        self, goal: tuple[Vector3, Quaternion | None], frame_id: str, field: str, snapshot: Snapshot
    ) -> Waypoint:
        """A checked goal in the backend's local frame."""
        position, turn = goal
        if frame_id and frame_id != self._tree.odom:
            body = self._body(snapshot)
            to_odom = self._tree.lookup(self._tree.odom, frame_id, body and horizontal(body))
            position = validation.position(to_odom.apply(position), f"{field}.pose.position (in {self._tree.odom})")
            turn = turn and to_odom.rotation * turn
        return Waypoint(position + self._odom_origin, turn.yaw_rad if turn else None)

    def _place_home(self, snapshot: Snapshot, *, is_moved: bool = False) -> None:
        """Where the place of ``<ns>/odom`` follows from `map_origin_geo`: as soon as that can be told."""
        origin = self._settings.map_origin_geo
        if origin is None or snapshot.projection is None or (self._tree.has_home() and not is_moved):
            return
        home = snapshot.projection.to_geo(self._odom_origin)
        assert home.altitude_amsl_m is not None
        in_map = EllipsoidProjection(*origin).to_local(home.latitude_deg, home.longitude_deg, home.altitude_amsl_m)
        self._tree.set_home(in_map)
        logs.event(_log, logging.INFO, "home_pose", frame=MAP, x=in_map.x, y=in_map.y, z=in_map.z)

    # --- What is flown ------------------------------------------------------------------------------------------------

    def _new_task(self, kind: TaskKind, description: str) -> VehicleTask:
        task = VehicleTask(kind, description, self.backend.clock, self._cancel)
        with self._lock:
            self._tasks[task.id] = task
            if len(self._tasks) > _REMEMBERED_TASKS:
                self._tasks.popitem(last=False)
        return task

    def _follow(
        self, kind: TaskKind, what: str, goals: Sequence[Waypoint], corner_radius_m: float, snapshot: Snapshot
    ) -> VehicleTask:
        name = kind.name.lower()
        self._require_replaceable(name)
        trajectory: Trajectory = path(self._start(snapshot), goals, corner_radius_m, self._limits())
        task = self._new_task(kind, what)
        self._begin(FollowTrajectory(name, task, trajectory, self._settings.tolerance))
        return task

    def _start(self, snapshot: Snapshot) -> Motion:
        """Where a trajectory begins: at the reference that is flown, so that it does not jump, unless that is far
        from where the UAV is.
        """
        measured = measured_motion(snapshot)
        manoeuvre = self._manoeuvre
        reference = self._reference if manoeuvre is None else manoeuvre.pose_reference()
        if reference is None:
            return measured
        motion = reference.motion(snapshot)
        return motion if (motion.position - measured.position).norm() <= _NEAR_REFERENCE_M else measured

    def _brake_reference(self, snapshot: Snapshot) -> Reference:
        return brake(snapshot, self._limits())

    def _begin(self, manoeuvre: Manoeuvre | None, *, replaced: Manoeuvre | None = None, by: str = "") -> None:
        """Makes a manoeuvre the one that is flown, and ends the one that was. With `replaced`, only if it still is."""
        with self._lock:
            old = self._manoeuvre
            if replaced is not None and old is not replaced:
                return
            if old is not None and not old.is_replaceable:
                refused = manoeuvre
            else:
                refused = None
                self._manoeuvre = manoeuvre
                if manoeuvre is not None:
                    self._reference = None
        if refused is not None:
            assert old is not None
            error = WrongStateError(f"{old.name} is under way and can be aborted by the safety pilot only")
            self._end(refused, error)
            raise error
        if old is not None:
            by = by or (manoeuvre.name if manoeuvre is not None else "")
            self._end(old, _replaced(old, by))

    def _refer(self, reference: Reference, by: str, snapshot: Snapshot, *, only_task_id: str = "") -> None:
        """Makes a reference what is flown, in place of a manoeuvre, and sends its setpoint."""
        with self._lock:
            old = self._manoeuvre
            if only_task_id and (old is None or old.task is None or old.task.id != only_task_id):
                return
            if old is not None and not old.is_replaceable:
                raise WrongStateError(f"{by}: {old.name} is under way and can be aborted by the safety pilot only")
            self._manoeuvre, self._reference = None, reference
        self.backend.send(reference.setpoint(snapshot))
        if old is not None:
            self._end(old, _replaced(old, by))

    def _end(self, manoeuvre: Manoeuvre, error: UalError | None) -> None:
        fields: dict[str, object] = {"task": manoeuvre.name}
        if manoeuvre.task is not None:
            fields["task_id"] = manoeuvre.task.id
        if error is None:
            logs.event(_log, logging.INFO, "task_done", **fields)
        else:
            logs.event(_log, logging.WARNING, "task_ended", **fields, reason=error.reason, why=str(error))
        manoeuvre.end(error)

    def _arm_or_disarm(self, name: str, needed: State, *, is_armed: bool) -> Future[None]:
        with self._commanded(name):
            self._require_capability(Capability.ARM, name)
            if not self._is_arming_allowed():
                raise PermissionDeniedError(
                    f"{name}: arming belongs to the safety pilot; this daemon may arm only when started with "
                    "--allow-arming"
                )
            snapshot = self._require_state(name, needed)
            command = Command(name, snapshot.time_s)
            future: Future[None] = Future()
            future.set_running_or_notify_cancel()
            watch = (command, lambda newer: newer.armed is not None and newer.armed.value is is_armed, future)
            with self._lock:
                self._watches = (*self._watches, watch)
            command.send(self.backend.arm if is_armed else self.backend.disarm)
            return future

    # --- Updates ------------------------------------------------------------------------------------------------------

    def _raw_estimate(self, snapshot: Snapshot) -> Estimate:
        """What the data say by themselves, whatever we do."""
        return estimate(snapshot, self.backend.freshness)

    def _on_update(self, snapshot: Snapshot) -> None:
        """One update, on the backend's update thread. An error here must not end the thread that flies the UAV."""
        try:
            self._update(snapshot)
        except Exception:  # noqa: BLE001  told loudly; the next update goes on
            _log.critical("an update failed; this is a defect of ual-daemon, please report it", exc_info=True)

    def _update(self, snapshot: Snapshot) -> None:
        self._sequence += 1
        self._place_home(snapshot)
        raw = self._raw_estimate(snapshot)
        if not self._step_manoeuvre(snapshot, raw):
            self._step_reference(snapshot, raw)
        for watch in self._watches:
            self._check_watch(watch, snapshot)
        if self._closing is not None:
            self._shut_down_on(snapshot)
        found = self.estimate(snapshot)
        self._log_change(found)
        subscribers = self._subscribers
        if subscribers:
            telemetry = self._telemetry(snapshot, found)
            for callback in subscribers:
                callback(telemetry)

    def _step_manoeuvre(self, snapshot: Snapshot, raw: Estimate) -> bool:
        """Steps what is under way; False when nothing is."""
        manoeuvre = self._manoeuvre
        if manoeuvre is None:
            return False
        step = manoeuvre.step(snapshot, raw)
        if not step.has_ended:
            if step.setpoint is not None:
                self._send(step.setpoint, snapshot, manoeuvre)
            return True
        with self._lock:
            if self._manoeuvre is not manoeuvre:
                return True  # replaced meanwhile: whoever replaced it ends it
            self._manoeuvre, self._reference = None, step.then
        self._end(manoeuvre, step.error)
        return False

    def _step_reference(self, snapshot: Snapshot, raw: Estimate) -> None:
        """Sends the reference while the autopilot follows ours; stops, and forgets it, as soon as it does not."""
        reference = self._reference
        is_ours = snapshot.mode is not None and snapshot.mode.value.control is Control.REFERENCES
        # On the ground a reference that is there goes on (a descent that has touched down must not lose its stream
        # before the autopilot disarms), but none begins.
        may_go_on = raw.state is State.FLYING_AUTO or (raw.state is State.LANDED_ARMED and is_ours)
        if not may_go_on or (reference is None and raw.state is not State.FLYING_AUTO):
            if reference is not None:
                with self._lock:
                    if self._reference is reference:
                        self._reference = None
            return
        renewed = reference
        if reference is None:
            renewed = brake(snapshot, self._limits())
        elif isinstance(reference, Velocity) and snapshot.time_s > reference.expires_s:
            renewed = brake(snapshot, self._limits())
            logs.event(_log, logging.INFO, "velocity_ended", why=f"no new one within {VELOCITY_TIMEOUT_S:g} s")
        if renewed is not reference:
            with self._lock:
                if self._reference is not reference or self._manoeuvre is not None:
                    return  # somebody gave a newer one
                self._reference = renewed
        assert renewed is not None
        self._send(renewed.setpoint(snapshot), snapshot, None)

    def _send(self, setpoint: Setpoint, snapshot: Snapshot, manoeuvre: Manoeuvre | None) -> None:
        if snapshot.time_s - self._sent_s < _SEND_PERIOD_S or self._manoeuvre is not manoeuvre:
            return
        self._sent_s = snapshot.time_s
        self.backend.send(setpoint)

    def _check_watch(self, watch: tuple[Command, Callable[[Snapshot], bool], Future[None]], snapshot: Snapshot) -> None:
        command, is_done, future = watch
        done = is_done(snapshot)
        error = None if done else command.failure(snapshot)
        if not done and error is None:
            return
        with self._lock:
            self._watches = tuple(other for other in self._watches if other is not watch)
        if error is None:
            future.set_result(None)
        else:
            logs.event(_log, logging.WARNING, "command_failed", reason=error.reason, why=str(error))
            future.set_exception(error)

    def _log_change(self, found: Estimate) -> None:
        last, self._last_estimate = self._last_estimate, found
        if last is None or last.state is not found.state:
            level = logging.WARNING if found.state in (State.UNINITIALIZED, State.FLYING_MANUAL) else logging.INFO
            old = None if last is None else last.state.name
            logs.event(_log, level, "state", old=old, new=found.state.name, why=found.why)

    # --- Telemetry ----------------------------------------------------------------------------------------------------

    def _telemetry(self, snapshot: Snapshot, found: Estimate) -> Telemetry:
        body = self._body(snapshot)
        twist = None if snapshot.velocity is None else snapshot.velocity.value
        frame_id = self._tree.odom
        to_frame: Transform | None = None
        wanted = self._settings.pose_frame_id
        if wanted is not None and wanted != frame_id:
            with contextlib.suppress(WrongStateError):  # not known yet where it is: <ns>/odom until then
                to_frame = self._tree.lookup(wanted, self._tree.odom, body)
                frame_id = wanted
        pose, velocity = body, twist
        if to_frame is not None:
            pose = None if body is None else to_frame.apply_pose(body)
            velocity = None if twist is None else Twist(to_frame.rotation.rotate(twist.linear), twist.angular)
        reference = self._reference_pose()
        if reference is not None and to_frame is not None:
            reference = to_frame.apply_pose(reference)
        manoeuvre = self._manoeuvre
        task = None if manoeuvre is None or manoeuvre.task is None else manoeuvre.task.info()
        return Telemetry(
            state=found.state,
            state_reason=found.why,
            stamp_s=snapshot.stamp_s,
            frame_id=frame_id,
            pose=pose,
            velocity=velocity,
            odometry=self._odometry(snapshot, body, twist),
            transform=self._map_transform(snapshot, body),
            reference_pose=reference,
            position_geo=snapshot.position_geo,
            battery=snapshot.battery,
            gps=snapshot.gps,
            flight_mode="" if snapshot.mode is None else snapshot.mode.value.name,
            armed=snapshot.armed is not None and snapshot.armed.value,
            task=task,
            sequence=self._sequence,
            status_text=snapshot.status_text,
        )

    def _odometry(self, snapshot: Snapshot, body: Pose | None, twist: Twist | None) -> Odometry | None:
        if body is None or twist is None:
            return None
        in_body = Twist(body.orientation.inverse().rotate(twist.linear), twist.angular)
        return Odometry(body, in_body, self._tree.odom, self._tree.body, snapshot.stamp_s)

    def _map_transform(self, snapshot: Snapshot, body: Pose | None) -> Transform | None:
        if body is None:
            return None
        try:
            found = self._tree.lookup(MAP, self._tree.body, body)
        except WrongStateError:  # not known yet where <ns>/odom is in map
            return None
        return replace(found, stamp_s=snapshot.stamp_s)

    def _reference_pose(self) -> Pose | None:
        manoeuvre = self._manoeuvre
        reference = self._reference if manoeuvre is None else manoeuvre.pose_reference()
        pose = None if reference is None else reference.pose()
        return None if pose is None else Pose(pose.position - self._odom_origin, pose.orientation)


def within_limits(twist: Twist, limits: Limits) -> Twist:
    """The velocity, scaled down where it is beyond the limits, its direction kept; the turn is limited by itself."""
    v = twist.linear
    vertical = limits.climb_speed_m_s if v.z > 0 else limits.descent_speed_m_s
    excess = max(1.0, v.horizontal_norm() / limits.horizontal_speed_m_s, abs(v.z) / vertical)
    turn = max(-limits.yaw_rate_rad_s, min(limits.yaw_rate_rad_s, twist.angular.z))
    return Twist(v / excess, Vector3(0.0, 0.0, turn))


def _altitude_amsl_m(altitude_m: float, reference: AltitudeReference, snapshot: Snapshot) -> float:
    if reference is AltitudeReference.AMSL:
        return altitude_m
    if reference is AltitudeReference.ELLIPSOID:
        if snapshot.geoid_separation_m is None:
            raise NotSupportedError("the autopilot does not say how the ellipsoid lies to mean sea level here")
        return altitude_m - snapshot.geoid_separation_m
    if snapshot.home_altitude_amsl_m is None:
        raise WrongStateError("the autopilot has not said where its home is; give the altitude as AMSL")
    return snapshot.home_altitude_amsl_m + altitude_m


def _replaced(old: Manoeuvre, by: str) -> TaskAbortedError:
    how = "cancelled" if by in ("cancel", "abort") else f"replaced by {by}"
    return TaskAbortedError(f"{old.name}: {how}", {"by": by, "state": State.FLYING_AUTO.name})


def _text(goal: PoseStamped) -> str:
    p = goal.pose.position
    return f"{p.x:g}, {p.y:g}, {p.z:g}" + (f" in {goal.frame_id}" if goal.frame_id else "")
