"""What is flown: the manoeuvre or reference of one UAV, one at a time, stepped at each update.

Two kinds of threads meet here. The backend's update thread calls `step` at each new snapshot; any other thread begins
manoeuvres and gives references. `_lock` guards what is flown; it is never held over a call to the backend, a callback,
or the end of a future.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from typing import NamedTuple

from ual.errors import TaskAbortedError, UalError, WrongStateError
from ual.geometry import Pose
from ual.types import State, TaskInfo
from ual_daemon import logs
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Control, Setpoint, Snapshot, Takes, VelocitySetpoint
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.geofence import Geofence
from ual_daemon.flight.manoeuvre import Manoeuvre, Step
from ual_daemon.flight.state import Estimate, estimate
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.tracker.references import (
    VELOCITY_TIMEOUT_S,
    Follow,
    Hold,
    Reference,
    StopAlong,
    Velocity,
    brake,
    measured_motion,
)
from ual_daemon.tracker.setpoint_adaptation import adapted
from ual_daemon.trajectory import Motion, Trajectory

_log = logging.getLogger(__name__)

_SEND_PERIOD_S = 0.018
"""Updates send a setpoint where none has left for so long (50 Hz with a margin for their own jitter)."""
_NEAR_REFERENCE_M = 1.0
_NEAR_REFERENCE_S = 0.5
_HOLD_PATIENCE_S = 5.0


class _Watch:
    """A command that is no manoeuvre (arming), until its effect shows."""

    def __init__(self, command: AutopilotCommand, is_done: Callable[[Snapshot], bool]) -> None:
        self.command = command
        self.is_done = is_done
        self.future: Future[None] = Future()
        self.future.set_running_or_notify_cancel()  # nobody but us ends it


class LastCommand(NamedTuple):
    """The newest command that began: its number, counted from the start, and its name."""

    number: int
    name: str

    def followed_by(self, name: str) -> LastCommand:
        """Returns the next one."""
        return LastCommand(self.number + 1, name)


class Flight:
    """What one UAV is busy with. Every member may be called from any thread, but `step` from the update thread only."""

    def __init__(self, backend: Backend, limits: CurrentLimits, geofence: Geofence | None = None) -> None:
        self._backend = backend
        self.limits = limits
        self.geofence = geofence
        self._lock = threading.Lock()
        self._manoeuvre: Manoeuvre | None = None
        self._reference: Reference | None = None
        self._watches: tuple[_Watch, ...] = ()
        self._closing: Future[None] | None = None
        self._hold: AutopilotCommand | None = None
        self._sent_s = float("-inf")
        self._last_command = LastCommand(0, "")

    # --- What is known ------------------------------------------------------------------------------------------------

    def raw_estimate(self, snapshot: Snapshot) -> Estimate:
        """What the data say by themselves, whatever we are doing."""
        return estimate(snapshot, self._backend.freshness)

    def estimate(self, snapshot: Snapshot) -> Estimate:
        """The state that a snapshot says, our own manoeuvre considered."""
        manoeuvre = self._manoeuvre
        return estimate(snapshot, self._backend.freshness, None if manoeuvre is None else manoeuvre.declares)

    @property
    def takes(self) -> Takes:
        """Which setpoints the autopilot takes."""
        return self._backend.info().takes

    @property
    def is_busy(self) -> bool:
        """Whether the next update has something to do."""
        return not (self._manoeuvre is None and self._reference is None and not self._watches and self._closing is None)

    def task_info(self) -> TaskInfo | None:
        """The running task."""
        manoeuvre = self._manoeuvre
        return None if manoeuvre is None or manoeuvre.task is None else manoeuvre.task.info()

    def reference_pose(self) -> Pose | None:
        """Where the UAV is told to be, in the local frame; None where no pose is told."""
        reference = self._flown()
        return None if reference is None else reference.pose()

    def start(self, snapshot: Snapshot) -> Motion:
        """Where a trajectory begins: at the reference that is flown, so that it does not jump, unless that is far from
        where the UAV is.
        """
        return _near(self._flown(), snapshot) or measured_motion(snapshot)

    def brake(self, snapshot: Snapshot) -> Reference:
        """What comes to rest from the motion that is flown. From that of the UAV where it was only given a pose: it may
        be anywhere on its way there. Along the trajectory that is flown where straight ahead it would leave the fence.
        """
        flown = self._flown()
        start = None if isinstance(flown, Hold) else _near(flown, snapshot)
        if start is not None and isinstance(flown, Follow) and self._inner_brake(start, snapshot) is None:
            return StopAlong(flown, self._inner_brake)
        return brake(snapshot, self.limits.get(), start)

    def _inner_brake(self, start: Motion, snapshot: Snapshot) -> Follow | None:
        """What comes to rest from a motion straight ahead; None where it would leave the fence."""
        stop = brake(snapshot, self.limits.get(), start)
        return None if self._leaves(stop.trajectory, snapshot) else stop

    def _leaves(self, trajectory: Trajectory, snapshot: Snapshot) -> bool:
        """Whether a trajectory leaves the fence, as far as it is known where that lies."""
        try:
            return self.geofence is not None and self.geofence.is_left_by(trajectory, self.limits.get(), snapshot)
        except WrongStateError:
            return False

    def _flown(self) -> Reference | None:
        manoeuvre = self._manoeuvre
        return self._reference if manoeuvre is None else manoeuvre.pose_reference()

    # --- What is commanded --------------------------------------------------------------------------------------------

    @property
    def is_closing(self) -> bool:
        """Whether no more commands are taken."""
        return self._closing is not None

    def require_replaceable(self, command: str) -> None:
        """Raises `WrongStateError` while a manoeuvre is under way that a command may not end."""
        manoeuvre = self._manoeuvre
        if manoeuvre is not None and not manoeuvre.is_replaceable:
            raise _not_replaceable(manoeuvre, command)

    @property
    def last_command(self) -> LastCommand:
        """The newest command that began; see `begin`."""
        return self._last_command

    def begin(self, manoeuvre: Manoeuvre, since: LastCommand | None = None) -> None:
        """Makes a manoeuvre what is flown, and ends the one before.

        Args:
            manoeuvre: What to fly.
            since: The last command when this one was received. A command that took long to plan must not replace one
                that was received later.

        Raises:
            WrongStateError: UAL is shutting down, or the manoeuvre before may not be replaced.
            TaskAbortedError: Another command, such as an abort, began after `since`.

        """
        error: UalError | None = None
        with self._lock:
            old = self._manoeuvre
            if self._closing is not None:  # since the checks: nobody would end it any more
                error = shutting_down(manoeuvre.name)
            elif old is not None and not old.is_replaceable:
                error = _not_replaceable(old, manoeuvre.name)
            elif since is not None and since is not self._last_command:
                by = self._last_command.name
                error = TaskAbortedError(f"{manoeuvre.name}: replaced by {by}, while it was planned", {"by": by})
            else:
                self._manoeuvre, self._reference = manoeuvre, None
                self._last_command = self._last_command.followed_by(manoeuvre.name)
        if error is not None:
            self._end(manoeuvre, error)
            raise error
        if old is not None:
            self._end(old, _replaced(old, manoeuvre.name))

    def refer(self, reference: Reference, by: str, snapshot: Snapshot, *, only_task_id: str = "") -> None:
        """Makes a reference what is flown, in place of a manoeuvre, and sends its setpoint.

        With `only_task_id` nothing happens unless that task is the running one. Raises as `require_replaceable`, and
        `shutting_down`.
        """
        setpoint = reference.setpoint(snapshot)  # before the update thread knows it, which then is the one to ask it
        with self._lock:
            old = self._manoeuvre
            if only_task_id and (old is None or old.task is None or old.task.id != only_task_id):
                return
            if self._closing is not None:
                raise shutting_down(by)
            if old is not None and not old.is_replaceable:
                raise _not_replaceable(old, by)
            self._manoeuvre, self._reference = None, reference
            self._last_command = self._last_command.followed_by(by)
        self._transmit(setpoint, snapshot)
        if old is not None:
            self._end(old, _replaced(old, by))

    def drop(self, task_id: str, by: str) -> None:
        """Ends a task, and flies nothing in its place (the UAV is not ours to stop)."""
        with self._lock:
            old = self._manoeuvre
            if old is None or old.task is None or old.task.id != task_id:
                return
            self._manoeuvre = None
        self._end(old, _replaced(old, by))

    def watch(self, command: AutopilotCommand, is_done: Callable[[Snapshot], bool]) -> Future[None]:
        """Waits for the effect of a command; the future ends when it shows, or with the error that it failed by."""
        watch = _Watch(command, is_done)
        with self._lock:
            if self._closing is not None:
                raise shutting_down(command.what)
            self._watches = (*self._watches, watch)
        return watch.future

    # --- The end ------------------------------------------------------------------------------------------------------

    def prepare_shutdown(self) -> Future[None]:
        """See `ual_daemon.vehicle.vehicle.Vehicle.prepare_shutdown`."""
        with self._lock:
            if self._closing is not None:
                return self._closing
            closing = self._closing = Future()
            manoeuvre = self._manoeuvre
            if manoeuvre is not None and manoeuvre.is_replaceable:
                self._manoeuvre, self._reference = None, None
        if manoeuvre is not None and manoeuvre.is_replaceable:
            self._end(manoeuvre, TaskAbortedError(f"{manoeuvre.name}: UAL is shutting down", {"by": "shutdown"}))
        self._step_shutdown(self._backend.snapshot(), closing)
        return closing

    def _step_shutdown(self, snapshot: Snapshot, closing: Future[None]) -> None:
        if closing.done() or self._manoeuvre is not None:
            return
        if self.raw_estimate(snapshot).state is State.FLYING_AUTO and self._hold is None:
            self._hold = AutopilotCommand("hold its position", snapshot.time_s)
            logs.event(_log, logging.INFO, "hold_by_autopilot", why="UAL is shutting down")
            self._hold.send(self._backend.hold)
            snapshot = self._backend.snapshot()  # a simulation obeys at once, even while its time stands still
        if self.raw_estimate(snapshot).state is State.FLYING_AUTO and self._hold is not None:
            if snapshot.time_s - self._hold.sent_s < _HOLD_PATIENCE_S:
                return
            failure = self._hold.failure(snapshot)
            logs.event(_log, logging.ERROR, "hold_failed", why=str(failure or "its mode did not change"))
        if self._hold is not None and self.raw_estimate(snapshot).state is State.FLYING_MANUAL:
            self._hold.withdraw()  # it holds, or the safety pilot flies: repeated, it would take the UAV from him
        with self._lock:
            self._reference = None
        with suppress(InvalidStateError):  # another thread was first
            closing.set_result(None)

    def close(self) -> None:
        """Ends all that is left, once no more updates come."""
        with self._lock:
            manoeuvre, self._manoeuvre, self._reference = self._manoeuvre, None, None
            watches, self._watches = self._watches, ()
            closing = self._closing = self._closing or Future()
        error = TaskAbortedError(f"{self._backend.options.ns} was closed", {"by": "close"})
        if manoeuvre is not None:
            self._end(manoeuvre, error)
        for watch in watches:
            watch.command.withdraw()
            watch.future.set_exception(error)
        with suppress(InvalidStateError):
            closing.set_result(None)

    # --- Updates ------------------------------------------------------------------------------------------------------

    def step(self, snapshot: Snapshot) -> None:
        """One update."""
        raw = self.raw_estimate(snapshot)
        if not self._step_manoeuvre(snapshot, raw):
            self._step_reference(snapshot, raw)
        for watch in self._watches:
            self._step_watch(watch, snapshot)
        if self._closing is not None:
            self._step_shutdown(snapshot, self._closing)

    def _step_manoeuvre(self, snapshot: Snapshot, raw: Estimate) -> bool:
        """Steps what is under way; False when nothing is."""
        manoeuvre = self._manoeuvre
        if manoeuvre is None:
            return False
        try:
            step = manoeuvre.step(snapshot, raw)
        except Exception as error:  # noqa: BLE001  told loudly, and to the caller
            # The UAV must not be left without references: the manoeuvre ends, and it stops.
            _log.exception("a step of %s failed; this is a defect of UAL, please report it", manoeuvre.name)
            step = Step(has_ended=True, error=UalError(f"{manoeuvre.name}: a defect of UAL: {error!r}"))
        if not step.has_ended:
            if step.setpoint is not None and self._manoeuvre is manoeuvre:
                self._send(step.setpoint, snapshot)
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
        if not _may_refer(snapshot, raw, is_begun=reference is not None):
            self._exchange(reference, None)
            return
        flown = reference
        if reference is None:
            flown = brake(snapshot, self.limits.get())
        elif isinstance(reference, Velocity) and (why := self._why_ended(reference, snapshot)):
            flown = brake(snapshot, self.limits.get())
            logs.event(_log, logging.INFO, "velocity_ended", why=why)
        assert flown is not None
        if flown is reference or self._exchange(reference, flown):
            try:
                setpoint = flown.setpoint(snapshot)
            except Exception:  # noqa: BLE001  told loudly
                # The UAV must not be left without references: it stops.
                _log.exception("a reference failed; this is a defect of UAL, please report it")
                stop = brake(snapshot, self.limits.get())
                if not self._exchange(flown, stop):
                    return
                setpoint = stop.setpoint(snapshot)
            self._send(setpoint, snapshot)

    def _why_ended(self, velocity: Velocity, snapshot: Snapshot) -> str:
        """Why a velocity may not go on; empty while it may."""
        if snapshot.time_s > velocity.expires_s:
            return f"no new one within {VELOCITY_TIMEOUT_S:g} s"
        if self.geofence is not None:
            try:
                self.geofence.admit("velocity", velocity, self.limits.get(), snapshot)
            except UalError as error:  # the fence, or that it is not known any more where it lies
                return str(error)
        return ""

    def _exchange(self, old: Reference | None, new: Reference | None) -> bool:
        """Replaces a reference, unless somebody gave another meanwhile."""
        with self._lock:
            if self._reference is not old or self._manoeuvre is not None:
                return False
            self._reference = new
            return True

    def _send(self, setpoint: Setpoint, snapshot: Snapshot) -> None:
        if snapshot.time_s - self._sent_s >= _SEND_PERIOD_S:
            self._transmit(setpoint, snapshot)

    def _transmit(self, setpoint: Setpoint, snapshot: Snapshot) -> None:
        """Sends a setpoint as the autopilot takes it."""
        self._sent_s = snapshot.time_s
        if not isinstance(setpoint, VelocitySetpoint):
            setpoint = adapted(setpoint, self.takes, snapshot, self.limits.get())
        self._backend.send(setpoint)

    def _step_watch(self, watch: _Watch, snapshot: Snapshot) -> None:
        is_done = watch.is_done(snapshot)
        error = None if is_done else watch.command.failure(snapshot)
        if not is_done and error is None:
            return
        with self._lock:
            if watch not in self._watches:
                return
            self._watches = tuple(other for other in self._watches if other is not watch)
        watch.command.withdraw()
        if error is None:
            watch.future.set_result(None)
        else:
            logs.event(_log, logging.WARNING, "command_failed", reason=error.reason, why=str(error))
            watch.future.set_exception(error)

    def _end(self, manoeuvre: Manoeuvre, error: UalError | None) -> None:
        fields: dict[str, object] = {"task": manoeuvre.name}
        if manoeuvre.task is not None:
            fields["task_id"] = manoeuvre.task.id
        if error is None:
            logs.event(_log, logging.INFO, "task_done", **fields)
        else:
            logs.event(_log, logging.WARNING, "task_ended", **fields, reason=error.reason, why=str(error))
        manoeuvre.end(error)


def _near(reference: Reference | None, snapshot: Snapshot) -> Motion | None:
    """The motion of a reference, unless there is none or it is far from where the UAV is."""
    if reference is None:
        return None
    motion = reference.motion(snapshot)
    near_m = _NEAR_REFERENCE_M + _NEAR_REFERENCE_S * motion.velocity.norm()  # it may lag behind a fast reference
    return motion if (motion.position - measured_motion(snapshot).position).norm() <= near_m else None


def _may_refer(snapshot: Snapshot, raw: Estimate, *, is_begun: bool) -> bool:
    """Whether a reference may be sent now.

    On the ground one that is there goes on while the autopilot follows ours (a descent that has touched down must not
    lose its stream before the autopilot disarms), but none begins.
    """
    if raw.state is State.FLYING_AUTO:
        return True
    is_ours = snapshot.mode is not None and snapshot.mode.value.control is Control.REFERENCES
    return is_begun and is_ours and raw.state is State.LANDED_ARMED


def shutting_down(command: str) -> WrongStateError:
    """The refusal of a command that comes once the end has begun."""
    return WrongStateError(f"{command}: UAL is shutting down and takes no more commands")


def _not_replaceable(manoeuvre: Manoeuvre, command: str) -> WrongStateError:
    metadata = {"command": command}
    if manoeuvre.declares is not None:
        metadata["state"] = manoeuvre.declares.name
    return WrongStateError(
        f"{command}: {manoeuvre.name} is under way; only the safety pilot can abort it, else wait for its end", metadata
    )


def _replaced(old: Manoeuvre, by: str) -> TaskAbortedError:
    how = "cancelled" if by in ("cancel", "abort") else f"replaced by {by}"
    return TaskAbortedError(f"{old.name}: {how}", {"by": by, "state": State.FLYING_AUTO.name})
