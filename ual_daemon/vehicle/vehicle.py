"""One UAV that its backend flies: its commands, and what is reported of it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from typing_extensions import override

from ual.errors import NotSupportedError
from ual.interface import Simulation
from ual.types import Geofence, Info, LeaseInfo, Route, Telemetry
from ual_daemon import logs, validation
from ual_daemon._version import __version__
from ual_daemon.backends.base import Backend, SafetyPilot
from ual_daemon.backends.engine.contained import ErrorBarrier
from ual_daemon.backends.payload import Payload
from ual_daemon.backends.values import Packet, Setpoint, Snapshot
from ual_daemon.flight.flight import Flight
from ual_daemon.flight.policy.geofence import geofence_of
from ual_daemon.flight.policy.heading_jumps import HeadingJumpDetector
from ual_daemon.flight.policy.jumps import JumpDetector
from ual_daemon.flight.policy.lease import EXPIRES_AFTER_S, NOBODY
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import Tasks, VehicleTask
from ual_daemon.frames.home_file import HomeFile
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.settings import VehicleSettings
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.vehicle.commands import Commands
from ual_daemon.vehicle.equipment import PayloadEquipment
from ual_daemon.vehicle.external_poses import ExternalPoses
from ual_daemon.vehicle.fence_notice import FenceNotice
from ual_daemon.vehicle.figures import VehicleFigures
from ual_daemon.vehicle.gimbals import UavGimbals
from ual_daemon.vehicle.in_map import geofence_in_map, route_in_map
from ual_daemon.vehicle.mission_file import MissionFile
from ual_daemon.vehicle.missions import Missions
from ual_daemon.vehicle.on_earth import fence_on_earth
from ual_daemon.vehicle.preconditions import Preconditions
from ual_daemon.vehicle.reported import ReportedVehicle
from ual_daemon.vehicle.severe_log import SevereLog
from ual_daemon.vehicle.telemetry import make_telemetry
from ual_daemon.vehicle.upload_journal import JournalFile, UploadJournal

T = TypeVar("T")

_log = logging.getLogger(__name__)


class Vehicle(ReportedVehicle):
    """One UAV that its backend flies. Any thread may call any member, and none blocks.

    `ual.interface.Uav` says what the members mean. `commands` has all commands; the other members report.
    """

    def __init__(
        self,
        backend: Backend,
        settings: VehicleSettings | None = None,
        *,
        allow_arming: bool = False,
        home_file: HomeFile | None = None,
        watch_only: bool = False,
    ) -> None:
        """With `home_file`, home survives a restart of the process. `watch_only`: every command is refused, and nothing
        that flies is sent.
        """
        settings, ns = settings or VehicleSettings(), backend.options.ns
        kept = home_file if backend.outlived else None
        resolver = FrameResolver(ns, settings, kept, lambda: backend.info().identity)
        super().__init__(ns, backend.name, backend.clock, resolver)
        self.backend = backend
        backend.is_watch_only = watch_only
        self._pose_frame_id = settings.pose_frame_id
        self._limits = CurrentLimits(backend, settings.limits)
        fence = geofence_of(settings, self._resolver, backend.info().clearance_m)
        self._flight = Flight(backend, self._limits, fence, watch_only=watch_only)
        self._tasks = Tasks(backend.clock)
        self.commands = Commands(
            backend, self._flight, self._resolver, self._tasks, settings, allow_arming=allow_arming
        )
        journal = None if kept is None else JournalFile.next_to(kept.path)
        self.uploads = UploadJournal(journal, lambda: backend.info().identity)
        """The uploads of lists to the autopilot that were begun, and not finished."""
        file = None if kept is None else MissionFile.next_to(kept.path)
        self.kept_files = tuple(each.kept for each in (kept, journal, file) if each is not None)
        self.missions = Missions(backend, self._flight, resolver, self._tasks, settings, file, self.uploads)
        """The missions that the autopilot flies by itself."""
        self.equipment = PayloadEquipment(settings.payload)
        """Payload devices that the UAV carries."""
        self.gimbals = UavGimbals(backend, resolver)
        """The gimbals that it carries."""
        self._jumps = JumpDetector()
        self._heading_jumps = HeadingJumpDetector()
        self.external_poses = ExternalPoses(
            backend,
            self._resolver,
            Preconditions(backend, self._flight),
            self._flight.external_silence,
            self._jumps.announce,
        )
        """The poses that are measured from outside."""
        own = settings.geofence
        has_polygon = own is not None and bool(own.polygon or own.polygon_geo)
        self._fence_notice = FenceNotice(backend.info, is_needed=has_polygon and not watch_only)
        self._severe_log = SevereLog()
        self._contained = ErrorBarrier("an update of a UAV")
        self._flying = ErrorBarrier("what flies a UAV", "no setpoint is sent while it does")

    # --- Lifetime -----------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Begins to connect; see `Backend.open`."""
        self._resolver.open()
        self.backend.is_update_needed = self._is_update_needed
        self.backend.open(self._on_update)

    def close(self) -> None:
        """Ends everything at once, and aborts what still runs. For a UAV in the air, use `prepare_shutdown` before."""
        self.backend.close()
        self._flight.close()

    # --- The lease ----------------------------------------------------------------------------------------------------

    def lease(self) -> LeaseInfo | None:
        """Returns the holder of the lease; None where there is no lease."""
        return self._flight.lease.info

    def acquire_lease(
        self,
        holder: str,
        identity: str,
        *,
        take: bool = False,
        lasts_s: float = EXPIRES_AFTER_S,
        lease_id: str = NOBODY,
    ) -> str:
        """Begins a lease, and returns its identifier, by which its holder gives each command.

        What is in progress is aborted, and the UAV holds its position. `lease_id` is the one that the caller has
        already.

        Raises:
            LeaseHeldError: Another program holds one, and it is not to be taken.
            LeaseLostError: The one that the caller has has ended.

        """
        self._expire_lease()  # where time stands still, no update does
        lease = self._flight.lease
        before = lease.id
        holder = validation.short_text(holder, "holder")
        lease_id = lease.acquire(holder, identity, take=take, lasts_s=lasts_s, lease_id=lease_id)
        if lease_id != before:
            logs.event(_log, logging.INFO, "lease_begins", holder=holder, identity=identity, taken=before != NOBODY)
            self._stop_for_lease(f"{holder} has acquired the lease")
        return lease_id

    def keep_lease(self, lease_id: str) -> None:
        """Keeps a lease for another `EXPIRES_AFTER_S`.

        Raises:
            LeaseLostError: It has ended.

        """
        self._expire_lease()
        self._flight.lease.keep(lease_id)

    def release_lease(self, lease_id: str) -> None:
        """Ends a lease: what is in progress is aborted, and the UAV holds. Nothing happens if it has ended before."""
        if self._flight.lease.release(lease_id):
            logs.event(_log, logging.INFO, "lease_ends", why="released")
            self._stop_for_lease("its program has released the lease")

    def require_lease(self, command: str, lease_id: str) -> None:
        """Checks that a command may begin with the lease by which it is given.

        Raises:
            LeaseHeldError: Another program holds the lease.
            LeaseLostError: The lease of the command has ended.

        """
        refusal = self._flight.lease.refusal(command, lease_id)
        if refusal is not None:
            raise refusal

    def safety_pilot(self) -> SafetyPilot | None:
        """Returns a simulated safety pilot; None for a real UAV."""
        return self.backend.safety_pilot()

    def why_not_auto_arm(self) -> str:
        """Returns why a simulated safety pilot must not arm it now, human-readable; empty if arming is safe."""
        return self.backend.snapshot().control.arming_starts

    def observe_packets(self, callback: Callable[[Packet], None]) -> bool:
        """Calls back with each packet of the link; see `Backend.on_packet`. Returns False where it has none."""
        if self.backend.has_packets:
            self.backend.on_packet = callback
        return self.backend.has_packets

    def payload(self) -> Payload | None:
        """Returns what the backend offers for what the UAV carries; None where it offers nothing, or only watches."""
        return None if self._flight.is_watch_only else self.backend.payload()

    def offer(self, kind: type[T]) -> T | None:
        """Returns what the backend offers of a kind; see `Backend.offer`."""
        return self.backend.offer(kind)

    def is_armed(self) -> bool | None:
        """Returns whether it is armed; None while that is not known."""
        snapshot, freshness = self.backend.snapshot(), self.backend.freshness
        armed, heard_s = snapshot.control.armed, snapshot.heard_s
        if armed is None or heard_s is None or snapshot.time_s - heard_s > freshness.link_s:
            return None
        return armed.value if snapshot.time_s - armed.time_s <= freshness.mode_s else None

    def _expire_lease(self) -> None:
        info = self._flight.lease.expire()
        if info is not None:
            logs.event(_log, logging.WARNING, "lease_ends", holder=info.holder, why="it was not kept: the UAV holds")
            self._stop_for_lease(f"the lease of {info.holder} was not kept")

    def _stop_for_lease(self, why: str) -> None:
        self._flight.stop_for_lease(why)
        self.equipment.withdraw(why, {"by": "lease"})

    def prepare_shutdown(self) -> Future[None]:
        """Hands the UAV over to its autopilot, and refuses new commands from now on.

        A take-off or landing ends first, any other task and reference is cancelled, and the autopilot is commanded to
        hold the position by itself. The future ends when this is done. It ends with a LinkLostError where UAL flies the
        UAV, and its state stays unknown for 5 s.
        """
        return self._flight.prepare_shutdown()

    @property
    def is_watch_only(self) -> bool:
        """Whether every command is refused."""
        return self._flight.is_watch_only

    def is_in_control(self) -> bool:
        """Returns whether UAL flies it: it was commanded in this flight, or the UAV would fall without it."""
        return self._flight.is_in_control()

    # --- What is known ------------------------------------------------------------------------------------------------

    def info(self) -> Info:
        """Returns its identity, and what it can do."""
        vehicle = self.backend.info()
        return Info(
            namespace=self.ns,
            backend=self.backend.name,
            autopilot=vehicle.autopilot,
            autopilot_version=vehicle.autopilot_version,
            is_simulation=vehicle.is_simulation,
            capabilities=vehicle.capabilities,
            limits=self._limits.get(),
            ual_version=__version__,
            is_arming_allowed=self.commands.is_arming_allowed,
            url=self.backend.options.url or "",
            has_safety_pilot=vehicle.has_safety_pilot,
        )

    @override
    def _snapshot(self) -> Snapshot:
        return self.backend.snapshot()

    @override
    def _estimate(self, snapshot: Snapshot) -> Estimate:
        return self._flight.estimate(snapshot)

    @override
    def figures(self) -> VehicleFigures:
        task = self._flight.task_info()
        return (
            super()
            .figures()
            ._replace(
                is_ours=self._flight.is_in_control(),
                is_leased=self._flight.lease.id != NOBODY,
                link=self.backend.link(),
                setpoint_rate_hz=self.backend.info().setpoint_rate_hz,
                task=None if task is None else task.kind,
                tasks_ended=self._tasks.ended(),
            )
        )

    @override
    def _sample(self, snapshot: Snapshot, found: Estimate, *, is_late: bool = False) -> Telemetry:
        sequence = snapshot.sequence or self._sequence
        flight = self._flight
        trouble = flight.trouble
        troubles = (trouble,) if trouble else ()
        if flight.position.trouble or flight.external_silence.is_doubtful:
            position = flight.position.doubts(snapshot.time_s)
            troubles = (*troubles, f"position: {position}") if position else troubles
        return make_telemetry(
            snapshot,
            found,
            self._resolver,
            self._flight,
            self._pose_frame_id,
            sequence,
            is_late=is_late,
            daemon_checks=(*self.daemon_checks, *troubles) if troubles else self.daemon_checks,
        )

    def observe_setpoints(self, callback: Callable[[Setpoint], None]) -> None:
        """Calls back with each setpoint that is sent to the autopilot, on the thread that sends it; must not block.

        To be called before `open`, once for each observer.
        """
        before, contained = self._flight.sender.on_sent, ErrorBarrier("a watcher of setpoints")

        def call_both(setpoint: Setpoint) -> None:
            if before is not None:
                before(setpoint)
            contained.call(callback, setpoint)

        self._flight.sender.on_sent = call_both

    def configured_fence(self) -> tuple[tuple[float, float], ...]:
        """Returns the corners of the configured polygon; see `fence_on_earth`, also for what is raised."""
        return fence_on_earth(self._flight.geofence, self.backend.snapshot())

    def geofence(self) -> Geofence:
        """Returns where the UAV may fly; see `geofence_in_map`, also for what is raised."""
        return geofence_in_map(self._flight.geofence, self._resolver, self.backend.snapshot())

    def route(self) -> Route | None:
        """Returns the way that is flown; see `route_in_map`, also for what is raised. A long path takes 50 ms."""
        return route_in_map(self._flight, self._resolver, self.backend.snapshot())

    def task(self, task_id: str) -> VehicleTask:
        """Returns a task by its identifier, running or ended lately.

        Raises:
            InvalidArgumentError: There is no such task.

        """
        return self._tasks.get(task_id)

    def simulation(self) -> Simulation:
        """Returns the world around a simulated UAV.

        Raises:
            NotSupportedError: The backend is not a simulation of UAL.

        """
        found = self.backend.simulation()
        if found is None:
            raise NotSupportedError(f"{self.ns} ({self.backend.name}) is not a simulation of ours")
        return found

    # --- Updates ------------------------------------------------------------------------------------------------------

    def _is_update_needed(self) -> bool:
        """See `Backend.is_update_needed`."""
        is_flying = self._flight.is_busy or self._flight.lease.id != NOBODY
        return is_flying or self._is_sample_due() or self.gimbals.is_busy

    @override
    def _update(self, snapshot: Snapshot) -> None:
        self._sequence = snapshot.sequence or self._sequence + 1
        # A defect of one of these takes nothing from the others: neither setpoints, nor samples.
        try:  # as `ErrorBarrier.call`, which would be a call for each
            self._resolver.update(snapshot)
        except Exception as error:  # noqa: BLE001 - what flies goes on
            self._contained.tell(error)
        try:
            self._fly(snapshot)
        except Exception as error:  # noqa: BLE001 - samples go on
            self._flying.tell(error)
        self._publish(snapshot, self._flight.estimate(snapshot))
        try:
            self.missions.update(snapshot)
        except Exception as error:  # noqa: BLE001 - what flies goes on
            self._contained.tell(error)
        if snapshot.time_s >= self.gimbals.due_s:
            self._contained.call(self.gimbals.update, snapshot)
        if snapshot.time_s >= self._fence_notice.due_s:
            self._fence_notice.observe(snapshot.time_s)
        if snapshot.condition.severe_texts is not self._severe_log.seen:  # no call for each update
            self._severe_log.observe(snapshot.condition.severe_texts)

    def _fly(self, snapshot: Snapshot) -> None:
        if self._flight.lease.id != NOBODY:
            self._expire_lease()
        if not self._follow_jumps(snapshot):
            self._flight.step(snapshot)

    def _follow_jumps(self, snapshot: Snapshot) -> bool:
        """Follows jumps of the estimate. Returns whether one is suspected: nothing is then sent to where it was."""
        jump = self._jumps.observe(snapshot)
        if jump is not None:
            self.backend.estimate_jumped(jump.offset)
            self._resolver.estimate_jumped(jump.offset)
            self._flight.estimate_jumped(jump, snapshot)
        jump = self._heading_jumps.observe(snapshot)
        if jump is not None:
            self._flight.estimate_jumped(jump, snapshot)
        if not (self._jumps.poses.is_waiting or self._heading_jumps.poses.is_waiting):  # no calls for each update
            return False
        return self._jumps.is_suspected(snapshot.time_s) or self._heading_jumps.is_suspected(snapshot.time_s)
