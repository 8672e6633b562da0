"""Flight of one UAV: one manoeuvre at a time, stepped at each update.

Two kinds of threads meet here. The backend's update thread calls `step` at each new snapshot; any other thread begins
manoeuvres. All of them change what is flown by one swap; see `Flight._swap`.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from ual.errors import TaskAbortedError, UalError
from ual.geometry import Pose, Twist, Vector3, vector3
from ual.types import State, TaskInfo
from ual_daemon import logs
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import (
    Cause,
    Control,
    Freshness,
    Setpoint,
    SetpointLoss,
    Snapshot,
    Takes,
    VelocitySetpoint,
)
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.current_manoeuvre import SILENT, CurrentManoeuvre, Ending
from ual_daemon.flight.explanation import Explanation
from ual_daemon.flight.manoeuvres.fly_reference import FlyReference, ReferenceRules
from ual_daemon.flight.manoeuvres.land import Landing
from ual_daemon.flight.manoeuvres.manoeuvre import Handover, Manoeuvre
from ual_daemon.flight.manoeuvres.recover import MODE_ENTRY_S, Recover
from ual_daemon.flight.manoeuvres.stand_by import Here, StandBy, TakeToStandBy
from ual_daemon.flight.mission_stop import MissionStop
from ual_daemon.flight.policy.arming import Arming
from ual_daemon.flight.policy.authority import Authority
from ual_daemon.flight.policy.by_hand import ByHand
from ual_daemon.flight.policy.clearance import Clearance
from ual_daemon.flight.policy.following import Following
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.flight.policy.lease import NOBODY, FlightLease
from ual_daemon.flight.position_watch import PositionWatch
from ual_daemon.flight.refusals import (
    just_taken,
    not_pausable,
    not_replaceable,
    on_mission,
    only_watching,
    replaced,
    shutting_down,
    stopping_mission,
)
from ual_daemon.flight.setpoint_sender import LONGEST_BLIND_S, SetpointSender
from ual_daemon.flight.shutdown import Shutdown
from ual_daemon.flight.state import Estimate, estimate, noted, why_it_stands
from ual_daemon.flight.stepper import FlightStepper, has_led_to_ground
from ual_daemon.flight.stopping import Stopping, next_start
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.flight.watched_commands import WatchedCommands
from ual_daemon.tracker.drift import DriftCorrection
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.tracker.references import VELOCITY_TIMEOUT_S, Reference, Velocity
from ual_daemon.trajectory import Motion

_log = logging.getLogger(__name__)

_UNKNOWN = State.UNINITIALIZED
LEASE, VELOCITY = "lease", "set_velocity"
_SETPOINTS = (VELOCITY, "set_pose")
"""The commands that are given as streams."""


class LastCommand(NamedTuple):
    """The newest command that began: its number, counted from the start, and its name.

    A lease that begins or ends is none, and so not counted. But it is noted, by this name: what was planned before it
    does not begin after it.
    """

    number: int
    name: str
    stream_number: int = 0
    """The number of the first velocity of the stream to which a velocity belongs."""

    def goes_on_as(self, newest: LastCommand) -> bool:
        """Returns whether it and the newest command are velocities of one stream."""
        return self.name == newest.name == VELOCITY and self.stream_number == newest.stream_number


class CommandOrigin(NamedTuple):
    """Origin of a command.

    Attributes:
        lease_id: The lease by which it is given.
        since: The last command when it was received; None if it is not to be compared. A command that took long to plan
            must not replace one that was received later.
    """

    lease_id: str = NOBODY
    since: LastCommand | None = None


class RunningRoute(NamedTuple):
    """The way that is flown, as points in the local frame; see `ual.types.Route`."""

    points: Sequence[Vector3]
    task_id: str
    is_goal_moving: bool


class Flight:
    """Flight of one UAV. Any thread may call any member, except `step`: only the update thread."""

    def __init__(
        self,
        backend: Backend,
        limits: CurrentLimits,
        geofence: GeofencePolicy,
        *,
        watch_only: bool = False,
    ) -> None:
        """`watch_only`: sends nothing that flies, whatever comes."""
        self._backend = backend
        self.limits = limits
        self.geofence = geofence
        self.is_watch_only = watch_only
        self.authority = Authority()
        self.arming = Arming()
        self._by_hand = ByHand()
        self.lease = FlightLease()
        self.drift = DriftCorrection()
        """Correction that is added to a commanded velocity."""
        self.following = Following(backend)
        """Whether it follows; see `_stand_by`."""
        self.land_here: Callable[[Snapshot], Handover | None] = lambda _: None
        """Makes a landing on the spot as a task; set from above."""
        self._stood_by = self._logged_fall = 0
        """The `Following.count` for which what was flown has ended, and that which the log has."""
        self._withdrawn: tuple[Manoeuvre, float] | None = None
        """Manoeuvre that was withdrawn in a fall, and when: the mode of its command may come yet."""
        self._explanation = Explanation(backend, self.authority, self.is_in_control)
        self.external_silence = self._explanation.external_silence
        self.position = PositionWatch(self.external_silence)
        """Watch of the sources of the position."""
        self._flown = CurrentManoeuvre()
        self.sender = SetpointSender(backend, limits, self._flown)
        self._stopping = Stopping(limits, geofence)
        self._watched = WatchedCommands()
        self._rules = ReferenceRules(backend, limits, geofence, self.authority, self.drift, self.is_in_control)
        self._stepper = FlightStepper(
            backend, self._flown, self._swap, self._rules, self.sender, self._stopping, self._watched
        )
        self._clearance = Clearance(backend, limits, geofence)
        self._shutdown: Shutdown | None = None
        self.is_closing = False
        """Whether commands are refused because of a shutdown. An attribute, because each setpoint looks."""
        self._last_command = LastCommand(0, "")
        self._stepped: tuple[Snapshot, Freshness, Estimate] = (Snapshot(0.0), backend.freshness, Estimate(_UNKNOWN, ""))
        """The snapshot of the last step, and the estimate from its data alone, by these limits."""
        self._unstopped: tuple[Manoeuvre, str] | None = None
        """Manoeuvre that was not stopped for the lease, and the reason for the stop: it was not clear yet whether it is
        UAL's.
        """

    # --- What is known ------------------------------------------------------------------------------------------------

    def raw_estimate(self, snapshot: Snapshot) -> Estimate:
        """Estimates the state from the autopilot's data alone, without the manoeuvre that is in progress."""
        return self._explanation.explained(estimate(snapshot, self._backend.freshness), snapshot)

    def estimate(self, snapshot: Snapshot) -> Estimate:
        """Estimates the state from the autopilot's data and the manoeuvre that is in progress."""
        manoeuvre, explanation = self._flown.manoeuvre, self._explanation
        declared = None if manoeuvre is None else manoeuvre.declares
        mission = "" if manoeuvre is None else manoeuvre.mission or manoeuvre.stops_mission
        freshness, (known_of, known_by, known) = self._backend.freshness, self._stepped
        if declared is None and not mission and known_of is snapshot and known_by is freshness:
            found = noted(known, explanation.note)  # as `estimate` finds, without looking at all again
        else:
            found = estimate(snapshot, freshness, declared, explanation.note, mission)
        if found.state is not State.UNINITIALIZED:
            is_plain = declared is not None or found.state is State.FLYING_AUTO  # no call for each setpoint
            found = found if is_plain else explanation.taken(self.arming.explained(found), snapshot)
            return self.following.with_reason(found) if self.following.why else found
        explained, does = explanation.explained(found, snapshot), "" if manoeuvre is None else manoeuvre.unseen
        return replace(explained, why=f"{explained.why}; {does}") if does else explained

    @property
    def takes(self) -> Takes:
        """Setpoints that the autopilot takes."""
        return self._backend.info().takes

    @property
    def limitation(self) -> str:
        """Why the vehicle has fewer capabilities than others, and what is unusual about it; empty if nothing is."""
        info = self._backend.info()
        return "; ".join(filter(None, (info.limitation, info.note)))

    def why_it_may_lie(self, snapshot: Snapshot, state: State) -> str:
        """Returns why a UAV that nobody has seen fly, or that a pilot has flown, may lie on the ground; empty where it
        flies, or is UAL's.
        """
        if state not in (State.FLYING_AUTO, State.FLYING_MANUAL):
            return ""
        if state is State.FLYING_AUTO and self.is_in_control():
            return ""
        stands = why_it_stands(snapshot, is_ground_known=self.geofence.ground.z_m is not None)
        return stands or self._by_hand.why_it_may_lie

    @property
    def is_busy(self) -> bool:
        """Whether the next update has something to do."""
        return not (self._flown.manoeuvre is None and self._watched.is_empty and self._shutdown is None)

    def is_in_control(self) -> bool:
        """Returns whether UAL may send what flies: it was commanded in this flight, or the UAV falls without it."""
        return self.authority.is_ours or (
            not self.is_watch_only and self._backend.info().setpoint_loss is SetpointLoss.FALLS
        )

    @property
    def manoeuvre(self) -> Manoeuvre | None:
        """Present manoeuvre; None if there is none."""
        return self._flown.manoeuvre

    @property
    def trouble(self) -> str:
        """Why the UAV does not do what it was asked last, where no task ends with that; empty otherwise."""
        manoeuvre = self._flown.manoeuvre
        return "" if manoeuvre is None else manoeuvre.trouble

    @property
    def holder(self) -> Cause | None:
        """The holder of the control, where the autopilot's data do not tell; None where they do, or nobody holds it."""
        return self.authority.holder

    @property
    def is_on_mission(self) -> bool:
        """Whether the autopilot flies a mission as a task of UAL, or may fly on one that is being stopped."""
        manoeuvre = self._flown.manoeuvre
        return manoeuvre is not None and bool(manoeuvre.mission or manoeuvre.stops_mission)

    @property
    def is_stopping_mission(self) -> bool:
        """Whether one is being stopped."""
        manoeuvre = self._flown.manoeuvre
        return manoeuvre is not None and bool(manoeuvre.stops_mission)

    def is_following(self, snapshot: Snapshot) -> bool:
        """Returns whether the UAV follows references: in the air, or on the ground after what is flown has led there.

        An autopilot that has touched down so must not lose its stream before it disarms; see `ReferenceRules`.
        """
        state, manoeuvre = self.raw_estimate(snapshot).state, self._flown.manoeuvre
        if state is not State.LANDED_ARMED or manoeuvre is None:
            return state is State.FLYING_AUTO
        return has_led_to_ground(manoeuvre, snapshot)

    def task_info(self) -> TaskInfo | None:
        """Returns the running task; None if there is none."""
        manoeuvre = self._flown.manoeuvre
        return None if manoeuvre is None or manoeuvre.task is None else manoeuvre.task.info()

    def reference_pose(self) -> Pose | None:
        """Returns the pose that is commanded now, in the local frame; None if no pose is."""
        reference = self._current_reference()
        return None if reference is None else reference.pose()

    def running_route(self, snapshot: Snapshot) -> RunningRoute | None:
        """Returns the way that is flown; None where none is known."""
        manoeuvre = self._flown.manoeuvre
        points = () if manoeuvre is None else manoeuvre.path_points(snapshot.time_s)
        if manoeuvre is None or not points:
            return None
        return RunningRoute(points, "" if manoeuvre.task is None else manoeuvre.task.id, manoeuvre.is_goal_moving)

    def start(self, snapshot: Snapshot) -> Motion:
        """Returns the motion in which the next trajectory begins; see `next_start`."""
        return next_start(self._current_reference(), snapshot)

    def start_time_s(self, snapshot: Snapshot) -> float:
        """Returns the time of that motion, so that what is commanded again and again loses none. To be called after."""
        current = self._current_reference()
        return snapshot.time_s if current is None else current.motion_time_s(snapshot)

    def brake(self, snapshot: Snapshot) -> Reference:
        """Returns the reference that brings the UAV to rest; see `Stopping.stop`."""
        return self._stopping.stop(self._current_reference(), snapshot)

    def _current_reference(self) -> Reference | None:
        manoeuvre = self._flown.manoeuvre
        return None if manoeuvre is None else manoeuvre.current_reference()

    # --- The exchange -------------------------------------------------------------------------------------------------

    def _swap(
        self,
        new: Manoeuvre | None,
        decide: Callable[[Manoeuvre | None], Ending | None],
        first: Setpoint | None = None,
        snapshot: Snapshot | None = None,
    ) -> bool:
        """Exchanges what is flown. All that changes it comes through here, from whatever thread.

        `decide` gets what is flown now, and returns how that ends, and so why; or None: then nothing is exchanged. It
        runs with the lock held. So what it looks at (the lease, the shutdown, a pause) and what it notes (the last
        command, the authority) belong to this exchange. It may refuse the new one by an error, which is raised here.
        `first` is sent at once. Afterwards the old manoeuvre is ended, as that runs callbacks.

        Which threads can meet here, and what happens then:

        - Two commands: the later one to get the lock replaces the other, whose task ends by its name. One that was
          planned before the other began is refused by its `since`.
        - A command, and an update in which the old manoeuvre ends or hands over: the one that comes second finds that
          the old manoeuvre is not flown any more. An update does nothing then; a command replaces what follows.
        - A command, and an update that sends the old manoeuvre's setpoint: see `SetpointSender`.
        - A pause during a step that ends its task or hands it over: the task does not end, but holds on its way.
        - The lease ends while its holder commands: either the command finds its lease gone, and is refused; or it
          begins, and the stop for the lease ends it. What is being planned does not begin after that.
        - The shutdown, and a command: either the command is refused, or the shutdown ends it.
        - A jump of the estimate, and a command: what is flown then hears of the jump. What comes later does not, but
          was assessed by its caller with what the caller knew.

        Returns:
            Whether it was exchanged.

        """
        with self._flown.lock:
            old = self._flown.manoeuvre
            ending = decide(old)
            if ending is None:
                return False
            self._flown.manoeuvre = new
        if new is not None and first is not None and snapshot is not None:
            self.sender.send(new, first, snapshot)
        if old is not None and old.is_awaited and not ending.goes_on:
            old.end(ending.error)
        return True

    # --- What is commanded --------------------------------------------------------------------------------------------

    def request_home(self) -> None:
        """See `Backend.request_home`."""
        self._backend.request_home()

    def require_replaceable(self, command: str) -> None:
        """Checks that a command may end the manoeuvre that is in progress.

        Raises:
            WrongStateError: Only the safety pilot can abort that manoeuvre.

        """
        manoeuvre = self._flown.manoeuvre
        if manoeuvre is not None and not manoeuvre.is_replaceable and self.has_safety_pilot:
            raise not_replaceable(manoeuvre, command)

    @property
    def has_safety_pilot(self) -> bool:
        """Whether a person can take over at any time. Take-offs and landings are then left to them to abort."""
        return self._backend.info().has_safety_pilot

    @property
    def last_command(self) -> LastCommand:
        """The newest command that began; see `begin`."""
        return self._last_command

    def begin(self, manoeuvre: Manoeuvre, order: CommandOrigin, judged: Snapshot | None = None) -> None:
        """Begins a manoeuvre, and ends the one before. `judged` is the snapshot in which it may; None: the newest one.

        Raises:
            WrongStateError: UAL is shutting down, the manoeuvre before may not be replaced, or others have just taken
                the UAV from a mission.
            LeaseHeldError: Another program holds the lease.
            LeaseLostError: The lease of the order has ended.
            TaskAbortedError: Another command, such as an abort, began after `CommandOrigin.since`.

        """
        snapshot = judged or self._backend.snapshot()
        manoeuvre.begins_in(snapshot.control.settled_mode)
        try:
            self._swap(manoeuvre, partial(self._begins_over, manoeuvre, order, snapshot))
        except UalError as error:
            manoeuvre.end(error)
            raise

    def adopt(self, manoeuvre: Manoeuvre) -> bool:
        """Begins a manoeuvre of UAL that was in progress before this daemon. Returns False where something is flown."""

        def begins(old: Manoeuvre | None) -> Ending | None:
            if old is not None or self.is_closing or self.is_watch_only:
                return None
            self.authority.begin()
            return SILENT

        return self._swap(manoeuvre, begins)

    def begin_reference(
        self, reference: Reference, by: str, snapshot: Snapshot, order: CommandOrigin, *, only_task_id: str = ""
    ) -> None:
        """Begins a reference, sends its first setpoint, and ends the manoeuvre before; see `begin` for the errors.

        With `only_task_id` nothing happens unless that task is the running one.
        """
        first = reference.setpoint(snapshot)  # before the update thread has the reference and steps it
        new = FlyReference(by, reference, self._rules)
        new.is_timed = reference.is_timed
        self._swap(new, partial(self._begins, new, order, only_task_id), first, snapshot)

    def renew_velocity(self, twist: Twist, lease_id: str) -> bool:
        """Flies on with another velocity of a stream, along the axes of ``<ns>/odom``, without judging all again.

        Returns False, and does nothing, where something is to be assessed: `begin_reference` is then the way.
        """
        if self._clearance.rests_count > 0:
            self._clearance.rests_count -= 1
            return False
        (snapshot, now_s), flown, sender, drift = self._backend.newest(), self._flown, self.sender, self.drift
        if (
            self.following.why
            or self.is_watch_only
            or now_s - snapshot.updated_s > LONGEST_BLIND_S
            or not self._clearance.admits(twist, snapshot, now_s)
        ):
            return False
        new = FlyReference(
            VELOCITY, Velocity(twist, drift, in_body=False, expires_s=now_s + VELOCITY_TIMEOUT_S), self._rules
        )
        new.is_timed = True
        v, more = twist.linear, drift.velocity
        velocity = vector3(v.x + more.x, v.y + more.y, v.z + more.z)
        setpoint = VelocitySetpoint(velocity, twist.angular.z + drift.yaw_rate_rad_s)  # as `Velocity.setpoint`
        given = new, setpoint
        with flown.lock:  # as `_swap`, and `_begins` with the answers of a stream that goes on
            old, last = flown.manoeuvre, self._last_command
            goes_on = old.__class__ is FlyReference and old is not None and old.is_timed and self.authority.is_ours
            if not goes_on or self.is_closing or lease_id != self.lease.id:
                return False
            number = last.number + 1
            stream_number = last.stream_number if last.name == VELOCITY else number
            self._last_command = tuple.__new__(LastCommand, (number, VELOCITY, stream_number))  # one call less
            flown.manoeuvre, sender.newest = new, given
        sender.send_newest(given, setpoint, now_s)
        return True

    def _begins_over(
        self, new: Manoeuvre, order: CommandOrigin, snapshot: Snapshot, old: Manoeuvre | None
    ) -> Ending | None:
        """Decides as `_begins` does, but refuses a command where others have just taken the UAV from a mission.

        UAL sends nothing in their mode, and what took it is reported later.
        """
        is_of_mission = old is not None and bool(old.mission or old.stops_mission)
        if old is not None and is_of_mission and not new.overrules_nobody and old.is_overtaken(snapshot):
            raise just_taken(new.name, snapshot)
        return self._begins(new, order, "", old)

    def _begins(self, new: Manoeuvre, order: CommandOrigin, only_task_id: str, old: Manoeuvre | None) -> Ending | None:
        """Decides whether what was commanded begins now: returns how the old one ends, or raises why it may not."""
        by, (lease_id, since) = new.name, order
        if only_task_id and not _is_task(old, only_task_id):
            return None
        if self.is_closing:
            raise shutting_down(by)
        if self.is_watch_only:
            raise only_watching(by)
        if lease_id != self.lease.id and (refusal := self.lease.refusal(by, lease_id)):
            raise refusal
        if old is not None and not old.is_replaceable and self.has_safety_pilot:
            raise not_replaceable(old, by)
        last = self._last_command
        is_of_mission = old is not None and (old.mission or old.stops_mission)
        is_refused = is_of_mission or (old is not None and old.refuses_setpoints and by in _SETPOINTS)
        if old is not None and is_refused and not new.is_awaited:
            raise stopping_mission(by) if old.stops_mission else on_mission(by)
        if since is not None and since is not last and not (new.refuses_setpoints and since.goes_on_as(last)):
            other = last.name
            raise TaskAbortedError(f"{by}: replaced by {other}, while it was planned", {"by": other})
        if old is not None and new.is_awaited:
            new.replaces(old)
        if new.is_awaited or not self.authority.is_ours:  # a call that each setpoint of a stream would cost
            self.authority.begin()
        number = stream_number = last.number + 1
        if by == last.name == VELOCITY and old is not None and old.is_timed:
            stream_number = last.stream_number
        self._last_command = LastCommand(number, by, stream_number)
        return SILENT if old is None or not old.is_awaited else Ending(replaced(old, by))

    def _note_command(self, name: str) -> None:
        """Notes a command: what was planned before it does not begin any more. Called with the lock held."""
        self._last_command = LastCommand(self._last_command.number + 1, name)

    def stop_for_lease(self, why: str) -> None:
        """Aborts what is in progress because the lease begins or ends: the UAV holds its position.

        A take-off or a landing goes on, and in a flight that is not UAL's nothing is sent. An arming, or a command that
        takes control back, does not leave any more if it has not left yet.
        """
        snapshot = self._backend.snapshot()
        self._watched.end_callers(TaskAbortedError(why, {"by": "lease"}), snapshot)
        if self.is_on_mission:
            self._stop_mission_for_lease(why, snapshot)
        elif self.is_following(snapshot):
            stop = self.brake(snapshot)
            new = FlyReference(LEASE, stop, self._rules)
            self._swap(new, partial(self._ends_with_lease, why, new), stop.setpoint(snapshot), snapshot)
        else:
            self._swap(None, partial(self._ends_with_lease, why, None))

    def _stop_mission_for_lease(self, why: str, snapshot: Snapshot) -> None:
        stop = self.mission_stop(LEASE, snapshot)
        mission = self._flown.manoeuvre
        is_overtaken = mission is not None and mission.is_overtaken(snapshot)
        if stop is None or (is_overtaken and not stop.manoeuvre.overrules_nobody):
            self._swap(None, partial(self._ends_with_lease, why, None))
            return
        stop.manoeuvre.begins_in(snapshot.control.settled_mode)
        if self._swap(stop.manoeuvre, partial(self._ends_with_lease, why, stop.manoeuvre)):
            stop.begin()

    def mission_stop(self, by: str, snapshot: Snapshot) -> Handover | None:
        """Returns what is flown instead of the mission that the autopilot flies; see `MissionStop.after`."""
        mission = self._flown.manoeuvre
        if mission is None:  # it has ended just now
            return None
        state = self.raw_estimate(snapshot).state
        return MissionStop(by, mission, self._backend).after(state, snapshot, mission)

    def _ends_with_lease(self, why: str, new: Manoeuvre | None, old: Manoeuvre | None) -> Ending | None:
        self._last_command = LastCommand(self._last_command.number, LEASE)
        if old is not None and (old.stops_mission or not (old.is_replaceable or _is_recover_unsent(old))):
            return None
        if not self.authority.is_ours:
            self._unstopped = None if old is None else (old, why)
            return None
        if old is not None and new is not None:
            new.replaces(old)
        return SILENT if old is None else Ending(TaskAbortedError(f"{old.name}: {why}", {"by": "lease"}))

    def drop_task(self, task_id: str, by: str, lease_id: str) -> None:
        """Ends a task without stopping the UAV, which UAL does not control now. Nothing happens if it does not run.

        Raises:
            WrongStateError: Only the safety pilot can abort what it does now.
            LeaseHeldError: Another program holds the lease.

        """
        self._swap(None, partial(self._drops, task_id, by, lease_id))

    def _drops(self, task_id: str, by: str, lease_id: str, old: Manoeuvre | None) -> Ending | None:
        if old is None or not _is_task(old, task_id):
            return None
        if (refusal := self.lease.refusal(by, lease_id)) is not None:
            raise refusal
        if not old.is_replaceable:
            raise not_replaceable(old, by)
        return Ending(replaced(old, by))

    def pause(self, only_task_id: str = "") -> VehicleTask:
        """Makes the task that runs hold on its way, and returns it. A command that is being planned does not begin.

        Raises:
            WrongStateError: No task runs (or not the one of `only_task_id`), or it cannot be paused.

        """
        with self._flown.lock:
            task = self._pausable_task("pause", only_task_id)
            task.is_paused = True
            self._note_command("pause")
        return task

    def resume(self, only_task_id: str = "") -> VehicleTask:
        """Makes the paused task go on, and returns it.

        Raises:
            WrongStateError: No task runs (or not the one of `only_task_id`), or it is not paused.

        """
        with self._flown.lock:
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
        manoeuvre = self._flown.manoeuvre
        if manoeuvre is None or manoeuvre.task is None:
            raise not_pausable(command, "no task runs")
        if only_task_id and manoeuvre.task.id != only_task_id:
            raise not_pausable(command, f"the task {only_task_id[:100]} does not run any more")
        if manoeuvre.why_not_pausable:
            raise not_pausable(command, f"{manoeuvre.name} cannot be paused: {manoeuvre.why_not_pausable}")
        return manoeuvre.task

    def watch(self, command: AutopilotCommand, is_done: Callable[[Snapshot], bool], lease_id: str) -> Future[None]:
        """Watches a caller's command that is not a manoeuvre, before it is sent; see `WatchedCommands.add`.

        Raises:
            WrongStateError: UAL is shutting down.
            LeaseHeldError: Another program holds the lease.
            LeaseLostError: The lease of the command has ended.

        """
        future = self._watched.add(command, is_done, is_callers=True)
        # Only now: a lease that ends later ends the command, too.
        if lease_id != self.lease.id and (refusal := self.lease.refusal(command.what, lease_id)) is not None:
            self._watched.drop(command)
            raise refusal
        return future

    # --- The end ------------------------------------------------------------------------------------------------------

    def prepare_shutdown(self) -> Future[None]:
        """See `ual_daemon.vehicle.vehicle.Vehicle.prepare_shutdown`."""
        shutdown = Shutdown(self._backend, self.is_in_control, self.authority.leave)
        self._swap(None, partial(self._ends_with_shutdown, shutdown))
        begun = self._shutdown
        assert begun is not None
        if begun is shutdown:
            self._watched.refuse_new()
            self._step_shutdown(self._backend.snapshot(), shutdown)
        return begun.future

    def _ends_with_shutdown(self, shutdown: Shutdown, old: Manoeuvre | None) -> Ending | None:
        """A take-off, a landing or the stop of a mission ends first. A reference goes on until the autopilot holds."""
        if self._shutdown is not None:
            return None
        self._shutdown, self.is_closing = shutdown, True
        if old is None or not old.is_awaited or not old.is_replaceable or old.stops_mission:
            return None
        return _by_shutdown(old)

    def _step_shutdown(self, snapshot: Snapshot, shutdown: Shutdown) -> None:
        """Steps the shutdown, once no manoeuvre is in progress but a reference, or a stop that is not seen."""
        manoeuvre = self._flown.manoeuvre
        if shutdown.future.done():
            return
        if manoeuvre is None or not manoeuvre.is_awaited:
            is_over = shutdown.step(snapshot)
        else:
            is_over = bool(manoeuvre.stops_mission) and shutdown.leaves(manoeuvre, snapshot)
        if is_over:
            self._swap(None, partial(_ends_with_handover, manoeuvre))
            shutdown.finish()

    def close(self) -> None:
        """Ends what is left. To be called once no more updates come."""
        shutdown = Shutdown(self._backend, self.is_in_control, self.authority.leave)
        error = TaskAbortedError(f"{self._backend.options.ns} was closed", {"by": "close"})
        self._swap(None, partial(self._ends_with_close, shutdown, error))
        self.sender.forget()
        self._stepper.forget()
        self._watched.end_all(error)
        if self._shutdown is not None:
            self._shutdown.finish()

    def _ends_with_close(self, shutdown: Shutdown, error: UalError, _: Manoeuvre | None) -> Ending:
        self._shutdown, self.is_closing = self._shutdown or shutdown, True
        return Ending(error)

    # --- Updates ------------------------------------------------------------------------------------------------------

    def step(self, snapshot: Snapshot) -> None:
        """Makes one update."""
        freshness, manoeuvre = self._backend.freshness, self._flown.manoeuvre
        by_data = estimate(snapshot, freshness)
        self._stepped = (snapshot, freshness, by_data)
        raw = self._explanation.explained(by_data, snapshot)
        if snapshot.time_s >= self.position.due_s:
            self.position.update(snapshot)
        if manoeuvre is not None:
            manoeuvre.waits_for = self.position.waits
        self.authority.follow(raw.state, snapshot)
        self._by_hand.observe(raw.state, snapshot, self.geofence.ground.z_m, is_ours=self.authority.is_ours)
        self.arming.follow(snapshot, is_idle=manoeuvre is None)
        is_taking_off = manoeuvre is not None and manoeuvre.declares is State.TAKING_OFF
        is_led = (
            manoeuvre is not None
            and manoeuvre.declares is not State.LANDING
            and manoeuvre.current_reference() is not None
        )
        is_on_way = is_led and manoeuvre is not None and manoeuvre.task is not None
        self.geofence.observe(snapshot, raw, is_taking_off=is_taking_off, is_on_way=is_on_way, is_led=is_led)
        if snapshot.time_s >= self.following.due_s:
            # A take-off watches its way by itself: on the ground the estimate is not the place.
            current = None if manoeuvre is None or is_taking_off else manoeuvre.current_reference
            self.following.observe(snapshot, raw, current)
            if self.following.why and snapshot.motion.pose is not None:
                height_m, is_known = self.geofence.height_m(snapshot)
                self.following.note_height(height_m, is_ground_known=is_known)
        # While the cause is open, what took it is reported within a moment.
        if self.following.why and snapshot.control.held_by is not Cause.OPEN:
            self._stand_by(snapshot, raw)
        self._stepper.update(snapshot, raw)
        if self._unstopped is not None and self.authority.is_ours:
            (unstopped, why), self._unstopped = self._unstopped, None
            if unstopped is self._flown.manoeuvre:
                self.stop_for_lease(why)
        self._watched.step(snapshot, raw)
        trouble, position = self.trouble, self.position.trouble
        if self.external_silence.is_doubtful:
            position = self.position.doubts(snapshot.time_s)
        self._explanation.update(snapshot, f"{trouble}; {position}" if trouble and position else trouble or position)
        if self._shutdown is not None:
            self._step_shutdown(snapshot, self._shutdown)

    def _stand_by(self, snapshot: Snapshot, raw: Estimate) -> None:
        """Withdraws what a UAV that does not follow was to fly, so that nothing moves when its motors work again.

        What UAL flies by references ends in the present pose. Where the autopilot flies for UAL by itself (a mission, a
        take-off, a landing), it is to land on the spot. What was commanded since is left: a landing, or taking control.
        So is a mode that others have chosen: a pilot who stops the motors takes over with the same gesture.
        """
        following, old = self.following, self._flown.manoeuvre
        if self._logged_fall != following.count:
            self._logged_fall = following.count
            logs.event(_log, logging.ERROR, "does_not_follow", why=following.why, remedy=following.with_reason(raw).why)
        is_first, is_own = self._stood_by != following.count, self._is_in_withdrawn_mode(old, snapshot, raw)
        is_idle = isinstance(old, StandBy | Landing | Recover) or (old is None and not self._has_references(raw))
        if is_idle and not is_first and not is_own:
            return
        if old is not None and not is_own and old.is_overtaken(snapshot):
            # Its step ends it where others have chosen the mode, which is left alone. Where the mode is that of its own
            # command, it goes on, and ends by the next update.
            return
        self._stood_by = following.count
        # A flight that UAL's arming has begun is no task, and climbs on all the same.
        if old is not None or raw.state is State.FLYING_AUTO or self._begun_by_arming(raw):
            self._withdraw(old, snapshot, raw)

    def _is_in_withdrawn_mode(self, old: Manoeuvre | None, snapshot: Snapshot, raw: Estimate) -> bool:
        """Returns whether the mode has come to which a command leads that was withdrawn as the UAV fell."""
        if not isinstance(old, StandBy) or self._withdrawn is None or snapshot.control.held_by is not None:
            return False
        withdrawn, since_s = self._withdrawn
        is_own = raw.state is withdrawn.declares or withdrawn.led_to(snapshot) is True
        return is_own and raw.state is not State.FLYING_AUTO and snapshot.time_s - since_s <= MODE_ENTRY_S

    def _withdraw(self, old: Manoeuvre | None, snapshot: Snapshot, raw: Estimate) -> None:
        error = TaskAbortedError(
            f"{'' if old is None else f'{old.name}: '}{self.following.why}",
            {**self.following.metadata, "state": raw.state.name},
        )
        new: Handover | None = None
        if self._has_references(raw):
            here = Here(snapshot, self.following)
            new = Handover(StandBy("stand_by", here, self._rules, following=self.following, land=self.land_here))
        elif raw.state in (State.FLYING_MANUAL, State.TAKING_OFF, State.LANDING):
            new = self._end_own_flight(snapshot, raw.state)
        if new is not None:
            new.manoeuvre.begins_in(snapshot.control.settled_mode)
            new.manoeuvre.led = None if old is None else old.leads()
        if old is not None and old.is_awaited:
            self._withdrawn = (old, snapshot.time_s)
        to = None if new is None else new.manoeuvre
        if self._swap(to, lambda flown: Ending(error) if flown is old else None) and new is not None:
            new.begin()

    def _begun_by_arming(self, raw: Estimate) -> bool:
        return raw.state in (State.TAKING_OFF, State.FLYING_MANUAL) and self.arming.is_ours_to_end

    def _has_references(self, raw: Estimate) -> bool:
        return raw.state is State.FLYING_AUTO and self.is_in_control()

    def _end_own_flight(self, snapshot: Snapshot, state: State) -> Handover | None:
        """Returns what ends what the autopilot flies by itself; None where it takes no other mode."""
        mode = snapshot.control.mode
        if snapshot.control.held_by in (Cause.TERMINATION, Cause.SAFETY_PILOT):
            return None
        if mode is None or mode.value.control is Control.REFERENCES:  # ArduPilot takes off in the mode for references
            return self.land_here(snapshot)
        take = TakeToStandBy(state, self._backend.take_control, self.land_here)
        return Handover(take, partial(take.send, snapshot))

    def estimate_jumped(self, jump: EstimateJump, snapshot: Snapshot) -> None:
        """Takes note that the autopilot's estimate has jumped: the UAV must not follow it, but hold where it is.

        Called by the update thread, before the step. What was flown to lies elsewhere now, or the nose would turn to a
        heading that was another one, so it ends. A take-off, a landing and a velocity go on.
        """
        logs.event(_log, logging.WARNING, "estimate_jumped", **jump.fields)
        self.geofence.estimate_jumped(jump.offset)
        self.drift.forget()
        self.following.forget()
        stop = self._stopping.stop_after_jump(self._current_reference(), jump, snapshot)
        self._swap(FlyReference("stop", stop, self._rules), partial(_ends_by_jump, jump, stop))


def _by_shutdown(old: Manoeuvre) -> Ending:
    return Ending(TaskAbortedError(f"{old.name}: UAL is shutting down", {"by": "shutdown"}))


def _ends_with_handover(left: Manoeuvre | None, old: Manoeuvre | None) -> Ending | None:
    """`left` is what the shutdown does not wait for any more."""
    if old is None or not old.is_awaited:
        return SILENT
    return _by_shutdown(old) if old is left else None


def _ends_by_jump(jump: EstimateJump, stop: Reference, old: Manoeuvre | None) -> Ending | None:
    error = None if old is None else old.estimate_jumped(jump, stop)
    return None if error is None else Ending(error)


def _is_recover_unsent(manoeuvre: Manoeuvre) -> bool:
    """Returns whether it is to take control back, and waits until it is known what took the UAV."""
    return isinstance(manoeuvre, Recover) and manoeuvre.command is not None and not manoeuvre.command.is_sent


def _is_task(manoeuvre: Manoeuvre | None, task_id: str) -> bool:
    return manoeuvre is not None and manoeuvre.task is not None and manoeuvre.task.id == task_id
