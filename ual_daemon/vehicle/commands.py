"""The commands of one UAV: each is checked, planned, and then begun, or not (a dry run)."""

from __future__ import annotations

from concurrent.futures import Future
from functools import partial

from ual.errors import LeaseHeldError, LeaseLostError, LinkLostError, PermissionDeniedError, UalError, WrongStateError
from ual.geometry import TwistStamped, Vector3
from ual.shared.flags import flag
from ual.types import (
    Capability,
    FollowPathRequest,
    GoToWaypointGeoRequest,
    GoToWaypointRequest,
    LandRequest,
    Limits,
    MotionRequest,
    Plan,
    RecoverFromManualRequest,
    ReturnToLaunchRequest,
    State,
    TakeOffRequest,
    TaskKind,
    TaskRequest,
)
from ual_daemon import validation
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Cause, Control, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.flight import CommandOrigin, Flight, LastCommand
from ual_daemon.flight.manoeuvres.await_arming import AwaitArming, is_after_landing
from ual_daemon.flight.manoeuvres.manoeuvre import Handover
from ual_daemon.flight.manoeuvres.recover import Recover
from ual_daemon.flight.manoeuvres.take_off import TakeOffManoeuvre
from ual_daemon.flight.policy.lease import NOBODY
from ual_daemon.flight.refusals import just_taken, on_mission
from ual_daemon.flight.tasks import Tasks, VehicleTask
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.settings import VehicleSettings
from ual_daemon.tracker.references import Hold, Reference, measured_motion
from ual_daemon.trajectory import StraightTrajectory
from ual_daemon.vehicle.admission import admit
from ual_daemon.vehicle.distance_limit import DistanceLimit
from ual_daemon.vehicle.landings import Landings
from ual_daemon.vehicle.planner import Planner
from ual_daemon.vehicle.preconditions import Preconditions
from ual_daemon.vehicle.prepared import Prepared
from ual_daemon.vehicle.refusal_log import accepted
from ual_daemon.vehicle.setpoints import VehicleSetpoints

_LANDED = (State.LANDED_DISARMED, State.LANDED_ARMED)
_ON_WAY_UP = (*_LANDED, State.TAKING_OFF)
_NOT_FLOWN_YET = (*_ON_WAY_UP, State.FLYING_MANUAL)
_SEEN = tuple(state for state in State if state is not State.UNINITIALIZED)


def _climb(height_m: float, bounds: Limits, snapshot: Snapshot) -> StraightTrajectory:
    """Returns the straight way up from where the UAV stands."""
    ground = measured_motion(snapshot)
    top = ground.position + Vector3(0.0, 0.0, height_m)
    return StraightTrajectory(Hold(ground.position, ground.yaw_rad).motion(snapshot), top, ground.yaw_rad, bounds)


class Commands:
    """The commands of one UAV. Any thread may call; only the planning of a long path blocks.

    `ual.interface.Uav` says what each command means, and which errors of `ual.errors` it raises. A command that takes
    time returns a future or a `VehicleTask`, which ends when it is done. `lease_id` is the lease by which a command is
    given; without one it is refused while another program holds the lease.
    """

    def __init__(
        self,
        backend: Backend,
        flight: Flight,
        resolver: FrameResolver,
        tasks: Tasks,
        settings: VehicleSettings,
        *,
        allow_arming: bool,
    ) -> None:
        self._preconditions = preconditions = Preconditions(backend, flight)
        self._backend = backend
        self._flight = flight
        self._resolver = resolver
        self._tasks = tasks
        self._tolerance = settings.tolerance
        self._allow_arming = allow_arming
        self.is_armed_automatically = False
        """Whether a simulated safety pilot arms whenever the UAV is ready on the ground: a take-off waits for that."""
        distance_limit = DistanceLimit(settings)
        self._landings = Landings(backend, flight)
        flight.land_here = self._land_where_it_fell
        self._planner = Planner(
            backend, flight, resolver, preconditions, tasks, settings, distance_limit, self._landings
        )
        self.setpoints = VehicleSetpoints(flight, resolver, preconditions, distance_limit)
        """The commands that are sent as they are: `set_pose` and `set_velocity`."""

    # --- Motions ------------------------------------------------------------------------------------------------------

    @property
    def last_command(self) -> LastCommand:
        """The newest command that began; see `prepare`."""
        return self._flight.last_command

    def prepare(
        self, request: TaskRequest, lease_id: str = NOBODY, since: LastCommand | None = None
    ) -> Prepared[VehicleTask]:
        """Checks and plans a task. Nothing has begun yet when this returns.

        Args:
            request: The task.
            lease_id: The lease by which it is given.
            since: The `last_command` when the request was received; None if it was received just now. The prepared task
                does not replace a command that began after it.

        """
        order = CommandOrigin(lease_id, since or self._flight.last_command)
        if isinstance(request, TakeOffRequest):
            return self._take_off(request, CommandOrigin(lease_id))
        if isinstance(request, LandRequest):
            return self._land(CommandOrigin(lease_id))
        if isinstance(request, GoToWaypointRequest):
            return self._planner.go_to_waypoint(request, order)
        if isinstance(request, GoToWaypointGeoRequest):
            return self._planner.go_to_waypoint_geo(request, order)
        if isinstance(request, ReturnToLaunchRequest):
            return self._planner.return_to_launch(request, order)
        assert isinstance(request, FollowPathRequest)
        return self._planner.follow_path(request, order)

    def plan(self, motion: MotionRequest, lease_id: str = NOBODY) -> Plan:
        """Makes a dry run: returns the plan of a motion, or raises the error by which it would be refused."""
        if isinstance(motion, RecoverFromManualRequest):
            return self.recover_from_manual(lease_id, force=motion.force).plan
        if isinstance(motion, TaskRequest):
            return self.prepare(motion, lease_id).plan
        if isinstance(motion, TwistStamped):
            return self.setpoints.plan_velocity(motion, lease_id)
        return self.setpoints.plan_pose(motion, lease_id)

    def _take_off(self, request: TakeOffRequest, order: CommandOrigin) -> Prepared[VehicleTask]:
        """Prepares a climb to a height above where the UAV stands."""
        with self._preconditions.logging_refusal("take_off"):
            self._preconditions.require_capability(Capability.TAKE_OFF, "take_off")
            is_forced = flag(request.force, "force")
            height_m = validation.positive(request.height_m, "height_m", at_most=validation.MAX_DISTANCE_M)
            self._flight.require_replaceable("take_off")
            if self._flight.is_on_mission and not self._flight.is_stopping_mission:  # which takes off by itself
                raise on_mission("take_off")
            snapshot = self._require_armed_for_take_off(order.lease_id)
            self._preconditions.require_own_ground("take_off")
            self._preconditions.require_no_fall("take_off", snapshot)
            self._preconditions.require_no_failsafe("take_off", snapshot, force=is_forced)
            bounds = self._flight.limits.get()
            on_setpoints = self._backend.info().flies_takeoff_on_setpoints
            # The clearance is for those that fly: a take-off begins on the ground, and may end lower.
            least_m = max(height_m, self._flight.geofence.clearance_m)
            admit(self._flight, "take_off", _climb(least_m, bounds, snapshot), snapshot)
            line = _climb(height_m, bounds, snapshot)
            # Where the autopilot climbs by itself, it does at its own speed.
            plan = Plan(line.length_m, line.duration_s if on_setpoints else None)

        def climb_from(start: Snapshot, task: VehicleTask) -> Handover:
            command = AutopilotCommand("take off")
            climb = TakeOffManoeuvre(
                task,
                command,
                start,
                height_m,
                bounds,
                self._tolerance,
                on_setpoints=on_setpoints,
                has_safety_pilot=self._flight.has_safety_pilot,
            )
            return Handover(climb, lambda: command.send(lambda: self._backend.take_off(height_m, bounds), start))

        def begin() -> VehicleTask:
            with self._preconditions.logging_refusal("take_off"):
                task = self._tasks.new(TaskKind.TAKE_OFF, f"take off to {height_m:g} m")
                if self._is_to_be_armed(snapshot):
                    wait = AwaitArming(task, lambda now: climb_from(now, task), snapshot.time_s)
                    self._flight.begin(wait, order)
                else:
                    climb, send = climb_from(snapshot, task)
                    self._flight.begin(climb, order, snapshot)
                    send()
                accepted("take_off", task_id=task.id, height_m=height_m)
                return task

        return Prepared(plan, begin)

    def _require_armed_for_take_off(self, lease_id: str) -> Snapshot:
        """Returns the snapshot in which a take-off may begin, or wait for the automatic arming."""
        try:
            return self._preconditions.require_state("take_off", lease_id, State.LANDED_ARMED)
        except WrongStateError as error:
            if error.state != State.LANDED_DISARMED.name:
                raise
            if self.is_armed_automatically:
                return self._preconditions.require_state("take_off", lease_id, *_LANDED)
            raise WrongStateError(f"{error.message}; {self._how_to_arm()}", error.metadata) from None

    def _is_to_be_armed(self, snapshot: Snapshot) -> bool:
        """Returns whether a take-off waits for the automatic arming, which comes, too, when the autopilot disarms after
        a landing.
        """
        is_armed = snapshot.control.armed is not None and snapshot.control.armed.value
        return self.is_armed_automatically and (not is_armed or is_after_landing(snapshot))

    def _how_to_arm(self) -> str:
        if self.is_arming_allowed:
            return "arm it before (arm, `ual arm`), also after each landing: the autopilot then disarms"
        return (
            "its safety pilot arms it (wait_for, `ual wait landed_armed`), also after each landing: the autopilot then "
            "disarms"
        )

    def _land(self, order: CommandOrigin) -> Prepared[VehicleTask]:
        """Prepares a landing at the present position, also out of a mode in which the autopilot flies by itself."""
        with self._preconditions.logging_refusal("land"):
            self._preconditions.require_capability(Capability.LAND, "land")
            self._flight.require_replaceable("land")
            snapshot = self._preconditions.require_no_pilot("land", order.lease_id)
            self._preconditions.require_no_mission_of_others("land", snapshot)

        def begin() -> VehicleTask:
            with self._preconditions.logging_refusal("land"):
                task = self._tasks.new(TaskKind.LAND, "land")
                landing, send = self._landings.here(task, snapshot)
                self._flight.begin(landing, order, snapshot)
                send()
                accepted("land", task_id=task.id)
                return task

        return Prepared(Plan(), begin)

    def _land_where_it_fell(self, snapshot: Snapshot) -> Handover | None:
        """Returns the landing on the spot of a UAV that does not follow; None where its backend has none."""
        if Capability.LAND not in self._backend.info().capabilities:
            return None
        task = self._tasks.new(TaskKind.LAND, "land on the spot, as the UAV does not follow")
        return self._landings.here(task, snapshot)

    def recover_from_manual(self, lease_id: str = NOBODY, *, force: bool = False) -> Prepared[Future[None]]:
        """Prepares to take control back; the future that it begins ends when the state is FLYING_AUTO.

        On the ground after others have flown, nothing is sent: from then on a take-off is allowed again.
        """
        with self._preconditions.logging_refusal("recover_from_manual"):
            self._preconditions.require_capability(Capability.RECOVER, "recover_from_manual")
            force = flag(force, "force")
            self._flight.require_replaceable("recover_from_manual")
            if self._flight.following.why:
                allowed = self._preconditions.require_recoverable("recover_from_manual")
                snapshot = self._preconditions.require_state("recover_from_manual", lease_id, *allowed)
                self._preconditions.require_no_failsafe("recover_from_manual", snapshot, force=force)
                if self._flight.estimate(snapshot).state is not State.FLYING_MANUAL:
                    return Prepared(Plan(), partial(self._take_up_again, lease_id, allowed))
            is_ground_theirs = self._flight.authority.is_ground_theirs
            allowed = (State.FLYING_MANUAL, State.LANDED_ARMED) if is_ground_theirs else (State.FLYING_MANUAL,)
            snapshot = self._preconditions.require_state("recover_from_manual", lease_id, *allowed)
            self._preconditions.require_no_failsafe("recover_from_manual", snapshot, force=force)
            if self._flight.estimate(snapshot).state is State.LANDED_ARMED:
                return Prepared(Plan(), partial(self._take_ground_back, lease_id))

        def refusal(newer: Snapshot) -> UalError | None:
            return self._preconditions.failsafe_refusal("recover_from_manual", newer, force=force)

        def begin() -> Future[None]:
            with self._preconditions.logging_refusal("recover_from_manual"):
                self._flight.following.release()
                command = AutopilotCommand("take our references")
                recover = Recover(command, self._backend.take_control, refusal)
                self._flight.begin(recover, CommandOrigin(lease_id), snapshot)
                if snapshot.control.held_by is not Cause.OPEN or force:
                    recover.send(snapshot)
                accepted("recover_from_manual")
                return recover.future

        return Prepared(Plan(), begin)

    def _take_up_again(self, lease_id: str, allowed: tuple[State, ...]) -> Future[None]:
        """Allows new motions again for a UAV that has not followed, and sends nothing."""
        with self._preconditions.logging_refusal("recover_from_manual"):
            self._preconditions.require_state("recover_from_manual", lease_id, *allowed)
            self._flight.following.release()
            self._flight.authority.is_ground_theirs = False
            accepted("recover_from_manual")
        done: Future[None] = Future()
        done.set_result(None)
        return done

    def _take_ground_back(self, lease_id: str) -> Future[None]:
        """Makes the ground UAL's again, from which it may take off."""
        with self._preconditions.logging_refusal("recover_from_manual"):
            self._preconditions.require_state("recover_from_manual", lease_id, State.LANDED_ARMED)
            self._flight.authority.is_ground_theirs = False
            accepted("recover_from_manual")
        done: Future[None] = Future()
        done.set_result(None)
        return done

    # --- Stopping -----------------------------------------------------------------------------------------------------

    def abort(self, freeze: bool = False, task_id: str = "", lease_id: str = NOBODY) -> None:
        """Stops the UAV, and cancels the task or reference. With `task_id`, nothing happens unless that task runs."""
        with self._preconditions.logging_refusal("abort"):
            freeze = flag(freeze, "freeze")
            if task_id and self._tasks.get(task_id).future.done():
                return
            if (waiting := self._waiting(task_id)) is not None:
                self.cancel(waiting, lease_id)
                return
            if task_id and self._flight.raw_estimate(self._backend.snapshot()).state in _LANDED:
                self.cancel(self._tasks.get(task_id), lease_id)  # a take-off that waits for the arming
                return
            if not task_id and self._is_mission_stopped():
                self._preconditions.require_state("abort", lease_id, *_ON_WAY_UP)
                accepted("abort", freeze=freeze, task_id="any")
                return
            snapshot = self._require_stoppable("abort", task_id, lease_id, *self._abortable())
            if self._is_autopilot_flying(snapshot):
                self._take_back("abort", snapshot, lease_id)
            elif self._is_mission(task_id):
                self._stop_mission("abort", snapshot, lease_id)
            else:
                motion = measured_motion(snapshot)
                stop: Reference = Hold(motion.position, motion.yaw_rad) if freeze else self._flight.brake(snapshot)
                self._stop_at("abort", stop, snapshot, task_id, lease_id)
            accepted("abort", freeze=freeze, task_id=task_id or "any")

    def _waiting(self, task_id: str) -> VehicleTask | None:
        """Returns the task that is in progress, where UAL does not fly it yet: only that of an identifier, unless
        empty.

        It waits on the ground or for the control, or the autopilot takes off in a mission.
        """
        manoeuvre = self._flight.manoeuvre
        task = None if manoeuvre is None else manoeuvre.task
        if manoeuvre is None or task is None or not manoeuvre.is_replaceable or task_id not in ("", task.id):
            return None
        if manoeuvre.current_reference() is not None:
            return None
        state = self._flight.estimate(self._backend.snapshot()).state
        return task if state in _NOT_FLOWN_YET and state not in self._abortable() else None

    def _is_mission_stopped(self) -> bool:
        """Returns whether a mission is being stopped already that has not taken off yet: another abort changes
        nothing.
        """
        state = self._flight.estimate(self._backend.snapshot()).state
        return self._flight.is_stopping_mission and state in _ON_WAY_UP and state not in self._abortable()

    def _abortable(self) -> tuple[State, ...]:
        if self._flight.arming.is_ours_to_end:
            return (State.FLYING_AUTO, State.TAKING_OFF, State.FLYING_MANUAL)
        if self._flight.has_safety_pilot:
            return (State.FLYING_AUTO,)
        return (State.FLYING_AUTO, State.TAKING_OFF, State.LANDING)

    def _is_autopilot_flying(self, snapshot: Snapshot) -> bool:
        """Returns whether the autopilot flies by itself what UAL is to end: what our arming has begun, or a take-off or
        a landing that nobody but UAL can abort.
        """
        if self._flight.arming.is_ours_to_end and snapshot.control.settled_mode:
            return True
        is_by_itself = snapshot.control.mode is not None and snapshot.control.mode.value.control in (
            Control.TAKE_OFF,
            Control.LAND,
        )
        return is_by_itself and not self._flight.has_safety_pilot

    def _require_stoppable(self, name: str, task_id: str, lease_id: str, *allowed: State) -> Snapshot:
        """Returns the snapshot in which what is flown may be stopped: a mission also without a position, while the
        autopilot is received.
        """
        try:
            return self._preconditions.require_state(name, lease_id, *allowed)
        except WrongStateError as error:
            is_unsure = self._backend.snapshot().link.conflict  # nothing is sent to what may be another vehicle
            if error.state != State.UNINITIALIZED.name or is_unsure or not self._is_mission(task_id):
                raise
        return self._preconditions.require_state(name, lease_id, State.UNINITIALIZED)

    def _is_mission(self, task_id: str) -> bool:
        """Returns whether the autopilot flies a mission that is this task, or any where no task is named."""
        info = self._flight.task_info()
        is_named = not task_id or (info is not None and task_id == info.id)
        return self._flight.is_on_mission and is_named

    def _take_back(self, name: str, snapshot: Snapshot, lease_id: str) -> None:
        """Takes the control back from the autopilot's own landing or take-off, or from what our arming has begun."""
        if self._flight.arming.is_ours_to_end:
            if self._flight.arming.is_taken(snapshot):  # in a snapshot that no update has assessed yet
                raise just_taken(name, snapshot)
            self._preconditions.require_no_failsafe(name, snapshot, force=False)
        command = AutopilotCommand("take our references")
        state = self._flight.raw_estimate(snapshot).state
        recover = Recover(command, self._backend.take_control, lambda _: None, name=name, out_of=state)
        self._flight.begin(recover, CommandOrigin(lease_id), snapshot)
        recover.send(snapshot)

    def _stop_at(self, name: str, stop: Reference, snapshot: Snapshot, task_id: str, lease_id: str) -> None:
        """Stops the UAV by references; where a mission has just begun, that."""
        try:
            self._flight.begin_reference(stop, name, snapshot, CommandOrigin(lease_id), only_task_id=task_id)
        except WrongStateError:
            if not self._is_mission(task_id):
                raise
            self._stop_mission(name, self._backend.snapshot(), lease_id)

    def _stop_mission(self, name: str, snapshot: Snapshot, lease_id: str) -> None:
        """Stops a mission that the autopilot flies; one that lands only ends as a task."""
        info, stop = self._flight.task_info(), self._flight.mission_stop(name, snapshot)
        if stop is not None:
            self._flight.begin(stop.manoeuvre, CommandOrigin(lease_id), snapshot)
            stop.begin()
        elif info is not None:
            self._flight.drop_task(info.id, name, lease_id)

    def cancel(self, task: VehicleTask, lease_id: str = NOBODY) -> None:
        """Cancels a task: the UAV stops and holds its position. Nothing happens if the task has ended.

        Raises:
            WrongStateError: It is taking off or landing, which only the safety pilot can abort, where there is one.
            LinkLostError: The autopilot flies it by itself, and nothing is received from it.

        """
        if task.future.done():
            return
        snapshot = self._backend.snapshot()
        if self._is_autopilot_flying(snapshot):
            self._take_back("cancel", snapshot, lease_id)
        elif self._is_mission(task.id):
            seen = self._require_stoppable("cancel", task.id, lease_id, *_SEEN)
            self._stop_mission("cancel", seen, lease_id)
        elif self._flight.is_following(snapshot):
            self._stop_at("cancel", self._flight.brake(snapshot), snapshot, task.id, lease_id)
        else:
            self._flight.drop_task(task.id, "cancel", lease_id)
        accepted("cancel", task_id=task.id)

    def abandon(self, task: VehicleTask, lease_id: str = NOBODY) -> bool:
        """Cancels a task whose caller waits no more.

        Returns False if it goes on: a take-off or a landing does, also where no safety pilot could abort it. So does a
        task where another program holds the lease now.
        """
        if self._flight.estimate(self._backend.snapshot()).state in (State.TAKING_OFF, State.LANDING):
            return False
        try:
            self.cancel(task, lease_id)
        except (WrongStateError, LeaseHeldError, LeaseLostError, LinkLostError):
            return False
        return True

    def pause(self, task_id: str = "", lease_id: str = NOBODY) -> None:
        """Makes the task that runs hold on its way. With `task_id`, only that task."""
        with self._preconditions.logging_refusal("pause"):
            self._flight.require_pausable("pause", task_id)
            self._preconditions.require_state("pause", lease_id, State.FLYING_AUTO)
            accepted("pause", task_id=self._flight.pause(task_id).id)

    def resume(self, task_id: str = "", lease_id: str = NOBODY) -> None:
        """Makes the paused task go on. With `task_id`, only that task."""
        with self._preconditions.logging_refusal("resume"):
            self._flight.require_pausable("resume", task_id)
            self._preconditions.require_state("resume", lease_id, State.FLYING_AUTO)
            accepted("resume", task_id=self._flight.resume(task_id).id)

    # --- Home ---------------------------------------------------------------------------------------------------------

    def set_home(self, set_z: bool = False, lease_id: str = NOBODY) -> None:
        """Makes the present position the origin of ``<ns>/odom``."""
        with self._preconditions.logging_refusal("set_home"):
            set_z = flag(set_z, "set_z")
            snapshot = self._preconditions.require_state("set_home", lease_id, *_LANDED)
            self._resolver.set_home(measured_motion(snapshot).position, snapshot, set_z=set_z)
            accepted("set_home", set_z=set_z)

    # --- Motors -------------------------------------------------------------------------------------------------------

    @property
    def is_arming_allowed(self) -> bool:
        """Whether callers may arm and disarm. In a simulation they always may."""
        is_allowed = self._allow_arming or self._backend.simulation() is not None
        return is_allowed and not self._flight.is_watch_only

    def arm(self, lease_id: str = NOBODY) -> Future[None]:
        """Arms. The future ends when the autopilot reports that it is armed."""
        return self._arm_or_disarm("arm", State.LANDED_DISARMED, lease_id, is_armed=True)

    def disarm(self, lease_id: str = NOBODY) -> Future[None]:
        """Disarms. The future ends when the autopilot reports that it is disarmed."""
        return self._arm_or_disarm("disarm", State.LANDED_ARMED, lease_id, is_armed=False)

    def _arm_or_disarm(self, name: str, needed: State, lease_id: str, *, is_armed: bool) -> Future[None]:
        with self._preconditions.logging_refusal(name):
            self._preconditions.require_flying_allowed(name)
            self._preconditions.require_capability(Capability.ARM, name)
            if not self.is_arming_allowed:
                raise PermissionDeniedError(
                    f"{name}: arming belongs to the safety pilot; this daemon may arm only when started with "
                    "--allow-arming"
                )
            snapshot = self._preconditions.require_state(name, lease_id, needed)
            if is_armed:
                self._preconditions.require_no_fall(name, snapshot)
            else:
                self._flight.require_replaceable(name)  # a take-off that has begun
            command = AutopilotCommand(name)
            future = self._flight.watch(
                command,
                lambda newer: newer.control.armed is not None and newer.control.armed.value is is_armed,
                lease_id,
            )
            if is_armed:
                self._note_arming(future)
            command.send(self._backend.arm if is_armed else self._backend.disarm)
            accepted(name)
            return future

    def _note_arming(self, future: Future[None]) -> None:
        """Notes that the arming is UAL's, unless it fails."""
        arming = self._flight.arming
        arming.order()

        def forget(ended: Future[None]) -> None:
            if ended.cancelled() or ended.exception() is not None:
                arming.withdraw()

        future.add_done_callback(forget)
