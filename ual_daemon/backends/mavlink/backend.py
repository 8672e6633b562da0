"""The backend: one thread that receives and converses; setpoints are sent from the caller's thread."""

from __future__ import annotations

import dataclasses
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

from ual.errors import LinkLostError, UalError
from ual.geometry import Pose
from ual_daemon import logs
from ual_daemon.backends.base import Backend, BackendOptions, SafetyPilot, UpdateCallback
from ual_daemon.backends.mavlink.autopilots.dialect import Dialect
from ual_daemon.backends.mavlink.links import Connection, make_link
from ual_daemon.backends.mavlink.links.endpoints import SerialEndpoint, parse_url
from ual_daemon.backends.mavlink.safety_pilot import SimulatedPilot
from ual_daemon.backends.mavlink.session.commands import Command
from ual_daemon.backends.mavlink.session.conversation import Conversation
from ual_daemon.backends.mavlink.session.setpoint_stream import SetpointStream
from ual_daemon.backends.mavlink.session.supervision import LinkStatistics, Supervision
from ual_daemon.backends.mavlink.session.vehicle import MavlinkVehicle
from ual_daemon.backends.mavlink.settings import SECTION, MavlinkSettings, default_url
from ual_daemon.backends.mavlink.wire.signing import Signer, read_key
from ual_daemon.backends.values import Sample, Setpoint, Snapshot, VehicleInfo
from ual_daemon.settings import convert

_log = logging.getLogger(__name__)

TICK_S = 0.05
"""How often time is looked at, and the longest between two updates."""
LOOK_S = 0.01
"""How often at most: after a pose, and while the autopilot is waited for."""
PAUSE_S = 1.0
"""When this thread had no turn for so long (a stopped process, a starved computer), what it finds waiting is old: PX4
may have left OFFBOARD meanwhile, and a setpoint sent by what it said before would bring it back there."""


class MonotonicClock:
    """The clock of a real vehicle."""

    def now_s(self) -> float:
        return time.monotonic()

    def utc_s(self) -> float:
        """The same moment as UTC."""
        return time.time()


class MavlinkBackend(Backend):
    """Flies a PX4 or an ArduCopter over MAVLink; only watches another autopilot. See ``docs/backends/mavlink.md``."""

    name = SECTION
    clock: MonotonicClock
    freshness = Dialect.freshness

    def __init__(self, options: BackendOptions) -> None:
        self._settings = convert(options.settings, MavlinkSettings, SECTION)
        self.url = options.url or self._settings.url or default_url(options.ns)
        super().__init__(dataclasses.replace(options, url=self.url))
        endpoint = parse_url(self.url)
        self._is_serial = isinstance(endpoint, SerialEndpoint)
        self._new_link = partial(make_link, endpoint)
        self._new_link()  # so that a missing extra is told now
        key_file = self._settings.signing_key_file
        self._signer = None if key_file is None else Signer(read_key(key_file))
        self.clock = MonotonicClock()
        self._stream = SetpointStream()
        self._supervision = Supervision(self.url, self.freshness.link_s)
        self._connection: Connection | None = None
        self._conversation: Conversation | None = None
        self._posted: deque[Callable[[float], None]] = deque()
        self._thread: threading.Thread | None = None
        self._closing = threading.Event()
        self._snapshot = Snapshot(time_s=self.clock.now_s())
        self._info = VehicleInfo()

    def open(self, on_update: UpdateCallback) -> None:
        connection = self._connection = Connection(self._new_link(), self.url)
        conversation = self._conversation = Conversation(
            self._settings, connection, self._stream.duration_s, self._supervision, self._signer
        )
        self._thread = threading.Thread(
            target=self._run, args=(connection, conversation, on_update), name=f"mavlink {self.options.ns}", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        thread, connection = self._thread, self._connection
        self._closing.set()
        if connection is not None:
            connection.wake()
        if thread is not None and thread is not threading.current_thread():
            thread.join()

    def info(self) -> VehicleInfo:
        return self._info

    def link_statistics(self) -> LinkStatistics:
        """How well the link is. From any thread."""
        conversation = self._conversation
        corrupt_count = 0 if conversation is None else conversation.corrupt_count
        return self._supervision.statistics(self.clock.now_s(), corrupt_count)

    def snapshot(self) -> Snapshot:
        return self._snapshot.at(self.clock.now_s())

    def send(self, setpoint: Setpoint) -> None:
        now_s = self.clock.now_s()
        vehicle = self._vehicle_in_reach(now_s)
        if vehicle is not None and vehicle.send(setpoint, now_s):
            self._stream.sent(now_s)

    def arm(self) -> Future[None]:
        return self._command("arm", lambda dialect: dialect.arm(self.snapshot()))

    def disarm(self) -> Future[None]:
        return self._command("disarm", lambda dialect: dialect.disarm())

    def take_off(self, height_m: float) -> Future[None]:
        return self._command("take off", lambda dialect: dialect.take_off(height_m, self.snapshot()))

    def land(self) -> Future[None]:
        return self._command("land", lambda dialect: dialect.land())

    def take_control(self) -> Future[None]:
        return self._command("take control", lambda dialect: dialect.take_control())

    def hold(self) -> Future[None]:
        return self._command("hold", lambda dialect: dialect.hold())

    def safety_pilot(self) -> SafetyPilot | None:
        return None if self._is_serial else SimulatedPilot(lambda: self._vehicle_in_reach(self.clock.now_s()), self.arm)

    def _command(self, what: str, make: Callable[[Dialect], Command]) -> Future[None]:
        """Hands a command to the thread that converses; its future ends there."""
        result: Future[None] = Future()
        vehicle, connection = self._vehicle_in_reach(self.clock.now_s()), self._connection
        if vehicle is None or connection is None:
            result.set_exception(LinkLostError(f"cannot {what}: no autopilot is heard at {self.url}"))
            return result
        try:
            command = make(vehicle.dialect)
        except UalError as error:
            result.set_exception(error)
            return result

        def submit(now_s: float) -> None:
            acknowledged = vehicle.submit(command, now_s, result.cancelled)
            acknowledged.add_done_callback(lambda done: _pass_on(done, result))

        self._posted.append(submit)
        connection.wake()
        return result

    def _vehicle_in_reach(self, now_s: float) -> MavlinkVehicle | None:
        """The autopilot, while its link is up."""
        vehicle = None if self._conversation is None else self._conversation.vehicle
        heard_s = None if vehicle is None else vehicle.telemetry.heard_s
        return vehicle if heard_s is not None and now_s - heard_s <= self.freshness.link_s else None

    def _run(self, connection: Connection, conversation: Conversation, on_update: UpdateCallback) -> None:
        try:
            while not self._closing.is_set():
                self._converse_until_defect(connection, conversation, on_update)
        finally:
            connection.close()
            _log_statistics(self.link_statistics())

    def _converse_until_defect(
        self, connection: Connection, conversation: Conversation, on_update: UpdateCallback
    ) -> None:
        try:
            self._converse(connection, conversation, on_update)
        except Exception:  # noqa: BLE001 - who flies must hear of a lost link, and have it back: this thread goes on
            _log.exception("the conversation with the autopilot failed; this is a defect of UAL, please report it")
            now_s = self.clock.now_s()
            conversation.forget()
            connection.restart(now_s)
            self._update(conversation.vehicle, connection.trouble, now_s, on_update)
            self._closing.wait(TICK_S)

    def _converse(self, connection: Connection, conversation: Conversation, on_update: UpdateCallback) -> None:
        next_tick_s = looked_s = updated_s = turn_s = self.clock.now_s()
        has_news = False
        sessions_count = 0
        pose: Sample[Pose] | None = None
        while not self._closing.is_set():
            chunks = connection.receive(next_tick_s - self.clock.now_s(), self.clock.now_s())
            turn_s, last_turn_s = self.clock.now_s(), turn_s
            if turn_s - last_turn_s > PAUSE_S:
                _log.warning("this thread had no turn for %.1f s: asking the autopilot anew", turn_s - last_turn_s)
                connection.discard(turn_s)
                conversation.forget()
                chunks = []
            if connection.sessions_count != sessions_count:
                sessions_count = connection.sessions_count
                conversation.reconnected()
            for data, address in chunks:
                conversation.receive(data, address, self.clock.now_s(), self.clock.utc_s())
            now_s = self.clock.now_s()
            vehicle = conversation.vehicle
            if vehicle is not None and not self._info.autopilot:  # before the first update that is about it
                self.freshness, self._info = vehicle.dialect.freshness, vehicle.info()
            newest = None if vehicle is None else vehicle.telemetry.pose
            has_moved = newest is not pose
            if has_moved or now_s - updated_s >= TICK_S:
                pose, updated_s = newest, now_s
                self._update(vehicle, connection.trouble, now_s, on_update)
            has_news = has_news or has_moved or (vehicle is not None and vehicle.is_hurried)
            is_look_due = now_s - looked_s >= (LOOK_S if has_news else TICK_S)
            # After a new pose the rest waits for the next turn: whoever was just told of it needs Python's lock now.
            if (has_moved or not is_look_due) and now_s < next_tick_s and not self._posted:
                continue
            looked_s, has_news = now_s, False
            self._supervise(connection, now_s)
            while self._posted:
                self._posted.popleft()(now_s)
            conversation.tick(now_s)
            if now_s >= next_tick_s:
                next_tick_s = now_s + TICK_S
                info = self._info if vehicle is None else vehicle.info()
                if info != self._info:  # the same one as long as nothing is new: what follows from it stays, too
                    self._info = info

    def _supervise(self, connection: Connection, now_s: float) -> None:
        heard_s = self._supervision.heard_s
        if heard_s is not None:
            connection.heard(heard_s)
        connection.tick(now_s)

    def _update(self, vehicle: MavlinkVehicle | None, trouble: str, now_s: float, on_update: UpdateCallback) -> None:
        snapshot = Snapshot(now_s) if vehicle is None else vehicle.snapshot(now_s)
        if trouble:
            snapshot = snapshot._replace(status_text=trouble)
        self._snapshot = snapshot
        try:
            on_update(snapshot)
        except Exception:  # noqa: BLE001 - the conversation with the autopilot goes on, whatever is wrong above
            _log.exception("an update failed")


def _log_statistics(statistics: LinkStatistics) -> None:
    """Says at the end how well the link was."""
    numbers = {
        name: round(value, 3) if isinstance(value, float) else value
        for name, value in dataclasses.asdict(statistics).items()
    }
    logs.event(_log, logging.INFO, "link_statistics", **{**numbers, "state": statistics.state.value})


def _pass_on(done: Future[None], result: Future[None]) -> None:
    if not result.set_running_or_notify_cancel():
        return  # withdrawn
    error = done.exception()
    if error is None:
        result.set_result(None)
    else:
        result.set_exception(error)
