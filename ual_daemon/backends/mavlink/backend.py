"""The backend: one thread that receives and converses, setpoints sent from the caller's thread."""

from __future__ import annotations

import dataclasses
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future

from ual.errors import LinkLostError, UalError

from ual_daemon.backends.base import Backend, BackendOptions, UpdateCallback
from ual_daemon.backends.mavlink.commands import Command
from ual_daemon.backends.mavlink.dialect import Dialect, Unknown
from ual_daemon.backends.mavlink.frames import Frame, split
from ual_daemon.backends.mavlink.link import Address, UdpLink
from ual_daemon.backends.mavlink.messages import Codec, CorruptFrameError, Message, mavlink
from ual_daemon.backends.mavlink.px4 import Px4
from ual_daemon.backends.mavlink.setpoints import SetpointStream
from ual_daemon.backends.mavlink.settings import SECTION, MavlinkSettings, default_url, parse_url
from ual_daemon.backends.mavlink.vehicle import HEARTBEAT_S, MavlinkVehicle, heartbeat
from ual_daemon.backends.values import Freshness, Setpoint, Snapshot, VehicleInfo
from ual_daemon.settings import convert

_log = logging.getLogger(__name__)

TICK_S = 0.05
"""How often time is looked at, and the longest between two updates."""
_CALLER_SYSTEM_ID = 245
"""Who we are until the autopilot is known, whose system we then join."""


class MonotonicClock:
    """The clock of a real vehicle."""

    def now_s(self) -> float:
        return time.monotonic()


class MavlinkBackend(Backend):
    """Flies a PX4 over MAVLink; hears any autopilot that speaks its common messages."""

    name = SECTION
    # PX4's slowest unasked rates: heartbeat and estimator 1 Hz, landed state 5 Hz, position 30 Hz.
    freshness = Freshness(link_s=1.5, pose_s=1.0, mode_s=3.0, landed_s=1.5, estimator_s=3.0)

    def __init__(self, options: BackendOptions) -> None:
        super().__init__(options)
        self._settings = convert(options.settings, MavlinkSettings, SECTION)
        self.url = options.url or self._settings.url or default_url(options.ns)
        self._endpoint = parse_url(self.url)
        self.clock = MonotonicClock()
        self._codec = Codec(self._settings.component_id)
        self._codec.join(_CALLER_SYSTEM_ID)
        self._stream = SetpointStream()
        self._link: UdpLink | None = None
        self._thread: threading.Thread | None = None
        self._is_closing = False
        self._posted: deque[Callable[[float], None]] = deque()
        self._vehicle: MavlinkVehicle | None = None
        self._snapshot = Snapshot(time_s=self.clock.now_s())
        self._info = VehicleInfo()
        self._trouble = ""
        self._next_call_s = self.clock.now_s()
        self.corrupt_count = 0
        """How many bytes or frames came that were no messages."""

    def open(self, on_update: UpdateCallback) -> None:
        link = self._link = UdpLink(self._endpoint)
        self._thread = threading.Thread(
            target=self._run, args=(link, on_update), name=f"mavlink {self.options.ns}", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        thread, self._thread = self._thread, None
        link = self._link
        if thread is None or link is None:
            return
        self._is_closing = True
        link.wake()
        if thread is not threading.current_thread():
            thread.join()

    def info(self) -> VehicleInfo:
        return self._info

    def snapshot(self) -> Snapshot:
        return dataclasses.replace(self._snapshot, time_s=self.clock.now_s())

    def send(self, setpoint: Setpoint) -> None:
        vehicle, link, now_s = self._vehicle, self._link, self.clock.now_s()
        if vehicle is None or link is None or not self._is_link_up(vehicle, now_s):
            return
        message = vehicle.dialect.setpoint(setpoint, vehicle.system_id, int(now_s * 1000.0) & 0xFFFFFFFF)
        if link.send(self._codec.encode(message)):
            self._stream.sent(now_s)

    def arm(self) -> Future[None]:
        return self._command("arm", lambda dialect: dialect.arm(is_arming=True))

    def disarm(self) -> Future[None]:
        return self._command("disarm", lambda dialect: dialect.arm(is_arming=False))

    def take_off(self, height_m: float) -> Future[None]:
        return self._command("take off", lambda dialect: dialect.take_off(height_m))

    def land(self) -> Future[None]:
        return self._command("land", lambda dialect: dialect.land())

    def take_control(self) -> Future[None]:
        return self._command("take control", lambda dialect: dialect.take_control())

    def hold(self) -> Future[None]:
        return self._command("hold", lambda dialect: dialect.hold())

    def _command(self, what: str, make: Callable[[Dialect], Command]) -> Future[None]:
        """Hands a command to the thread that converses; its future ends there."""
        result: Future[None] = Future()
        result.set_running_or_notify_cancel()
        vehicle, link = self._vehicle, self._link
        if vehicle is None or link is None or not self._is_link_up(vehicle, self.clock.now_s()):
            result.set_exception(LinkLostError(f"cannot {what}: no autopilot is heard at {self.url}"))
            return result
        try:
            command = make(vehicle.dialect)
        except UalError as error:
            result.set_exception(error)
            return result

        def submit(now_s: float) -> None:
            vehicle.submit(command, now_s).add_done_callback(lambda done: _pass_on(done, result))

        self._posted.append(submit)
        link.wake()
        return result

    def _is_link_up(self, vehicle: MavlinkVehicle, now_s: float) -> bool:
        heard_s = vehicle.telemetry.heard_s
        return heard_s is not None and now_s - heard_s <= self.freshness.link_s

    def _run(self, link: UdpLink, on_update: UpdateCallback) -> None:
        try:
            self._converse(link, on_update)
        finally:
            link.close()

    def _converse(self, link: UdpLink, on_update: UpdateCallback) -> None:
        next_tick_s = updated_s = self.clock.now_s()
        pose_time_s: float | None = None
        while not self._is_closing:
            for datagram, address in link.receive(next_tick_s - self.clock.now_s()):
                self._receive(datagram, address, link)
            now_s = self.clock.now_s()
            self._run_posted(now_s)
            self._tick(now_s, link)
            vehicle = self._vehicle
            if now_s >= next_tick_s:
                next_tick_s = now_s + TICK_S
                if vehicle is not None:
                    self._info = vehicle.info()
            newest_s = None if vehicle is None else vehicle.telemetry.pose_time_s
            if newest_s != pose_time_s or now_s - updated_s >= TICK_S:
                pose_time_s, updated_s = newest_s, now_s
                self._update(now_s, on_update)

    def _open_link(self, link: UdpLink) -> None:
        """Takes the port, or says why it cannot; to be tried again."""
        try:
            link.open()
        except OSError as error:
            trouble = f"{error}; trying again (does another program use this port?)"
            if trouble != self._trouble:
                _log.warning("%s", trouble)
            self._trouble = trouble
        else:
            self._trouble = ""
            _log.info("waiting for an autopilot at %s", self.url)

    def _receive(self, datagram: bytes, address: Address, link: UdpLink) -> None:
        now_s = self.clock.now_s()
        frames, garbage = split(datagram)
        self.corrupt_count += garbage
        for frame in frames:
            if frame.component_id == mavlink.MAV_COMP_ID_AUTOPILOT1:
                self._take(frame, address, link, now_s)

    def _take(self, frame: Frame, address: Address, link: UdpLink, now_s: float) -> None:
        """Takes a frame of an autopilot, ours or another."""
        try:
            self._understand(frame, address, link, now_s)
        except CorruptFrameError as error:
            self.corrupt_count += 1
            _log.debug("dropped a frame: %s", error)

    def _understand(self, frame: Frame, address: Address, link: UdpLink, now_s: float) -> None:
        vehicle = self._vehicle
        if vehicle is None:
            is_wanted = self._settings.system_id in (None, frame.system_id)
            if not is_wanted or frame.message_id != mavlink.MAVLINK_MSG_ID_HEARTBEAT:
                return
            message = self._codec.decode(frame)
            if message.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
                return
            vehicle = self._meet(frame.system_id, message, address, link)
            vehicle.update(message, now_s, time.time())
        elif frame.system_id == vehicle.system_id:
            if not vehicle.uses(frame.message_id):
                vehicle.notice(frame.message_id, now_s)
                return
            vehicle.update(self._codec.decode(frame), now_s, time.time())
            if link.peer != address:  # only what was decoded, so checked, says where it is
                link.answer_to(address)

    def _meet(self, system_id: int, message: Message, address: Address, link: UdpLink) -> MavlinkVehicle:
        """The autopilot of this heartbeat is ours from now on."""
        dialect = Px4() if message.autopilot == mavlink.MAV_AUTOPILOT_PX4 else Unknown(message.autopilot)
        link.answer_to(address)
        self._codec.join(system_id)
        vehicle = self._vehicle = MavlinkVehicle(
            system_id,
            dialect,
            self._settings.pose_rate_hz,
            (system_id, self._codec.component_id),
            lambda outgoing: link.send(self._codec.encode(outgoing)),
            self._stream.duration_s,
        )
        _log.info("connected to %s, system %d, at %s:%d", dialect.name, system_id, address[0], address[1])
        return vehicle

    def _run_posted(self, now_s: float) -> None:
        while self._posted:
            self._posted.popleft()(now_s)

    def _tick(self, now_s: float, link: UdpLink) -> None:
        vehicle = self._vehicle
        if vehicle is not None:
            vehicle.tick(now_s)
        elif now_s >= self._next_call_s:
            self._next_call_s = now_s + HEARTBEAT_S
            if not link.is_open:
                self._open_link(link)
            link.send(self._codec.encode(heartbeat()))  # goes nowhere when we listen: nobody is known yet

    def _update(self, now_s: float, on_update: UpdateCallback) -> None:
        vehicle = self._vehicle
        snapshot = Snapshot(now_s, status_text=self._trouble) if vehicle is None else vehicle.snapshot(now_s)
        self._snapshot = snapshot
        try:
            on_update(snapshot)
        except Exception:  # noqa: BLE001 - the conversation with the autopilot goes on, whatever is wrong above
            _log.exception("an update failed")


def _pass_on(done: Future[None], result: Future[None]) -> None:
    error = done.exception()
    if error is None:
        result.set_result(None)
    else:
        result.set_exception(error)
