"""Runs the daemon: opens the port, flies until a signal comes, and ends in a way that is safe for the UAV."""

from __future__ import annotations

import asyncio
import gc
import logging
import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from ual.shared import tracing
from ual.types import State
from ual_daemon import logs, traces
from ual_daemon.backends.base import SafetyPilot
from ual_daemon.program import ending, heap
from ual_daemon.program.aside import aside
from ual_daemon.program.auto_arm import auto_arm
from ual_daemon.program.checks import DaemonChecks
from ual_daemon.program.clock_watch import ClockWatch
from ual_daemon.program.namespace import Namespace
from ual_daemon.program.supervision import Supervision, Unsupervised
from ual_daemon.program.upkeep import Upkeep
from ual_daemon.server.addresses import Address, ListenError
from ual_daemon.server.call_log import CallObserver
from ual_daemon.server.motion_gate import MotionGate
from ual_daemon.server.server import Server
from ual_daemon.server.services import services
from ual_daemon.server.telemetry_stream import LoopCalls
from ual_daemon.server.transport import selection
from ual_daemon.server.transport.base import MakeCredentials, Transport
from ual_daemon.server.waiting import completion
from ual_daemon.ual import UAL

if TYPE_CHECKING:
    from ual.interface import Simulation
    from ual_daemon.choice import ServedVehicle
    from ual_daemon.program.metrics.gathering import ProcessMetrics
    from ual_daemon.program.network.announcement import UavAnnouncement
    from ual_daemon.program.network.publisher import Publisher
    from ual_daemon.program.recording.audit import Audit
    from ual_daemon.program.recording.recording import DaemonRecording
    from ual_daemon.server.access.policy import Access
    from ual_daemon.server.simulation_service import SimulatedTime

_log = logging.getLogger(__name__)

_SAFE_EXIT_LIMIT_S = 60.0
_CLOSE_TIMEOUT_S = 10.0
"""For all that is left once the UAVs are safe."""
_FIRST_REMINDER_S, _REMINDER_PERIOD_S = 1.0, 5.0
_GATHER_S = 0.005
"""Seconds for which a fleet gathers updates before it hands them to the event loop together."""
_ANY_HOST = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104  compared with, not bound to


class Callers(NamedTuple):
    """Callers that are let in: TLS, and how callers prove their identity."""

    credentials: MakeCredentials | None = None
    access: Access | None = None

    @property
    def needs_role(self) -> bool:
        """Whether a caller of another computer needs a role to fly."""
        return self.access is None or self.access.needs_role


class DaemonUav(NamedTuple):
    """A UAV to fly: its vehicle, its namespace, the addresses to serve it on, and the class interface, which has its
    extensions.
    """

    vehicle: ServedVehicle
    namespace: Namespace
    listen: Sequence[Address]
    interface: UAL


class Daemon:
    """Runs one or more UAVs, each with a server of its own, on one event loop."""

    def __init__(
        self,
        uavs: Sequence[DaemonUav],
        callers: Callers | None = None,
        *,
        transport: selection.Choice = "auto",
        is_auto_arming: bool = False,
        recording: DaemonRecording | None = None,
        audit: Audit | None = None,
        is_audit_required: bool = False,
        metrics: ProcessMetrics | None = None,
        supervision: Supervision | None = None,
        network: Publisher | None = None,
    ) -> None:
        self._network = network
        self._supervision = supervision or Unsupervised()
        self._is_of_many = len(uavs) > 1 or supervision is not None
        self._recording = recording
        self._audit = audit
        self._motion_gate = None if audit is None or not is_audit_required else MotionGate(lambda: audit.trouble)
        self._metrics = metrics
        self._uavs = uavs
        self._callers = callers or Callers()
        self._transport = transport
        self._is_auto_arming = is_auto_arming

    async def run(self) -> bool:
        """Runs until a signal comes. Returns whether all UAVs are safe: False if one had to be left in motion.

        No UAV is served before the addresses of all are open.

        Raises:
            ListenError: An address is not available.
            NamespaceError: The registration cannot be written.
        """
        stop = asyncio.Event()
        traces.tracer = tracing.of_environment()
        self._supervision.watch(stop.set)
        self._watch_checks()
        if self._is_of_many:
            for uav in self._uavs:
                uav.vehicle.log_name = uav.vehicle.ns
        gather_s = _GATHER_S if self._is_of_many else 0.0
        transport, loop_calls = await selection.choose(self._transport, gather_s), LoopCalls(gather_s)
        served = [
            _Served(
                uav,
                transport,
                loop_calls,
                self._callers,
                is_auto_arming=self._is_auto_arming,
                observers=self._observers(uav.vehicle),
                time_of=self._supervision.time_of,
                motion_gate=self._motion_gate,
            )
            for uav in self._uavs
        ]
        if self._metrics is not None:
            for uav, each in zip(self._uavs, served, strict=True):
                self._metrics.add(uav.vehicle, each.server)
        is_serving = False
        try:
            is_serving = await self._serve(served, stop)
        finally:
            if not is_serving:
                await asyncio.gather(*(each.server.stop() for each in served))
                transport.close()
        are_safe = not is_serving or await self._fly(served, stop, transport)
        if are_safe:
            self._supervision.ended()
        return are_safe

    async def _serve(self, served: Sequence[_Served], stop: asyncio.Event) -> bool:
        """Opens all addresses, then serves on them. Returns False if it is to end, at any time meanwhile."""
        for each in served:
            each.listen()
            await asyncio.sleep(0.0)  # a signal is received
            if stop.is_set():
                return False
        if not await self._supervision.may_serve():
            return False
        for each in served:
            await each.start()
            await asyncio.sleep(0.0)
            if stop.is_set():
                return False
        self._supervision.serves([uav.vehicle.ns for uav in self._uavs])
        return True

    async def _fly(self, served: Sequence[_Served], stop: asyncio.Event, transport: Transport) -> bool:
        """Flies until it is to end. Returns whether all UAVs are safe."""
        # Objects made so far live until the end. If they were not frozen, a full garbage collection would take 10 to
        # 15 ms, between two setpoints.
        gc.freeze()
        gc.enable()
        trimming = asyncio.create_task(heap.keep_trimmed())
        trimming.add_done_callback(_log_failure)
        kept = [file.keep for uav in self._uavs for file in uav.vehicle.kept_files]
        upkeep = Upkeep([ClockWatch().compare, *(uav.namespace.keep for uav in self._uavs), *kept])
        upkeep.start()
        try:
            for each in served:
                each.open()
            if self._network is not None:
                self._network.start([each.announced() for each in served])
            await stop.wait()
        finally:
            trimming.cancel()
            upkeep.close()
            limit = ending.within(_SAFE_EXIT_LIMIT_S + _CLOSE_TIMEOUT_S)
            are_safe = all(await asyncio.gather(*(each.end() for each in served)))
            if self._network is not None:  # they were there until they were safe
                await aside(self._network.close)
            transport.close()
            limit.cancel()
            gc.unfreeze()
        return are_safe

    def _watch_checks(self) -> None:
        """Has the health of the UAVs tell which checks of the daemon fail."""
        audit, recording = self._audit, self._recording
        sources: list[Callable[[], Sequence[str]]] = [] if audit is None else [lambda: audit.report.checks]
        if recording is not None:
            sources.append(lambda: recording.checks)
        checks = DaemonChecks([uav.vehicle for uav in self._uavs], sources)
        checks.watch_threads()
        checks.watch_files()
        if recording is not None:
            recording.tell_changes(checks.refresh)
        if audit is not None:
            audit.on_change = checks.refresh
            self._supervision.watch_audit(audit.on_report_above)
        checks.refresh()

    def _observers(self, vehicle: ServedVehicle) -> list[CallObserver]:
        """Returns what observes the calls for a UAV."""
        observers = [] if self._recording is None else [self._recording.observer(vehicle.ns)]
        return observers if self._audit is None else [*observers, self._audit.observer(vehicle)]


class _Served:
    """One UAV with its server."""

    def __init__(
        self,
        uav: DaemonUav,
        transport: Transport,
        loop_calls: LoopCalls,
        callers: Callers,
        *,
        is_auto_arming: bool,
        observers: Sequence[CallObserver],
        time_of: Callable[[Simulation], SimulatedTime],
        motion_gate: MotionGate | None,
    ) -> None:
        self._vehicle, self._namespace, self._listen, self._interface = uav
        self._credentials = callers.credentials
        self._needs_role = callers.needs_role
        self._transport_name = transport.name
        self._pilot = self._vehicle.safety_pilot() if is_auto_arming else None
        self._arming: asyncio.Task[None] | None = None
        self._addresses: Sequence[Address] = ()
        self.server = Server(
            self._vehicle,
            transport,
            loop_calls,
            observers,
            callers.access,
            [*services(self._vehicle), *self._interface.extensions.services],
            time_of,
            tracing.of_environment(),
            motion_gate,
        )

    def listen(self) -> None:
        """Opens the addresses."""
        try:
            self._addresses = self.server.listen(self._listen, self._credentials)
        except ListenError as error:
            name = self._vehicle.log_name
            raise ListenError(f"{name}: {error}" if name else str(error)) from None

    async def start(self) -> None:
        """Starts the server and registers its address for clients."""
        addresses = self._addresses
        await self.server.start()
        self._namespace.register(_for_local_clients(addresses, self._credentials), self._vehicle.backend_name)
        logs.event(
            _log,
            logging.INFO,
            "listening",
            ns=self._vehicle.ns,
            backend=self._vehicle.backend_name,
            addresses=" ".join(map(str, addresses)),
            tls=self._credentials is not None,
            transport=self._transport_name,
            pid=os.getpid(),
        )

    def announced(self) -> UavAnnouncement:
        """Returns the report of it for the network."""
        from ual_daemon.program.network.announcement import UavAnnouncement

        vehicle = self._vehicle
        return UavAnnouncement(
            vehicle.ns,
            vehicle.backend_name,
            self._addresses,
            vehicle.telemetry,
            has_tls=self._credentials is not None,
            needs_role=self._needs_role,
            is_watch_only=vehicle.is_watch_only,
        )

    def open(self) -> None:
        """Connects the vehicle to its autopilot, and starts automatic arming if it is wanted."""
        self._vehicle.open()
        self._interface.extensions.start()
        if self._pilot is not None:
            self._arming = asyncio.create_task(self._auto_arm(self._pilot))
            self._arming.add_done_callback(_log_failure)

    async def _auto_arm(self, pilot: SafetyPilot) -> None:
        logs.uav.set(self._vehicle.log_name)
        self._vehicle.commands.is_armed_automatically = True
        try:
            await auto_arm(pilot, self._vehicle.clock, self.server.updates, self._vehicle.why_not_auto_arm)
        finally:
            self._vehicle.commands.is_armed_automatically = False

    async def end(self) -> bool:
        """Waits until the UAV is safe, then stops the server and closes the vehicle. Returns whether it is safe."""
        logs.uav.set(self._vehicle.log_name)
        if self._arming is not None:
            self._arming.cancel()
        self.server.begin_shutdown()
        is_safe = await self._until_safe()
        await self.server.stop()
        await aside(self._interface.release)
        await aside(self._vehicle.close)
        return is_safe

    async def _until_safe(self) -> bool:
        """Waits until the UAV needs the daemon no more, at most `_SAFE_EXIT_LIMIT_S`. Returns whether that is so."""
        safe = self._vehicle.prepare_shutdown()
        done = completion(safe)
        deadline_s, patience_s = asyncio.get_running_loop().time() + _SAFE_EXIT_LIMIT_S, _FIRST_REMINDER_S
        while not done.done():
            left_s = deadline_s - asyncio.get_running_loop().time()
            if left_s <= 0.0:
                return self._leave_in_flight(f"it was not at rest after {_SAFE_EXIT_LIMIT_S:g} s")
            await asyncio.wait((done,), timeout=min(left_s, patience_s))
            patience_s = _REMINDER_PERIOD_S
            if not done.done():
                telemetry = self._vehicle.telemetry()
                fields = {"state": telemetry.state.name, "why": telemetry.state_reason, "limit_s": round(left_s)}
                logs.event(_log, logging.WARNING, "waiting_to_end", **fields)
        error = safe.exception()
        if error is not None:
            return self._leave_in_flight(str(error))
        if self._vehicle.state() is State.FLYING_AUTO and self._vehicle.is_in_control():
            return self._leave_in_flight("the autopilot did not take over: it still waits for setpoints")
        return True

    def _leave_in_flight(self, why: str) -> bool:
        logs.event(_log, logging.ERROR, "leaving_in_flight", why=why, **self._vehicle.doing())
        return False


def _log_failure(task: asyncio.Task[None]) -> None:
    """Logs the exception of a task as soon as it fails, and not only when the daemon ends."""
    if not task.cancelled() and task.exception() is not None:
        _log.error("a task of the daemon has failed", exc_info=task.exception())


def _for_local_clients(addresses: Sequence[Address], credentials: MakeCredentials | None) -> str:
    """Returns the best address for clients of this computer: one without TLS, if there is one."""
    plain = [address for address in addresses if credentials is None or address.is_unix]
    best = (plain or addresses)[0]
    if best.host in _ANY_HOST:
        return str(Address(_ANY_HOST[best.host], best.port))
    return f"unix:{os.path.abspath(best.host)}" if best.is_unix else str(best)  # noqa: PTH100  does not resolve links
