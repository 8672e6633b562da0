"""What the UAV flies: one manoeuvre or one reference at a time, stepped at each update.

Two kinds of threads meet here. The backend's update thread calls `step` at each new snapshot; any other thread begins
manoeuvres and references. `_lock` guards the manoeuvre and the reference; it is never held over a call to the backend,
over a callback, or while a future is ended.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from ual.errors import TaskAbortedError, UalError, UalTimeoutError, WrongStateError
from ual.geometry import Pose, Vector3
from ual.types import State, TaskInfo
from ual_daemon import logs
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Cause, Control, SetpointLoss, Snapshot, Takes
from ual_daemon.flight import fitting
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.external_silence import ExternalSilence
from ual_daemon.flight.manoeuvres.manoeuvre import Handover, Manoeuvre, Step
from ual_daemon.flight.policy.authority import Authority
from ual_daemon.flight.policy.geofence import Geofence
from ual_daemon.flight.policy.jumps import Jump
from ual_daemon.flight.policy.lease import Lease, carried
from ual_daemon.flight.refusals import not_pausable, not_replaceable, only_watching, replaced, shutting_down
from ual_daemon.flight.setpoint_sender import SetpointSender
from ual_daemon.flight.shutdown import Shutdown
from ual_daemon.flight.state import Estimate, estimate, replayed
from ual_daemon.flight.stopping import Stopping, motion_if_near, next_start
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.flight.watched_commands import WatchedCommands
from ual_daemon.tracker.drift import DriftCorrection
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.tracker.references import VELOCITY_TIMEOUT_S, Reference, Velocity, brake
from ual_daemon.trajectory import Motion

_log = logging.getLogger(__name__)

_NOT_COMMANDED = "; UAL has not been commanded in this flight since it was started, and sends nothing"
_UNTIL = "UAL sends nothing until it is commanded anew"


class LastCommand(NamedTuple):
    """The newest command that began: its number, counted from the start, and its name."""

    number: int
    name: str


class Way(NamedTuple):
    """The way that is flown, as points in the local frame; see `ual.types.Route`."""

    points: Sequence[Vector3]
    task_id: str
    is_goal_moving: bool


class Flight:
    """What one UAV flies. Any thread may call any member, except `step`: only the update thread."""

    def __init__(
        self,
        backend: Backend,
        limits: CurrentLimits,
        geofence: Geofence,
        *,
        watch_only: bool = False,
    ) -> None:
        """`watch_only`: sends nothing that flies, whatever comes."""
        self._backend = backend
        self.limits = limits
        self.geofence = geofence
        self.is_watch_only = watch_only
        self.authority = Authority()
        self.lease = Lease()
        self.external_silence = ExternalSilence()
        self.drift = DriftCorrection()
        """What is added to a commanded velocity."""
        self._note = ""
        """What the reason of FLYING_AUTO adds; composed at each update."""
        self._other_sender = ""
        self.sender = SetpointSender(backend, limits)
        self._stopping = Stopping(limits, geofence)
        self._watched = WatchedCommands()
        self._lock = threading.Lock()
        self._manoeuvre: Manoeuvre | None = None
        self._mode_seen = ""
        """The mode in which the manoeuvre was stepped last, or in which it began; empty while that is not known."""
        self._reference: Reference | None = None
        self._shutdown: Shutdown | None = None
        self._last_command = LastCommand(0, "")
        self._world: tuple[object, ...] = ()
        """What bounded motions at the last update that had one."""
        self._fitted: Reference | None = None
        """The reference that was fitted to that."""

    # --- What is known ------------------------------------------------------------------------------------------------

    def raw_estimate(self, snapshot: Snapshot) -> Estimate:
        """Estimates the state from the autopilot's data alone, without the manoeuvre that is under way."""
        return self._explained(estimate(snapshot, self._backend.freshness), snapshot)

    def estimate(self, snapshot: Snapshot) -> Estimate:
        """Estimates the state from the autopilot's data and the manoeuvre that is under way."""
        if snapshot.recorded is not None:
            return replayed(snapshot, snapshot.recorded, self._backend.freshness)
        manoeuvre = self._manoeuvre
        declared = None if manoeuvre is None else manoeuvre.declares
        found = estimate(snapshot, self._backend.freshness, declared, self._note)
        return found if found.state is not State.UNINITIALIZED else self._explained(found, snapshot)

    def _explained(self, found: Estimate, snapshot: Snapshot) -> Estimate:
        """Returns the same. Where there is no position, its reason says that the poses from outside have stopped."""
        estimator = snapshot.estimator
        if found.state is not State.UNINITIALIZED or estimator is None or estimator.value.is_good:
            return found
        silence = self.external_silence.words(snapshot.time_s)
        return replace(found, why=found.why + silence) if silence else found

    @property
    def takes(self) -> Takes:
        """Which setpoints the autopilot takes."""
        return self._backend.info().takes

    @property
    def limitation(self) -> str:
        """Why the vehicle has fewer capabilities than others, and what is unusual about it; empty if nothing is."""
        info = self._backend.info()
        return "; ".join(filter(None, (info.limitation, info.note)))

    @property
    def is_busy(self) -> bool:
        """Whether the next update has something to do."""
        is_idle = self._manoeuvre is None and self._reference is None
        return not (is_idle and self._watched.is_empty and self._shutdown is None)

    def _is_taking_off(self) -> bool:
        manoeuvre = self._manoeuvre
        return manoeuvre is not None and manoeuvre.declares is State.TAKING_OFF

    def task_info(self) -> TaskInfo | None:
        """Returns the running task; None if there is none."""
        manoeuvre = self._manoeuvre
        return None if manoeuvre is None or manoeuvre.task is None else manoeuvre.task.info()

    def reference_pose(self) -> Pose | None:
        """Returns the pose that is commanded now, in the local frame; None if no pose is."""
        reference = self._current_reference()
        return None if reference is None else reference.pose()

    def way(self, snapshot: Snapshot) -> Way | None:
        """Returns the way of the task that runs, or of the reference; None where none is known."""
        manoeuvre, reference = self._manoeuvre, self._reference
        if manoeuvre is not None and manoeuvre.task is not None:
            way = Way(manoeuvre.way(snapshot.time_s), manoeuvre.task.id, manoeuvre.is_goal_moving)
        else:
            points = () if manoeuvre is not None or reference is None else reference.way(snapshot.time_s)
            way = Way(points, "", is_goal_moving=True)
        return way if way.points else None

    def start(self, snapshot: Snapshot) -> Motion:
        """Returns the motion in which the next trajectory begins; see `next_start`."""
        return next_start(self._current_reference(), snapshot)

    def brake(self, snapshot: Snapshot) -> Reference:
        """Returns the reference that brings the UAV to rest; see `Stopping.stop`."""
        return self._stopping.stop(self._current_reference(), snapshot)

    def _current_reference(self) -> Reference | None:
        manoeuvre = self._manoeuvre
        return self._reference if manoeuvre is None else manoeuvre.current_reference()

    # --- What is commanded --------------------------------------------------------------------------------------------

    @property
    def is_closing(self) -> bool:
        """Whether commands are refused because of a shutdown."""
        return self._shutdown is not None

    def request_home(self) -> None:
        """See `Backend.request_home`."""
        self._backend.request_home()

    def require_replaceable(self, command: str) -> None:
        """Checks that a command may end the manoeuvre that is under way.

        Raises:
            WrongStateError: Only the safety pilot can abort that manoeuvre.

        """
        manoeuvre = self._manoeuvre
        if manoeuvre is not None and not self._is_replaceable(manoeuvre):
            raise not_replaceable(manoeuvre, command)

    def _is_replaceable(self, manoeuvre: Manoeuvre) -> bool:
        return manoeuvre.is_replaceable or not self.has_safety_pilot

    @property
    def has_safety_pilot(self) -> bool:
        """Whether a person can take over at any time. Take-offs and landings are then left to them to abort."""
        return self._backend.info().has_safety_pilot

    @property
    def last_command(self) -> LastCommand:
        """The newest command that began; see `begin`."""
        return self._last_command

    def begin(self, manoeuvre: Manoeuvre, since: LastCommand | None = None) -> None:
        """Begins a manoeuvre, and ends the one before.

        Args:
            manoeuvre: What to fly.
            since: The last command when this one was received. A command that took long to plan must not replace one
                that was received later.

        Raises:
            WrongStateError: UAL is shutting down, or the manoeuvre before may not be replaced.
            TaskAbortedError: Another command, such as an abort, began after `since`.

        """
        begun_in = self._backend.snapshot().settled_mode
        with self._lock:
            old = self._manoeuvre
            error = self._why_not_begin(manoeuvre.name, since)
            if error is None:
                self._manoeuvre, self._reference, self._mode_seen = manoeuvre, None, begun_in
                self.authority.begin()
                self._last_command = LastCommand(self._last_command.number + 1, manoeuvre.name)
        if error is not None:
            self._end(manoeuvre, error)
            raise error
        if old is not None:
            self._end(old, replaced(old, manoeuvre.name))

    def _why_not_begin(self, name: str, since: LastCommand | None) -> UalError | None:
        """Returns why a manoeuvre or reference may not begin now; None if it may. Called with the lock held."""
        if self._shutdown is not None:
            return shutting_down(name)
        if self.is_watch_only:
            return only_watching(name)
        if carried.get() != self.lease.id:
            return self.lease.refusal(name)
        old = self._manoeuvre
        if old is not None and not self._is_replaceable(old):
            return not_replaceable(old, name)
        if since is not None and since is not self._last_command:
            by = self._last_command.name
            return TaskAbortedError(f"{name}: replaced by {by}, while it was planned", {"by": by})
        return None

    def begin_reference(self, reference: Reference, by: str, snapshot: Snapshot, *, only_task_id: str = "") -> None:
        """Begins a reference, sends its first setpoint, and ends the manoeuvre before.

        With `only_task_id` nothing happens unless that task is the running one.

        Raises:
            WrongStateError: UAL is shutting down, or the manoeuvre before may not be replaced.

        """
        setpoint = reference.setpoint(snapshot)  # before the update thread has the reference and steps it
        with self._lock:
            old = self._manoeuvre
            if only_task_id and not _is_task(old, only_task_id):
                return
            error = self._why_not_begin(by, None)
            if error is not None:
                raise error
            self._manoeuvre, self._reference = None, reference
            if not self.authority.is_ours:  # a call that each setpoint of a stream would cost
                self.authority.begin()
            self._last_command = LastCommand(self._last_command.number + 1, by)
        if self._reference is reference:  # else another thread has replaced it meanwhile: it must not come after that
            self.sender.send(setpoint, snapshot)
        if old is not None:
            self._end(old, replaced(old, by))

    def stop_for_lease(self, why: str) -> None:
        """Aborts what is under way because the lease begins or ends: the UAV holds its position.

        A take-off or a landing goes on, and in a flight that is not UAL's nothing is sent.
        """
        snapshot = self._backend.snapshot()
        is_flying = self.raw_estimate(snapshot).state is State.FLYING_AUTO
        stop = self.brake(snapshot) if is_flying else None
        setpoint = None if stop is None else stop.setpoint(snapshot)
        with self._lock:
            self._last_command = LastCommand(
                self._last_command.number + 1, "lease"
            )  # what is being planned must not begin
            old = self._manoeuvre
            if not self.authority.is_ours or (old is not None and not old.is_replaceable):
                return
            self._manoeuvre, self._reference = None, stop
        if setpoint is not None:
            self.sender.send(setpoint, snapshot)
        if old is not None:
            self._end(old, TaskAbortedError(f"{old.name}: {why}", {"by": "lease"}))

    def drop_task(self, task_id: str, by: str) -> None:
        """Ends a task without stopping the UAV, which UAL does not control now. Nothing happens if it does not run.

        Raises:
            WrongStateError: Only the safety pilot can abort what it does now.
            LeaseHeldError: Another program holds the lease.

        """
        with self._lock:
            old = self._manoeuvre
            if old is None or not _is_task(old, task_id):
                return
            if (refusal := self.lease.refusal(by)) is not None:
                raise refusal
            if not old.is_replaceable:
                raise not_replaceable(old, by)
            self._manoeuvre = None
        self._end(old, replaced(old, by))

    def pause(self, only_task_id: str = "") -> VehicleTask:
        """Makes the task that runs hold on its way, and returns it. A command that is being planned does not begin.

        Raises:
            WrongStateError: No task runs (or not the one of `only_task_id`), or it cannot be paused.

        """
        with self._lock:
            task = self._pausable_task("pause", only_task_id)
            task.is_paused = True
            self._last_command = LastCommand(self._last_command.number + 1, "pause")
        return task

    def resume(self, only_task_id: str = "") -> VehicleTask:
        """Makes the paused task go on, and returns it.

        Raises:
            WrongStateError: No task runs (or not the one of `only_task_id`), or it is not paused.

        """
        with self._lock:
            task = self._pausable_task("resume", only_task_id)
            if not task.is_paused:
                raise not_pausable("resume", f"{task.kind.name.lower()} is not paused")
            task.is_paused = False
        return task

    def require_pausable(self, command: str, only_task_id: str = "") -> None:
        """Checks that a task runs that can be paused.

        Raises:
            WrongStateError: No task runs (or not the one of `only_task_id`), or it cannot be paused.

        """
        self._pausable_task(command, only_task_id)

    def _pausable_task(self, command: str, only_task_id: str) -> VehicleTask:
        manoeuvre = self._manoeuvre
        if manoeuvre is None or manoeuvre.task is None:
            raise not_pausable(command, "no task runs")
        if only_task_id and manoeuvre.task.id != only_task_id:
            raise not_pausable(command, f"the task {only_task_id[:100]} does not run any more")
        if manoeuvre.why_not_pausable:
            raise not_pausable(command, f"{manoeuvre.name} cannot be paused: {manoeuvre.why_not_pausable}")
        return manoeuvre.task

    def watch(self, command: AutopilotCommand, is_done: Callable[[Snapshot], bool]) -> Future[None]:
        """Watches a command that is not a manoeuvre; see `WatchedCommands.add`.

        Raises:
            WrongStateError: UAL is shutting down.

        """
        return self._watched.add(command, is_done)

    # --- The end ------------------------------------------------------------------------------------------------------

    def prepare_shutdown(self) -> Future[None]:
        """See `ual_daemon.vehicle.vehicle.Vehicle.prepare_shutdown`."""
        with self._lock:
            if self._shutdown is not None:
                return self._shutdown.future
            shutdown = self._shutdown = Shutdown(self._backend, self.is_flown_by_us)
            manoeuvre = self._manoeuvre
            if manoeuvre is not None and manoeuvre.is_replaceable:
                self._manoeuvre, self._reference = None, None
        self._watched.refuse_new()
        if manoeuvre is not None and manoeuvre.is_replaceable:
            self._end(manoeuvre, TaskAbortedError(f"{manoeuvre.name}: UAL is shutting down", {"by": "shutdown"}))
        self._step_shutdown(self._backend.snapshot(), shutdown)
        return shutdown.future

    def _step_shutdown(self, snapshot: Snapshot, shutdown: Shutdown) -> None:
        """Steps the shutdown, once no manoeuvre is under way."""
        if shutdown.future.done() or self._manoeuvre is not None:
            return
        if shutdown.step(snapshot):
            with self._lock:
                self._reference = None
            shutdown.finish()

    def close(self) -> None:
        """Ends what is left. To be called once no more updates come."""
        with self._lock:
            manoeuvre, self._manoeuvre, self._reference = self._manoeuvre, None, None
            shutdown = self._shutdown = self._shutdown or Shutdown(self._backend, self.is_flown_by_us)
        error = TaskAbortedError(f"{self._backend.options.ns} was closed", {"by": "close"})
        if manoeuvre is not None:
            self._end(manoeuvre, error)
        self._watched.end_all(error)
        shutdown.finish()

    # --- Updates ------------------------------------------------------------------------------------------------------

    def step(self, snapshot: Snapshot) -> None:
        """Makes one update."""
        raw = self.raw_estimate(snapshot)
        self.authority.follow(raw.state, snapshot)
        self.geofence.observe(snapshot, raw, is_taking_off=self._is_taking_off())
        self._prepare_velocity(snapshot)
        self._fit(snapshot, raw)
        if not self._step_manoeuvre(snapshot, raw):
            self._step_reference(snapshot, raw)
        self._watched.step(snapshot, raw)
        self._update_note(snapshot)
        if self._shutdown is not None:
            self._step_shutdown(snapshot, self._shutdown)

    def _prepare_velocity(self, snapshot: Snapshot) -> None:
        """Takes note of what is flown while no velocity is: the next velocity begins with its place and motion."""
        current = self._current_reference()
        if current is None:
            self.drift.forget()
        elif not isinstance(current, Velocity):
            self.drift.stand_by(partial(motion_if_near, current), snapshot)

    def _fit(self, snapshot: Snapshot, raw: Estimate) -> None:
        """Fits what is flown to what bounds it now, if that has changed, or if it has just begun."""
        manoeuvre, reference = self._manoeuvre, self._reference
        if (manoeuvre is None and reference is None) or raw.state is State.UNINITIALIZED:
            return
        world = (self._backend.info(), *self.geofence.depends_on(snapshot))
        has_changed, self._world = world != self._world, world
        if manoeuvre is None and reference is not None:
            if has_changed or reference is not self._fitted:
                self._fit_reference(reference, snapshot)
        elif manoeuvre is not None and (has_changed or not manoeuvre.is_fitted):
            self._fit_manoeuvre(manoeuvre, snapshot)

    def _fit_manoeuvre(self, manoeuvre: Manoeuvre, snapshot: Snapshot) -> None:
        manoeuvre.is_fitted = True
        step = _guarded(manoeuvre, lambda: manoeuvre.fit(snapshot, self.limits, self.geofence))
        if step is not None:
            self._take(manoeuvre, step, snapshot)

    def _fit_reference(self, reference: Reference, snapshot: Snapshot) -> None:
        self._fitted = reference
        error = fitting.fit(reference, snapshot, self.limits, self.geofence)
        if error is None:
            return
        stop = self.brake(snapshot)
        if self._exchange(reference, stop):
            logs.event(_log, logging.WARNING, "reference_ended", why=str(error), remedy="the UAV stops and holds")

    def estimate_jumped(self, jump: Jump, snapshot: Snapshot) -> None:
        """Takes note that the autopilot's estimate has jumped: the UAV must not follow it, but hold where it is.

        Called by the update thread, before the step. What was flown to lies elsewhere now, or the nose would turn to a
        heading that was another one, so it ends; a take-off, a landing and a velocity go on.
        """
        logs.event(_log, logging.WARNING, "estimate_jumped", **jump.fields)
        self.geofence.estimate_jumped(jump.offset)
        self.drift.forget()
        stop = brake(snapshot, self.limits.get())
        with self._lock:
            manoeuvre = self._manoeuvre
            error = None if manoeuvre is None else manoeuvre.estimate_jumped(jump, stop)
            if error is not None:
                self._manoeuvre = None
            if self._manoeuvre is None and not isinstance(self._reference, Velocity):
                has_reference = self._reference is not None or error is not None
                self._reference = stop if has_reference else None
        if manoeuvre is not None and error is not None:
            self._end(manoeuvre, error)

    def _update_note(self, snapshot: Snapshot) -> None:
        """Composes what the reason of FLYING_AUTO adds, and logs when another program's setpoints begin and end."""
        other = snapshot.other_sender
        if other != self._other_sender:
            self._other_sender = other
            level = logging.WARNING if other else logging.INFO
            logs.event(_log, level, "another_sender", why=other or "no longer seen")
        self._note = "".join((self._not_commanded(), f"; {other}" if other else ""))

    def _not_commanded(self) -> str:
        if self.is_flown_by_us():
            return ""
        loss, lost = self._backend.info().setpoint_loss, self.authority.given_up or self.authority.taken
        why = f"; {lost}: {_UNTIL}" if lost else _NOT_COMMANDED
        return f"{why}; without setpoints it {loss.value}" if loss is SetpointLoss.COASTS else why

    @property
    def _falls_without_setpoints(self) -> bool:
        return self._backend.info().setpoint_loss is SetpointLoss.FALLS

    def _step_manoeuvre(self, snapshot: Snapshot, raw: Estimate) -> bool:
        """Steps the manoeuvre that is under way. Returns False if there is none, or if it has just ended."""
        manoeuvre = self._manoeuvre
        if manoeuvre is None:
            return False
        if snapshot.held_by is Cause.OPEN and raw.is_link_up:
            # Nothing is sent; who took the UAV is known within a moment, and then ends the manoeuvre.
            self._withdraw_older(manoeuvre, snapshot)
            return True
        self._mode_seen = snapshot.settled_mode or self._mode_seen
        step = _guarded(manoeuvre, lambda: manoeuvre.step(snapshot, raw))
        assert step is not None
        return self._take(manoeuvre, step, snapshot)

    def _take(self, manoeuvre: Manoeuvre, step: Step, snapshot: Snapshot) -> bool:
        """Does what a step of the manoeuvre results in. Returns False if the manoeuvre has just ended."""
        if step.handover is not None:
            self._hand_over(manoeuvre, step.handover, snapshot)
            return True
        if not step.has_ended:
            if step.setpoint is not None and self._manoeuvre is manoeuvre:
                self.sender.send_if_due(step.setpoint, snapshot)
            return True
        next_reference = self.brake(snapshot) if step.is_to_stop else step.next_reference
        with self._lock:
            if self._manoeuvre is not manoeuvre:
                return True  # replaced by another thread, which also ends it
            if manoeuvre.is_paused and step.error is None:
                return True  # paused by another thread during the step
            self._manoeuvre, self._reference = None, next_reference
            self.authority.is_ours = not step.is_taken
        self._end(manoeuvre, _with_other_sender(step.error, snapshot))
        if step.is_autopilot_to_hold:
            self._hold_by_autopilot(snapshot, manoeuvre.name)
        return False

    def _withdraw_older(self, manoeuvre: Manoeuvre, snapshot: Snapshot) -> None:
        """Withdraws the command of a manoeuvre from before the mode changed: repeated, it would change that again."""
        is_older = self._mode_seen not in ("", _mode_name(snapshot))
        if is_older and manoeuvre.command is not None:
            manoeuvre.command.withdraw()

    def _hand_over(self, manoeuvre: Manoeuvre, to: Handover, snapshot: Snapshot) -> None:
        """Makes another manoeuvre go on with the task, unless another thread has replaced or paused it."""
        with self._lock:
            if self._manoeuvre is not manoeuvre or manoeuvre.is_paused:
                return
            self._manoeuvre, self._mode_seen = to.manoeuvre, snapshot.settled_mode
        to.begin()

    def _hold_by_autopilot(self, snapshot: Snapshot, during: str) -> None:
        """Commands the autopilot to hold its position by itself, until it has left the mode in which it obeys UAL.

        It must not be repeated after that: the safety pilot may have taken over.
        """
        hold = AutopilotCommand("hold its position", snapshot.time_s)
        logs.event(_log, logging.WARNING, "hold_by_autopilot", why=f"{during} was stopped")
        with suppress(WrongStateError):  # UAL is shutting down
            self._watched.add(hold, _is_control_given_up)
        hold.send(self._backend.hold)

    def _step_reference(self, snapshot: Snapshot, raw: Estimate) -> None:
        """Sends the setpoint of the reference, and forgets the reference once the autopilot does not follow UAL."""
        old = self._reference
        may_send = _may_send_reference(snapshot, raw, is_begun=old is not None)
        self.authority.observe(raw.state, snapshot, is_sending=may_send and old is not None)
        if not (may_send and self.is_flown_by_us()):
            self.drift.forget()
            self._exchange(old, None)
            return
        new = self._next_reference(old, snapshot)
        if new is old or self._exchange(old, new):
            self._send_reference(new, snapshot)

    def is_flown_by_us(self) -> bool:
        """Returns whether UAL may send what flies: it was commanded in this flight, or the UAV falls without it."""
        return self.authority.is_ours or (not self.is_watch_only and self._falls_without_setpoints)

    def _next_reference(self, reference: Reference | None, snapshot: Snapshot) -> Reference:
        """Returns the reference to follow now: the given one, or a stop if there is none or its velocity has ended."""
        if reference is None:
            return brake(snapshot, self.limits.get())
        if isinstance(reference, Velocity) and (why := self._why_ended(reference, snapshot)):
            stop = brake(snapshot, self.limits.stop())
            logs.event(_log, logging.INFO, "velocity_ended", why=why)
            return stop
        if isinstance(reference, Velocity):
            reference.correct_drift(snapshot, self.limits.get(), self._backend.info().velocity_responses)
        return reference

    def _send_reference(self, reference: Reference, snapshot: Snapshot) -> None:
        try:
            setpoint = reference.setpoint(snapshot)
        except Exception:  # noqa: BLE001  logged
            # The UAV must not be left without references: it stops.
            _log.exception("a reference failed; this is a defect of UAL, please report it")
            stop = brake(snapshot, self.limits.get())
            if not self._exchange(reference, stop):
                return
            setpoint = stop.setpoint(snapshot)
        self.sender.send_if_due(setpoint, snapshot)

    def _why_ended(self, velocity: Velocity, snapshot: Snapshot) -> str:
        """Returns why a velocity may not go on; empty while it may."""
        if snapshot.time_s > velocity.expires_s:
            return f"no new one within {VELOCITY_TIMEOUT_S:g} s"
        try:
            self.geofence.admit("velocity", velocity, self.limits.get(), snapshot)
        except UalError as error:  # it would leave the geofence, or it is not known any more where that lies
            return str(error)
        return ""

    def _exchange(self, old: Reference | None, new: Reference | None) -> bool:
        """Replaces a reference. Returns False if another thread has begun something else in the meantime."""
        with self._lock:
            if self._reference is not old or self._manoeuvre is not None:
                return False
            self._reference = new
            return True

    def _end(self, manoeuvre: Manoeuvre, error: UalError | None) -> None:
        fields: dict[str, object] = {"task": manoeuvre.name}
        if manoeuvre.task is not None:
            fields["task_id"] = manoeuvre.task.id
        if error is None:
            logs.event(_log, logging.INFO, "task_done", **fields)
        else:
            logs.event(_log, logging.WARNING, "task_ended", **fields, reason=error.reason, why=str(error))
        manoeuvre.end(error)


def _with_other_sender(error: UalError | None, snapshot: Snapshot) -> UalError | None:
    """Returns an error that also names another program's setpoints, which may be why it did not get there."""
    if not snapshot.other_sender or not isinstance(error, UalTimeoutError):
        return error
    return UalTimeoutError(f"{error}; {snapshot.other_sender}", {**error.metadata, "other_sender": "true"})


def _guarded(manoeuvre: Manoeuvre, act: Callable[[], Step | None]) -> Step | None:
    """Returns what a manoeuvre does, or its end by a defect: the UAV must not be left without references."""
    try:
        return act()
    except Exception as error:  # noqa: BLE001  logged, and raised to the caller
        _log.exception("a step of %s failed; this is a defect of UAL, please report it", manoeuvre.name)
        return Step(has_ended=True, error=UalError(f"{manoeuvre.name}: a defect of UAL: {error!r}"))


def _is_task(manoeuvre: Manoeuvre | None, task_id: str) -> bool:
    return manoeuvre is not None and manoeuvre.task is not None and manoeuvre.task.id == task_id


def _mode_name(snapshot: Snapshot) -> str:
    return "" if snapshot.mode is None else snapshot.mode.value.name


def _is_control_given_up(snapshot: Snapshot) -> bool:
    return snapshot.mode is not None and snapshot.mode.value.control not in (Control.REFERENCES, Control.TAKE_OFF)


def _may_send_reference(snapshot: Snapshot, raw: Estimate, *, is_begun: bool) -> bool:
    """Whether a reference may be sent now.

    On the ground, a reference that has begun goes on while the autopilot follows UAL (a descent that has touched down
    must not lose its stream before the autopilot disarms), but none begins.
    """
    if raw.state is State.FLYING_AUTO:
        return True
    is_ours = snapshot.mode is not None and snapshot.mode.value.control is Control.REFERENCES
    return is_begun and is_ours and raw.state is State.LANDED_ARMED
