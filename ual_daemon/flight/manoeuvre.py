"""What a UAV can be busy with: take-off, landing, following a trajectory, taking control back.

A manoeuvre is stepped at each update, by the update thread, with the newest snapshot; it answers with a setpoint to
send and, once, with how it ended. It never blocks and sends nothing itself.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial

from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError, UalError, UalTimeoutError
from ual.geometry import Vector3, wrap_angle
from ual.types import Limits, State
from ual_daemon.backends.values import Control, LandedState, Setpoint, Snapshot
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import Progress, VehicleTask
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.pure_pursuit import Pursuit
from ual_daemon.tracker.references import LONGEST_STOP_S, Follow, Hold, Reference, brake, measured_motion
from ual_daemon.trajectory import Line, Motion, Trajectory

COMMAND_PATIENCE_S = 5.0
"""How long a command may take to show its effect. A PX4 answers within 15 ms, and shows a mode within 1 s."""

_TIMEOUT_FACTOR = 3.0
_TIMEOUT_MARGIN_S = 20.0
_SLOWEST_LANDING_M_S = 0.2
_LOST_ACK_S = 1.0
_TAKE_OFF_TOLERANCE = 0.05
_TAKE_OFF_LEAST_TOLERANCE_M = 0.1


@dataclass(frozen=True, slots=True)
class Step:
    """What a manoeuvre says at an update: a setpoint (or none), and, when it `has_ended`, with which error (or none)
    and what is to be flown then (None: stop where it is).
    """

    setpoint: Setpoint | None = None
    has_ended: bool = False
    error: UalError | None = None
    then: Reference | None = None


def failed(error: UalError) -> Step:
    """The end, by an error."""
    return Step(has_ended=True, error=error)


class Command:
    """A command to the autopilot, judged by what the vehicle then does; the acknowledgement only tells refusals."""

    def __init__(self, what: str, now_s: float) -> None:
        self.sent_s = now_s
        self.what = what
        self._ack: Future[None] | None = None
        self._is_withdrawn = False

    def send(self, sender: Callable[[], Future[None]]) -> None:
        """Sends it, unless it was withdrawn before. What the backend raises counts as its refusal."""
        if self._is_withdrawn:
            return
        try:
            self._ack = sender()
        except UalError as error:
            self._ack = Future()
            self._ack.set_exception(error)
        if self._is_withdrawn:  # meanwhile, by another thread that may not have seen the future
            self._ack.cancel()

    def withdraw(self) -> None:
        """Takes it back as far as it was not sent: it must not be sent again once nobody wants its effect any more (an
        OFFBOARD that is repeated for want of an answer would take the UAV from the safety pilot).
        """
        self._is_withdrawn = True
        if self._ack is not None:
            self._ack.cancel()

    @property
    def is_answered(self) -> bool:
        """Whether the autopilot has said yes or no."""
        return self._ack is not None and self._ack.done() and not self._ack.cancelled()

    @property
    def is_accepted(self) -> bool:
        """Whether the autopilot has said yes."""
        return self.is_answered and self._error() is None

    def _error(self) -> BaseException | None:
        return None if self._ack is None or not self.is_answered else self._ack.exception()

    def refusal(self) -> UalError | None:
        """The autopilot's no, if it has said it."""
        error = self._error()
        return error if error is None or isinstance(error, UalError) else UalError(f"{self.what}: {error}")

    def failure(self, snapshot: Snapshot) -> UalError | None:
        """Why it has failed, if it has: it was refused, or shows no effect in time."""
        refusal = self.refusal()
        if refusal is not None:
            return refusal
        if snapshot.time_s - self.sent_s <= COMMAND_PATIENCE_S:
            return None
        words = f"; it says: {snapshot.status_text}" if snapshot.status_text else ""
        if self.is_answered:
            return RejectedByAutopilotError(
                f"the autopilot accepted to {self.what}, but has not after {COMMAND_PATIENCE_S:g} s{words}"
            )
        return UalTimeoutError(f"the autopilot did not answer when told to {self.what}{words}")


class Manoeuvre(ABC):
    """Something that the UAV is busy with.

    `declares` is the state that it means for the estimator; `is_replaceable` says whether a new command may end it.
    `task` is None for what is not a task of the interface.
    """

    declares: State | None = None
    is_replaceable = True

    def __init__(self, name: str, task: VehicleTask | None) -> None:
        self.name = name
        self.task = task
        self.command: Command | None = None
        self.future: Future[None] = Future() if task is None else task.future
        if task is None:
            self.future.set_running_or_notify_cancel()  # nobody but `end` ends it

    @abstractmethod
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        """One update; `estimate` is what the data say without this manoeuvre."""

    def pose_reference(self) -> Reference | None:
        """What it flies by now, if it does by references of ours."""
        return None

    def end(self, error: UalError | None) -> None:
        """Withdraws its command, and tells those who wait. No lock may be held."""
        if self.command is not None:
            self.command.withdraw()
        if self.task is not None:
            self.task.end(error)
        elif error is None:
            self.future.set_result(None)
        else:
            self.future.set_exception(error)


def why_not_ours(snapshot: Snapshot, estimate: Estimate, during: str) -> UalError | None:
    """Why a manoeuvre cannot go on, if so: link or position lost, disarmed, or not flown by our references."""
    blind = _why_blind(estimate, during)
    if blind is not None:
        return blind
    if estimate.state is State.LANDED_DISARMED:
        return TaskAbortedError(f"{during}: the motors were disarmed", {"by": "autopilot", "state": "LANDED_DISARMED"})
    assert snapshot.mode is not None
    if snapshot.mode.value.control is not Control.REFERENCES:
        return _taken(snapshot, during)
    return None


def _why_blind(estimate: Estimate, during: str) -> UalError | None:
    if not estimate.is_link_up:
        return LinkLostError(f"{during}: {estimate.why}", {"state": State.UNINITIALIZED.name})
    if estimate.state is State.UNINITIALIZED:
        return TaskAbortedError(f"{during}: {estimate.why}", {"by": "autopilot", "state": State.UNINITIALIZED.name})
    return None


def _taken(snapshot: Snapshot, during: str) -> TaskAbortedError:
    mode = snapshot.mode.value.name if snapshot.mode is not None else "unknown"
    return TaskAbortedError(
        f"{during}: taken by the safety pilot (the autopilot is in mode {mode}); "
        "recover_from_manual takes control back",
        {"by": "safety pilot", "state": State.FLYING_MANUAL.name, "mode": mode},
    )


class _Arrival:
    """Judges arrival: within tolerance, and slow, on the mean of a while: an estimate is noisy, and a moment's luck (or
    bad luck) shall not count.
    """

    def __init__(self, position: Vector3, yaw_rad: float, tolerance: ToleranceSettings) -> None:
        self._position, self._yaw_rad, self._tolerance = position, yaw_rad, tolerance
        self._seen: deque[tuple[float, Vector3, float, Vector3]] = deque()  # time, and how far off: place, turn, speed

    def look(self, snapshot: Snapshot) -> None:
        """Takes in where the UAV is; to be told at each update."""
        motion = measured_motion(snapshot)
        turn = wrap_angle(motion.yaw_rad - self._yaw_rad)
        self._seen.append((snapshot.time_s, motion.position - self._position, turn, motion.velocity))
        # One that is older than the while stays: so the others span it.
        while len(self._seen) > 1 and snapshot.time_s - self._seen[1][0] >= self._tolerance.dwell_s:
            self._seen.popleft()

    def has_arrived(self, snapshot: Snapshot) -> bool:
        """Whether it is there."""
        if not self._seen or snapshot.time_s - self._seen[0][0] < self._tolerance.dwell_s:
            return False
        place, turn, velocity = self._mean()
        tolerance = self._tolerance
        return (
            place.norm() <= tolerance.position_m
            and abs(turn) <= tolerance.heading_rad
            and velocity.norm() <= tolerance.speed_m_s
        )

    def _mean(self) -> tuple[Vector3, float, Vector3]:
        place, velocity, count = Vector3(), Vector3(), len(self._seen)
        sine = cosine = 0.0  # half a turn off, one way or the other, is no turn on the mean of the angles
        for _, offset, turned, speed in self._seen:
            place, velocity = place + offset, velocity + speed
            sine, cosine = sine + math.sin(turned), cosine + math.cos(turned)
        return place / count, math.atan2(sine, cosine), velocity / count

    def gap(self) -> str:
        """How far it is off, for people."""
        place, turn, velocity = self._mean()
        return f"{place.norm():.2f} m and {abs(turn):.2f} rad off, at {velocity.norm():.2f} m/s"


class FollowTrajectory(Manoeuvre):
    """A go-to or a path."""

    def __init__(
        self,
        name: str,
        task: VehicleTask,
        trajectory: Trajectory,
        tolerance: ToleranceSettings,
        tracker: type[Follow | Pursuit] = Follow,
        planned_s: float | None = None,
    ) -> None:
        """`planned_s` is when the UAV was told the motion that the trajectory begins with; None: as it begins."""
        super().__init__(name, task)
        self._tracker = tracker
        self._task = task
        end = trajectory.end()
        self._trajectory = trajectory
        self._tolerance = tolerance
        # Known before the first step: what is commanded before that goes on from it.
        self._follow = None if planned_s is None else tracker(trajectory, planned_s, tolerance)
        self._then = Hold(end.position, end.yaw_rad)
        self._arrival = _Arrival(end.position, end.yaw_rad, tolerance)
        stops_s = len(trajectory.stops_s) * LONGEST_STOP_S
        self._longest_s = (trajectory.duration_s + stops_s) * _TIMEOUT_FACTOR + _TIMEOUT_MARGIN_S
        self._started_s: float | None = None

    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_not_ours(snapshot, estimate, self.name)
        if lost is not None:
            return failed(lost)
        if self._started_s is None:
            self._started_s = snapshot.time_s
        if self._follow is None:
            self._follow = self._tracker(self._trajectory, snapshot.time_s, self._tolerance)
        follow = self._follow
        setpoint = follow.setpoint(snapshot)
        self._task.report(partial(self._progress, snapshot, follow.motion(snapshot), follow.time_s))
        self._arrival.look(snapshot)
        if follow.is_finished and self._arrival.has_arrived(snapshot):
            return Step(setpoint, has_ended=True, then=self._then)
        if snapshot.time_s - self._started_s > self._longest_s:
            return failed(
                UalTimeoutError(
                    f"{self.name}: not there after {self._longest_s:.0f} s: {self._arrival.gap()}",
                    {"state": estimate.state.name},
                )
            )
        return Step(setpoint)

    def _progress(self, snapshot: Snapshot, motion: Motion, time_s: float) -> Progress:
        """How far it has come where the reference has that motion, at a time of the trajectory."""
        lag_m = (measured_motion(snapshot).position - motion.position).norm()
        left_m = self._trajectory.length_left_m(time_s) + lag_m
        length_m, duration_s = self._trajectory.length_m, self._trajectory.duration_s
        if length_m > 0.0:
            progress = max(0.0, 1.0 - left_m / length_m)
        else:
            progress = time_s / duration_s if duration_s > 0.0 else 1.0
        return Progress(min(1.0, progress), left_m, self._trajectory.waypoint_at(time_s))

    def pose_reference(self) -> Reference | None:
        return self._follow


class TakeOff(Manoeuvre):
    """Straight up to a height above where it stands."""

    declares = State.TAKING_OFF
    is_replaceable = False

    def __init__(
        self,
        task: VehicleTask,
        command: Command,
        start: Snapshot,
        height_m: float,
        limits: Limits,
        tolerance: ToleranceSettings,
        *,
        on_setpoints: bool,
    ) -> None:
        super().__init__("take_off", task)
        self._task = task
        self._command = self.command = command
        self._height_m = height_m
        self._limits = limits
        self._on_setpoints = on_setpoints
        self._slow_m_s = tolerance.speed_m_s
        self._dwell_s = tolerance.dwell_s
        motion = measured_motion(start)
        self._ground_z = motion.position.z
        self._ground = Hold(motion.position, motion.yaw_rad)
        self._top = Hold(motion.position + Vector3(0.0, 0.0, height_m), motion.yaw_rad)
        self._tolerance_m = max(_TAKE_OFF_LEAST_TOLERANCE_M, _TAKE_OFF_TOLERANCE * height_m)
        self._climb: Follow | None = None
        # One that is in OFFBOARD already may leave it by itself first, as no setpoints came until now.
        self._is_left_over = on_setpoints and _is_ours(start)
        self._was_ours = False
        self._climbing_since_s: float | None = None
        self._up_since_s: float | None = None
        self._longest_s = height_m / limits.climb_speed_m_s * _TIMEOUT_FACTOR + _TIMEOUT_MARGIN_S

    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = _why_blind(estimate, self.name)
        if lost is not None:
            return failed(lost)
        if estimate.state is State.LANDED_DISARMED:
            return failed(TaskAbortedError("take_off: the motors were disarmed", {"by": "autopilot"}))
        if self._climbing_since_s is None:
            if not self._has_begun(snapshot):
                if self._is_taken_before(snapshot, estimate):
                    return failed(_taken(snapshot, self.name))
                failure = self._command.failure(snapshot)
                if failure is not None:
                    return failed(failure)
                return Step(self._ground.setpoint(snapshot) if self._on_setpoints else None)
            self._climbing_since_s = snapshot.time_s
        return self._climb_on(snapshot, estimate, self._climbing_since_s)

    def _is_taken_before(self, snapshot: Snapshot, estimate: Estimate) -> bool:
        """Whether somebody else flies it, or the mode was right and is no more, before it was told to climb for sure.
        It must not be told again: an OFFBOARD that is repeated would take it from the safety pilot, and an autopilot
        that climbs by itself may do so in other modes, too (ArduPilot in LOITER).
        """
        is_ours = _is_ours(snapshot)
        is_taken = (self._was_ours and not is_ours) or estimate.state is State.FLYING_MANUAL
        self._is_left_over = self._is_left_over and is_ours
        self._was_ours = is_ours and not self._is_left_over
        return is_taken

    def _has_begun(self, snapshot: Snapshot) -> bool:
        if not _is_ours(snapshot):
            return False
        # In the right mode; where the acknowledgement got lost, the mode alone must do.
        is_answer_lost = not self._command.is_answered and snapshot.time_s - self._command.sent_s > _LOST_ACK_S
        return self._command.is_accepted or is_answer_lost

    def _climb_on(self, snapshot: Snapshot, estimate: Estimate, since_s: float) -> Step:
        assert snapshot.mode is not None
        ours = (Control.REFERENCES,) if self._on_setpoints else (Control.REFERENCES, Control.TAKE_OFF)
        if snapshot.mode.value.control not in ours:
            return failed(_taken(snapshot, self.name))
        refusal = self._command.refusal()  # one that came late, by a bad link
        if refusal is not None and estimate.state is State.LANDED_ARMED:
            return failed(refusal)
        motion = measured_motion(snapshot)
        setpoint = self._climb_setpoint(snapshot, motion) if self._is_led(snapshot, estimate) else None
        climbed_m = motion.position.z - self._ground_z
        progress = max(0.0, min(1.0, climbed_m / self._height_m))
        self._task.report(partial(Progress, progress, max(0.0, self._height_m - climbed_m)))
        is_up = abs(climbed_m - self._height_m) <= self._tolerance_m and motion.velocity.norm() <= self._slow_m_s
        if not is_up or not self._has_climbed(estimate):
            self._up_since_s = None
        elif self._up_since_s is None:
            self._up_since_s = snapshot.time_s
        if self._up_since_s is not None and snapshot.time_s - self._up_since_s >= self._dwell_s:
            return Step(setpoint, has_ended=True, then=self._top)
        if snapshot.time_s - since_s > self._longest_s:
            return failed(
                UalTimeoutError(
                    f"take_off: at {climbed_m:.2f} m after {self._longest_s:.0f} s, not at {self._height_m:g} m"
                )
            )
        return Step(setpoint)

    def _has_climbed(self, estimate: Estimate) -> bool:
        """Whether the climb is over: a low one is within its tolerance while it still stands on the ground. One that
        climbs by itself is not up before it says so.
        """
        if estimate.state is State.LANDED_ARMED:
            return False
        if self._on_setpoints:
            return self._climb is not None and self._climb.is_finished
        return estimate.state is not State.TAKING_OFF

    def _is_led(self, snapshot: Snapshot, estimate: Estimate) -> bool:
        """Whether it gets references. One that climbs by itself takes none before it says that it has done so. Then it
        is led to the height that was asked for: it may count from elsewhere (home, the ground below its rangefinder).
        """
        is_in_air = snapshot.landed is not None and snapshot.landed.value is LandedState.IN_AIR
        return self._on_setpoints or (is_in_air and estimate.state is State.FLYING_AUTO)

    def _climb_setpoint(self, snapshot: Snapshot, measured: Motion) -> Setpoint:
        if self._climb is None:
            top = self._top.motion(snapshot)
            start = self._ground.motion(snapshot) if self._on_setpoints else measured
            line = Line(start, top.position, top.yaw_rad, self._limits)
            self._climb = Follow(line, snapshot.time_s)
        return self._climb.setpoint(snapshot)

    def pose_reference(self) -> Reference | None:
        return self._climb or self._ground


def _is_ours(snapshot: Snapshot) -> bool:
    """Whether it is in a mode in which a take-off of ours climbs."""
    return snapshot.mode is not None and snapshot.mode.value.control in (Control.REFERENCES, Control.TAKE_OFF)


class Land(Manoeuvre):
    """Down where it is, by the autopilot's own landing."""

    declares = State.LANDING
    is_replaceable = False

    def __init__(self, task: VehicleTask, command: Command, reference: Reference, start: Snapshot) -> None:
        super().__init__("land", task)
        self._command = self.command = command
        self._reference: Reference | None = reference
        self._is_landing = False
        self._begin_z = measured_motion(start).position.z

    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = _why_blind(estimate, self.name)
        if lost is not None:
            return failed(lost)
        if estimate.state in (State.LANDED_ARMED, State.LANDED_DISARMED):
            return Step(has_ended=True)
        assert snapshot.mode is not None
        control = snapshot.mode.value.control
        landed = LandedState.UNKNOWN if snapshot.landed is None else snapshot.landed.value
        if not self._is_landing:
            if control is Control.LAND or landed is LandedState.LANDING:
                self._is_landing, self._reference = True, None
            elif (failure := self._command.failure(snapshot)) is not None:
                return failed(failure)
            elif control is not Control.REFERENCES:
                return failed(_taken(snapshot, self.name))
            elif self._reference is not None:  # it must not lose its references before it lands by itself
                return Step(self._reference.setpoint(snapshot))
        elif control is not Control.LAND and landed is not LandedState.LANDING:
            return failed(_taken(snapshot, self.name))
        descended_m = self._begin_z - measured_motion(snapshot).position.z
        if snapshot.time_s - self._command.sent_s > descended_m / _SLOWEST_LANDING_M_S + 3 * _TIMEOUT_MARGIN_S:
            return failed(UalTimeoutError("land: the UAV has stopped coming down, but reports no ground"))
        return Step()

    def pose_reference(self) -> Reference | None:
        return self._reference


class Recover(Manoeuvre):
    """Takes control back from the safety pilot, and holds the pose that it finds."""

    is_replaceable = False

    def __init__(self, command: Command, limits: Limits) -> None:
        super().__init__("recover_from_manual", None)
        self._command = self.command = command
        self._limits = limits

    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = _why_blind(estimate, self.name)
        if lost is not None:
            return failed(lost)
        if estimate.state is State.FLYING_AUTO:
            stop = brake(snapshot, self._limits)
            return Step(stop.setpoint(snapshot), has_ended=True, then=stop)
        if estimate.state is not State.FLYING_MANUAL:
            return failed(
                TaskAbortedError(
                    f"recover_from_manual: the state became {estimate.state.name}",
                    {"by": "autopilot", "state": estimate.state.name},
                )
            )
        failure = self._command.failure(snapshot)
        if failure is not None:
            return failed(failure)
        motion = measured_motion(snapshot)
        return Step(Hold(motion.position, motion.yaw_rad).setpoint(snapshot))
