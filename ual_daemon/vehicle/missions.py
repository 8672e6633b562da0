"""The missions of one UAV: their start as a task, their jumps, and how a restarted daemon finds its own again."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import replace
from functools import partial

from ual.errors import TaskAbortedError, UalError, WrongStateError
from ual.missions import checks
from ual.missions.items import MOVING, Item, Jump, TakeOff, name_of
from ual.missions.plan import MissionPlan, MissionProgress, MissionStage
from ual.types import State, TaskKind
from ual_daemon import logs
from ual_daemon.backends.base import Backend
from ual_daemon.backends.offers.missions import AutopilotMissions, KeptMission, OnItsOwn
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.flight import LEASE, CommandOrigin, Flight
from ual_daemon.flight.manoeuvres.autopilot_mission import NAME, AutopilotMission, TakeBack
from ual_daemon.flight.policy.lease import NOBODY
from ual_daemon.flight.tasks import Tasks, VehicleTask
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.geodesy import FlatProjection
from ual_daemon.settings import VehicleSettings
from ual_daemon.tracker.references import Reference
from ual_daemon.vehicle.distance_limit import DistanceLimit
from ual_daemon.vehicle.mission_file import MissionFile, RunningMission
from ual_daemon.vehicle.mission_plan import MissionPlanner
from ual_daemon.vehicle.mission_stage import Brought, estimated_stage
from ual_daemon.vehicle.planning import Planning
from ual_daemon.vehicle.preconditions import Preconditions
from ual_daemon.vehicle.refusal_log import accepted
from ual_daemon.vehicle.upload_journal import MISSION, RALLY, UploadJournal

_log = logging.getLogger(__name__)

_ENDS_OF_DAEMON = ("shutdown", "close")
_COMMANDED = "UAL was commanded anew"
DOWNLOAD_RETRY_S = 1.0
"""A mission that could not be read is requested again after this."""
_PATH_DISTANCE_M = 10.0
"""Metres by which a mission's take-off may be off the UAV's position; satellite positions err by a few metres."""


class Missions:
    """The missions of one UAV. Any thread may call any member, except `update`: only the update thread."""

    def __init__(
        self,
        backend: Backend,
        flight: Flight,
        resolver: FrameResolver,
        tasks: Tasks,
        settings: VehicleSettings,
        file: MissionFile | None,
        uploads: UploadJournal,
    ) -> None:
        self._backend = backend
        self._flight = flight
        self._tasks = tasks
        self._preconditions = Preconditions(backend, flight)
        self._planner = MissionPlanner(flight, resolver, DistanceLimit(settings))
        self.plans = Planning()
        """Threads on which `plan` and `check_start` are computed: 20,000 executed items take seconds."""
        self._file = file
        self._uploads = uploads
        self._lost = None if file is None or flight.is_watch_only else file.read()
        """Mission that the daemon flew before its restart, until it is found on the autopilot again or is gone."""
        self._finding: Future[KeptMission] | None = None
        self._next_s = -math.inf
        self._kept_as: RunningMission | None = None
        """Content of the file since this daemon flies a mission."""
        self._last: AutopilotMission | None = None
        """The newest mission that was flown, or is."""
        self._brought = Brought()
        self.changes_count = 0
        """Changes of the autopilot's mission that were about to be sent."""

    # --- What is requested --------------------------------------------------------------------------------------------

    def plan(self, items: Sequence[Item], first: int = 1) -> MissionPlan:
        """Makes a dry run; see `MissionPlanner.plan`."""
        checks.require(items)
        return self._planner.plan(items, self._backend.snapshot(), first)

    def require_none_running(self, command: str) -> None:
        """Checks that no mission is flown, of which the items must not change.

        Raises:
            WrongStateError: One is, by UAL or by others.

        """
        offer = self._backend.offer(AutopilotMissions)  # type: ignore[type-abstract]  # it is only looked for
        snapshot = self._backend.snapshot()
        mode, armed = snapshot.control.mode_name, snapshot.control.armed
        is_flown = offer is not None and mode and mode == offer.mode and armed is not None and armed.value
        is_begun = isinstance(self._flight.manoeuvre, AutopilotMission)  # the autopilot may not be reported yet
        if is_flown or is_begun or (self._flight.is_on_mission and not self._flight.is_stopping_mission):
            text = f"{command}: the autopilot flies a mission now; stop it first (abort), or wait for its end"
            raise WrongStateError(text, {"command": command, "needed": "abort"})

    def brought(self, kept: KeptMission) -> None:
        """Notes that UAL has brought a mission, or has removed it."""
        stage = MissionStage.NOT_STARTED if kept.items else MissionStage.NONE
        self._last, self._brought = None, Brought(self._backend.snapshot().time_s, stage)

    def require_whole(self) -> None:
        """Checks that no upload was cut off on which the start of a mission relies; see `UploadJournal.require_whole`.

        The rally points are where a failsafe may lead in a mission.
        """
        self._uploads.require_whole(NAME, MISSION, RALLY)

    def mode_before_start(self) -> str:
        """Returns the mode in which a mission that is requested now begins on the ground.

        Another mode while the mission is read is a take-over. Empty where UAL may change it itself, and in the air, as
        the state tells it there.
        """
        snapshot = self._backend.snapshot()
        is_ours_to_change = self._flight.is_busy or self._flight.raw_estimate(snapshot).state is not State.LANDED_ARMED
        return "" if is_ours_to_change else snapshot.control.settled_mode

    def check_start(self, kept: KeptMission, first: int, own: OnItsOwn, lease_id: str, changes_count: int) -> None:
        """Checks whether a mission may begin now, and its way; see `start`. May take seconds.

        Raises:
            WrongStateError: The state is neither FLYING_AUTO nor LANDED_ARMED, or it cannot begin there; or an upload
                was cut off.
            GeofenceError: It leads outside.
            InvalidArgumentError: It has something that UAL does not know; the item is named.

        """
        with self._preconditions.logging_refusal(NAME):
            self._require_start(kept.items, first, own, lease_id, changes_count)
            self.plan(kept.items, first)

    def start(
        self,
        offer: AutopilotMissions,
        kept: KeptMission,
        first: int,
        own: OnItsOwn,
        order: CommandOrigin,
        changes_count: int,
        began_in: str = "",
    ) -> VehicleTask:
        """Begins the mission that was read from the autopilot, with an item counted from 1, after `check_start`.

        `changes_count` is what it was when the mission had been read, and `began_in` is the `mode_before_start` from
        before that.

        Raises:
            WrongStateError: As `check_start`.
            TaskAbortedError: Another command, such as an abort, began after `CommandOrigin.since`; or another mission
                was brought meanwhile.

        """
        with self._preconditions.logging_refusal(NAME):
            snapshot = self._require_start(kept.items, first, own, order.lease_id, changes_count)
            is_ours = self._flight.raw_estimate(snapshot).state is State.FLYING_AUTO
            reference = self._flight.brake(snapshot) if is_ours else None
            skipped = _skipped(kept.items, first)
            words = f"mission of {len(kept.items)} items; {own.link_loss_text}{skipped}"
            task = self._tasks.new(TaskKind.MISSION, words)
            manoeuvre = self._manoeuvre(task, offer, kept, first, own, reference)
            manoeuvre.began_in = began_in
            self._flight.begin(manoeuvre, order, snapshot)
            self._last = manoeuvre
            self._remember(task, kept)
            accepted(NAME, task_id=task.id, items=len(kept.items), first=first, skipped=skipped.removeprefix("; "))
            return task

    def jump(self, item: int, lease_id: str = NOBODY) -> Future[None]:
        """Makes an item, counted from 1, the one that is flown now; see `AutopilotMission.jump`."""
        with self._preconditions.logging_refusal("jump_to_item"):
            self._preconditions.require_state("jump_to_item", lease_id, State.FLYING_AUTO)
            manoeuvre = self._flight.manoeuvre
            if not isinstance(manoeuvre, AutopilotMission):
                raise WrongStateError("jump_to_item: no mission of UAL is flown", {"command": "jump_to_item"})
            self._require_item(manoeuvre.items, item)
            if not isinstance(manoeuvre.items[item - 1], MOVING):
                raise checks.refused(manoeuvre.items, item - 1, "a jump leads to an item that flies, not to this one")
            future = manoeuvre.jump(item, partial(self._why_not_jump, lease_id))
            accepted("jump_to_item", item=item)
            return future

    def progress(self, offer: AutopilotMissions) -> MissionProgress:
        """Returns the progress of the autopilot's mission, whichever program started it."""
        report, info = offer.report(), self._flight.task_info()
        task_id = info.id if info is not None and info.kind is TaskKind.MISSION else ""
        if report is None:
            return MissionProgress(MissionStage.UNKNOWN, task_id=task_id)
        manoeuvre, last, brought = self._flight.manoeuvre, self._last, self._brought
        flown = manoeuvre if isinstance(manoeuvre, AutopilotMission) else None
        if flown is None and last is not None and not last.has_list_of(report):
            last = None
        reached = brought.reached(report) if flown is None else flown.reached(report)
        stage = estimated_stage(report, self._backend.snapshot(), offer.mode, flown, flown or last, brought)
        return MissionProgress(stage, report.item, reached, task_id)

    def require_task(self, command: str) -> str:
        """Returns the identifier of the mission's task.

        Raises:
            WrongStateError: No mission of UAL is flown.

        """
        info = self._flight.task_info()
        if info is None or info.kind is not TaskKind.MISSION:
            raise WrongStateError(f"{command}: no mission of UAL is flown", {"command": command})
        return info.id

    def _why_not_jump(self, lease_id: str) -> UalError | None:
        return self._flight.lease.refusal("jump_to_item", lease_id)

    def _require_start(
        self, items: Sequence[Item], first: int, own: OnItsOwn, lease_id: str, changes_count: int
    ) -> Snapshot:
        if changes_count != self.changes_count:
            text = f"{NAME}: the mission of the autopilot was changed while this one was started: start it again"
            raise TaskAbortedError(text, {"by": "upload"})
        self.require_whole()
        snapshot = self._preconditions.require_state(NAME, lease_id, State.FLYING_AUTO, State.LANDED_ARMED)
        checks.require(items)
        self._require_item(items, first)
        self._preconditions.require_no_failsafe(NAME, snapshot, force=False)
        if self._flight.raw_estimate(snapshot).state is State.LANDED_ARMED:
            self._preconditions.require_own_ground(NAME)
            self._preconditions.require_no_fall(NAME, snapshot)
            begins = next((each for each in items[first - 1 :] if isinstance(each, MOVING)), None)
            if not isinstance(begins, TakeOff):
                raise WrongStateError(
                    f"{NAME}: the UAV is on the ground, where a mission has to begin with a take-off: take off first",
                    {"state": State.LANDED_ARMED.name, "needed": State.FLYING_AUTO.name},
                )
            _require_here(begins, snapshot)
        if own.begins_anew and first > 1:
            raise WrongStateError(
                f"{NAME}: the autopilot would begin with item 1 ({own.begins_anew})", {"needed": "item 1"}
            )
        return snapshot

    def _require_item(self, items: Sequence[Item], item: int) -> None:
        if not 1 <= item <= len(items):
            raise WrongStateError(f"{NAME}: it has {len(items)} items, and no item {item}", {"count": str(len(items))})
        if isinstance(items[item - 1], Jump) or not any(isinstance(each, MOVING) for each in items[item - 1 :]):
            raise checks.refused(items, item - 1, "no item that flies follows: a mission does not go on with this one")

    def _manoeuvre(
        self,
        task: VehicleTask,
        offer: AutopilotMissions,
        kept: KeptMission,
        first: int | None,
        own: OnItsOwn | None,
        reference: Reference | None = None,
    ) -> AutopilotMission:
        return AutopilotMission(
            task,
            self._backend,
            offer,
            kept,
            first,
            reference,
            self._take_back,
            self._flight.authority.begin,
            "" if own is None else own.begins_anew,
        )

    def _take_back(self, task: VehicleTask) -> TakeBack:
        command = AutopilotCommand("take our references")
        refusal = partial(self._preconditions.failsafe_refusal, NAME, force=False)
        return TakeBack(command, self._backend.take_control, refusal, name=NAME, task=task)

    # --- What outlives the daemon -------------------------------------------------------------------------------------

    def _remember(self, task: VehicleTask, kept: KeptMission, paused_at: int = 0) -> None:
        if self._file is None:
            return
        self._lost = None
        self._kept_as = RunningMission(self._backend.info().identity, kept.digest, task.id, paused_at)
        self._file.write(self._kept_as)
        task.future.add_done_callback(self._on_end)

    def _note_pause(self, file: MissionFile) -> None:
        """Keeps whether the autopilot holds in a pause, as a next daemon cannot tell it from a pilot's hold."""
        flown, kept = self._flight.manoeuvre, self._kept_as
        if kept is None or not isinstance(flown, AutopilotMission) or flown.future.done():
            return
        if flown.id == kept.task_id and flown.paused_at != kept.paused_at:
            self._kept_as = replace(kept, paused_at=flown.paused_at)
            file.write(self._kept_as)

    def _on_end(self, future: Future[None]) -> None:
        """Forgets a mission that has ended; one goes on whose daemon ends."""
        error = future.exception()
        is_daemon = isinstance(error, TaskAbortedError) and error.metadata.get("by") in _ENDS_OF_DAEMON
        if self._file is not None and not is_daemon:
            self._file.remove()

    def update(self, snapshot: Snapshot) -> None:
        """Looks whether the mission of the daemon before is still flown: then it is a task again, by its old name.

        One that it had paused is a task again, too, where the autopilot still holds.
        """
        lost = self._lost
        if self._file is not None and lost is None:
            self._note_pause(self._file)
        if lost is None or self._file is None:
            return
        offer = self._backend.offer(AutopilotMissions)  # type: ignore[type-abstract]  # it is only looked for
        control, identity = snapshot.control, self._backend.info().identity
        if offer is None or control.mode is None or control.armed is None or not identity:
            return
        gone = self._why_gone(lost, offer, snapshot, identity)
        if gone:
            self._forget(gone)
        elif self._finding is None and snapshot.time_s >= self._next_s:
            self._finding, self._next_s = offer.download(), snapshot.time_s + DOWNLOAD_RETRY_S
        elif self._finding is not None and self._finding.done():
            self._on_found(lost, offer, self._finding)

    def _why_gone(self, lost: RunningMission, offer: AutopilotMissions, snapshot: Snapshot, identity: str) -> str:
        assert snapshot.control.armed is not None
        if identity != lost.vehicle:
            return "it is another vehicle"
        if not snapshot.control.armed.value:
            return "the UAV is disarmed"
        if snapshot.control.mode_name not in (offer.mode, offer.pause_mode if lost.paused_at else offer.mode):
            return f"the autopilot is in mode {snapshot.control.mode_name}"
        return _COMMANDED if self._flight.last_command.number else ""

    def _on_found(self, lost: RunningMission, offer: AutopilotMissions, finding: Future[KeptMission]) -> None:
        self._finding = None
        if finding.cancelled() or finding.exception() is not None:
            return  # it is read again
        kept = finding.result()
        if kept.digest != lost.digest:
            self._forget("the autopilot has another mission")
            return
        self._lost = None
        task = self._tasks.new(TaskKind.MISSION, f"mission of {len(kept.items)} items, found again", lost.task_id)
        manoeuvre = self._manoeuvre(task, offer, kept, None, None)
        is_paused = bool(lost.paused_at) and self._backend.snapshot().control.mode_name == offer.pause_mode
        if is_paused:
            manoeuvre.found_paused(lost.paused_at, offer.pause_mode)
        if self._flight.adopt(manoeuvre):
            self._last = manoeuvre
            self._remember(task, kept, manoeuvre.paused_at)
            logs.event(_log, logging.INFO, "mission_found", task_id=task.id, is_paused=is_paused)
            if self._flight.last_command.name == LEASE:  # it could not be stopped then: nobody knew whose it was
                self._flight.stop_for_lease("a lease has begun or ended before it was found")
        elif self._flight.is_closing:  # the next daemon finds it
            task.end(TaskAbortedError(f"{NAME}: UAL is shutting down", {"by": "shutdown"}))
        else:  # in this moment
            task.end(TaskAbortedError(f"{NAME}: {_COMMANDED}", {"by": self._flight.last_command.name}))
            self._forget(_COMMANDED)

    def _forget(self, why: str) -> None:
        self._lost = self._finding = None
        logs.event(_log, logging.INFO, "mission_over", why=why)
        if self._file is not None:
            self._file.remove()


def _skipped(items: Sequence[Item], first: int) -> str:
    """Returns which settings before an item a start with it leaves out; empty where there are none."""
    kinds: dict[type[Item], str] = {}
    for index, item in enumerate(items[: first - 1]):
        if not isinstance(item, (*MOVING, Jump)):
            kinds[type(item)] = name_of(items, index)
    return f"; it begins with item {first}, without {', '.join(kinds.values())}" if kinds else ""


def _require_here(begins: TakeOff, snapshot: Snapshot) -> None:
    """Checks that the mission takes off where the UAV stands.

    PX4 needs a place for each take-off. One without is uploaded with that where the UAV stood then, and it may have
    been carried elsewhere since.
    """
    here = snapshot.position_geo()
    if begins.latitude_deg is None or begins.longitude_deg is None or here is None:
        return
    aside = FlatProjection(here.latitude_deg, here.longitude_deg, 0.0).to_local(
        begins.latitude_deg, begins.longitude_deg, 0.0
    )
    aside_m = math.hypot(aside.x, aside.y)
    if aside_m > _PATH_DISTANCE_M:
        raise WrongStateError(
            f"{NAME}: its take-off leads {aside_m:.0f} m aside, to where the UAV stood at the upload, or to a place of "
            "its own: upload it again here, and fly there by a waypoint",
            {"state": State.LANDED_ARMED.name, "needed": "an upload here"},
        )
