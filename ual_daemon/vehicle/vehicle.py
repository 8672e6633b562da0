"""One UAV above its backend: its commands, and what is reported of it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from typing import NamedTuple

from ual.errors import NotSupportedError
from ual.geometry import Transform
from ual.interface import Simulation
from ual.types import Frame, Geofence, Info, LeaseInfo, Route, State, Telemetry
from ual_daemon import logs, validation
from ual_daemon._version import __version__
from ual_daemon.backends.base import Backend
from ual_daemon.backends.payload import Payload
from ual_daemon.backends.values import Setpoint, Snapshot
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
from ual_daemon.vehicle.external_poses import ExternalPoses
from ual_daemon.vehicle.in_map import geofence_in_map, route_in_map
from ual_daemon.vehicle.listeners import Listeners
from ual_daemon.vehicle.preconditions import Preconditions
from ual_daemon.vehicle.telemetry import make_telemetry

_log = logging.getLogger(__name__)


class _Subscriber(NamedTuple):
    """See `Vehicle.subscribe`."""

    callback: Callable[[Telemetry], None]
    is_due: Callable[[], bool]
    reads_all: bool


class Vehicle:
    """One UAV. Any thread may call any member, and none blocks. `ual.interface.Uav` says what they mean.

    `commands` has all commands; the other members report.
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
        self.ns = backend.options.ns
        self.log_name = ""
        """The name of this UAV in the log, if there are several in the process."""
        self.backend = backend
        backend.is_watch_only = watch_only
        settings = settings or VehicleSettings()
        self._pose_frame_id = settings.pose_frame_id
        kept = home_file if backend.outlived else None
        self._resolver = FrameResolver(self.ns, settings, kept, lambda: backend.info().identity)
        self._limits = CurrentLimits(backend, settings.limits)
        fence = geofence_of(settings, self._resolver, backend.info().clearance_m)
        self._flight = Flight(backend, self._limits, fence, watch_only=watch_only)
        self._tasks = Tasks(backend.clock)
        self.commands = Commands(
            backend, self._flight, self._resolver, self._tasks, settings, allow_arming=allow_arming
        )
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
        self._subscribers: Listeners[_Subscriber] = Listeners()
        self._state_listeners: Listeners[Callable[[State], None]] = Listeners()
        self._sequence = 0
        self._last_state: State | None = None

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
        """Returns who holds the lease; None where nobody does."""
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

        What is under way is aborted, and the UAV holds its position. `lease_id` is the one that the caller has already.

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
            self._flight.stop_for_lease(f"{holder} has acquired the lease")
        return lease_id

    def keep_lease(self, lease_id: str) -> None:
        """Keeps a lease for another `EXPIRES_AFTER_S`.

        Raises:
            LeaseLostError: It has ended.

        """
        self._expire_lease()
        self._flight.lease.keep(lease_id)

    def release_lease(self, lease_id: str) -> None:
        """Ends a lease: what is under way is aborted, and the UAV holds. Nothing happens if it has ended before."""
        if self._flight.lease.release(lease_id):
            logs.event(_log, logging.INFO, "lease_ends", why="released")
            self._flight.stop_for_lease("its program has released the lease")

    def require_lease(self, command: str, lease_id: str) -> None:
        """Checks that a command may begin with the lease by which it is given.

        Raises:
            LeaseHeldError: Another program holds the lease.
            LeaseLostError: The lease of the command has ended.

        """
        refusal = self._flight.lease.refusal(command, lease_id)
        if refusal is not None:
            raise refusal

    def payload(self) -> Payload | None:
        """Returns what the backend offers for what the UAV carries; None where it offers nothing, or only watches."""
        return None if self._flight.is_watch_only else self.backend.payload()

    def _expire_lease(self) -> None:
        info = self._flight.lease.expire()
        if info is not None:
            logs.event(_log, logging.WARNING, "lease_ends", holder=info.holder, why="it was not kept: the UAV holds")
            self._flight.stop_for_lease(f"the lease of {info.holder} was not kept")

    def prepare_shutdown(self) -> Future[None]:
        """Hands the UAV over to its autopilot, and refuses new commands from now on.

        A take-off or landing ends first, any other task and reference is cancelled, and the autopilot is commanded to
        hold the position by itself. The future ends when this is done.
        """
        return self._flight.prepare_shutdown()

    def is_flown_by_us(self) -> bool:
        """Returns whether UAL flies it: it was commanded in this flight, or the UAV would fall without it."""
        return self._flight.is_flown_by_us()

    def doing(self) -> dict[str, object]:
        """Returns what the UAV is doing, as the fields of an event of the log: for an end that leaves it in motion."""
        sample = self.telemetry()
        fields: dict[str, object] = {"state": sample.state.name}
        task = sample.task
        if task is not None:
            fields |= {"task": task.kind.name.lower(), "progress": round(task.progress or 0.0, 2)}
        if sample.pose is not None:
            p = sample.pose.position
            fields["position"] = f"{p.x:.1f}, {p.y:.1f}, {p.z:.1f} in {sample.frame_id}"
        if sample.velocity is not None:
            fields["speed_m_s"] = round(sample.velocity.linear.norm(), 1)
        return fields

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

    def state(self) -> State:
        """Returns the state, estimated now."""
        return self._flight.estimate(self.backend.snapshot()).state

    def telemetry(self) -> Telemetry:
        """Returns the newest sample of everything known."""
        snapshot = self.backend.snapshot()
        return self._sample(snapshot, self._flight.estimate(snapshot))

    def subscribe(
        self,
        callback: Callable[[Telemetry], None],
        is_due: Callable[[], bool] = lambda: True,
        *,
        reads_all: bool = True,
    ) -> Callable[[], None]:
        """Calls back at each update for which `is_due` returns True. Returns the function that ends it.

        Both run on the update thread and must not block. A sample is made only if it is due for a subscriber. Where it
        is due only for those that do not read all of it, a part of it is made when it is read.
        """
        return self._subscribers.add(_Subscriber(callback, is_due, reads_all))

    def listen_to_state(self, callback: Callable[[State], None]) -> Callable[[], None]:
        """Calls back with the new state whenever it has changed. Returns the function that ends it.

        The callback runs on the update thread, before the sample that shows the state, and must not block.
        """
        return self._state_listeners.add(callback)

    def observe_setpoints(self, callback: Callable[[Setpoint], None]) -> None:
        """Calls back with each setpoint that is sent to the autopilot, on the thread that sends it; must not block."""
        self._flight.sender.on_sent = callback

    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        """Returns the transform from the source frame (default: the body) to the target frame (default: ``map``).

        Raises:
            UnknownFrameError: There is no such frame.
            WrongStateError: It is not known yet where a frame is.
            FrameLostError: It is not known any more.

        """
        snapshot = self.backend.snapshot()
        return replace(self._resolver.transform(target_frame_id, source_frame_id, snapshot), stamp_s=snapshot.stamp_s)

    def frames(self) -> list[Frame]:
        """Returns all frames."""
        return self._resolver.tree.frames(self._resolver.body(self.backend.snapshot()))

    def geofence(self) -> Geofence:
        """Returns where the UAV may fly; see `geofence_in_map`, also for what is raised."""
        return geofence_in_map(self._flight, self._resolver, self.backend.snapshot())

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

    def _sample(self, snapshot: Snapshot, found: Estimate, *, is_late: bool = False) -> Telemetry:
        sequence = snapshot.sequence or self._sequence
        if snapshot.recorded is not None and snapshot.recorded.is_whole:
            return replace(snapshot.recorded.telemetry, sequence=sequence)
        return make_telemetry(
            snapshot, found, self._resolver, self._flight, self._pose_frame_id, sequence, is_late=is_late
        )

    # --- Updates ------------------------------------------------------------------------------------------------------

    def _is_update_needed(self) -> bool:
        """See `Backend.is_update_needed`."""
        return (
            self._flight.is_busy or self._flight.lease.id != NOBODY or any(each.is_due() for each in self._subscribers)
        )

    def _on_update(self, snapshot: Snapshot) -> None:
        """Makes one update, on the backend's update thread. An error must not end the thread that flies the UAV."""
        if self.log_name:
            logs.uav.set(self.log_name)
        try:
            self._update(snapshot)
        except Exception:  # noqa: BLE001  logged; the next update goes on
            _log.exception("an update failed; this is a defect of UAL, please report it")

    def _update(self, snapshot: Snapshot) -> None:
        self._sequence = snapshot.sequence or self._sequence + 1
        self._resolver.update(snapshot)
        if self._flight.lease.id != NOBODY:
            self._expire_lease()
        if not self._follow_jumps(snapshot):
            self._flight.step(snapshot)
        found = self._flight.estimate(snapshot)
        if found.state is not self._last_state:
            self._publish_state(found)
        self._publish(snapshot, found)

    def _publish(self, snapshot: Snapshot, found: Estimate) -> None:
        due, is_late = [], True
        for subscriber in self._subscribers:
            if subscriber.is_due():
                due.append(subscriber)
                is_late = is_late and not subscriber.reads_all
        if due:
            sample = self._sample(snapshot, found, is_late=is_late)
            for subscriber in due:
                subscriber.callback(sample)

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
        return self._jumps.is_suspected(snapshot.time_s) or self._heading_jumps.is_suspected(snapshot.time_s)

    def _publish_state(self, found: Estimate) -> None:
        last, self._last_state = self._last_state, found.state
        level = logging.WARNING if found.state in (State.UNINITIALIZED, State.FLYING_MANUAL) else logging.INFO
        old = None if last is None else last.name
        logs.event(_log, level, "state", old=old, new=found.state.name, why=found.why)
        for listener in self._state_listeners:
            listener(found.state)
