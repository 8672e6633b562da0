"""The backend: commands go to the link's thread, setpoints leave from the caller's thread."""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

from typing_extensions import override

from ual.errors import LinkLostError, UalError
from ual.types import Limits
from ual_daemon import logs
from ual_daemon.backends import futures
from ual_daemon.backends.base import Backend, BackendOptions, SafetyPilot, UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.engine.scheduling_gap import SchedulingGap
from ual_daemon.backends.firmwares.autopilot import HomeUnknownError
from ual_daemon.backends.firmwares.safety_pilot import SimulatedPilot
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.mavros import commands, topics
from ual_daemon.backends.mavros.commands import Step
from ual_daemon.backends.mavros.discovery import Discovery
from ual_daemon.backends.mavros.session import FRESHNESS, Session
from ual_daemon.backends.mavros.settings import SECTION, MavrosSettings
from ual_daemon.backends.rosbridge import DEFAULT_URL, RosbridgeLink, parse_url
from ual_daemon.backends.values import Setpoint, Snapshot, VehicleInfo
from ual_daemon.settings import convert

_log = logging.getLogger(__name__)

UPDATE_S = 0.05
"""The longest interval between two updates."""
HOME_PATIENCE_S = 2.0
"""A command that needs the position of home waits this long for it: at arming it is forgotten, and asked for again."""

Make = Callable[[Session, Snapshot], tuple[Step, ...]]


class MavrosBackend(Backend):
    """Flies a PX4 or an ArduCopter through MAVROS. See ``docs/backends/mavros.md``."""

    name = SECTION
    clock: MonotonicClock
    freshness = FRESHNESS
    outlived = True

    def __init__(self, options: BackendOptions) -> None:
        super().__init__(options)
        self._settings = convert(options.settings, MavrosSettings, SECTION)
        self.url = parse_url(options.url or DEFAULT_URL)
        self.clock = MonotonicClock()
        self._sent = SetpointMonitor()
        self._setpoint_topic = f"{self._settings.node}/{topics.SETPOINT}"
        self._posted: deque[Callable[[float], None]] = deque()
        self._retried: list[Callable[[float], None]] = []
        self._link: RosbridgeLink | None = None
        self._discovery: Discovery | None = None
        self._on_update: UpdateCallback = lambda _: None
        self._snapshot = Snapshot(-math.inf)
        self._info = VehicleInfo()
        self._has_news = False
        self._updated_s = -math.inf
        self._scheduling_gap = SchedulingGap()

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._on_update = on_update
        link = self._link = self._make_link()
        link.advertise(self._setpoint_topic, topics.SETPOINT_TYPE)
        self._discovery = Discovery(link, self._settings, self._sent, self._take, self.utc_s)
        link.open()

    def _make_link(self) -> RosbridgeLink:
        return RosbridgeLink(self.url, self.clock, self._step)

    @override
    def close(self) -> None:
        if self._link is not None:
            self._link.close()

    @override
    def info(self) -> VehicleInfo:
        return self._info

    @override
    def snapshot(self) -> Snapshot:
        return self._snapshot.at(self.clock.now_s())

    @override
    def send(self, setpoint: Setpoint) -> None:
        now_s = self.clock.now_s()
        link, session = self._link, self._session_in_reach(now_s)
        if link is None or session is None:
            return
        link.publish(self._setpoint_topic, session.message_of(setpoint, now_s))
        self._sent.on_sent(now_s, getattr(setpoint, "position", None))

    @override
    def arm(self) -> Future[None]:
        return self._command("arm", lambda session, snapshot: commands.arming(session.autopilot, snapshot))

    @override
    def disarm(self) -> Future[None]:
        return self._command("disarm", lambda *_: (commands.arm_or_disarm(is_arming=False),))

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        is_slower = limits.climb_speed_m_s < self.info().limits.climb_speed_m_s

        def make(session: Session, snapshot: Snapshot) -> tuple[Step, ...]:
            altitude_m = session.autopilot.takeoff_altitude_m(height_m, snapshot, is_slower=is_slower)
            return commands.taking_off(session.autopilot, altitude_m)

        return self._command("take off", make)

    @override
    def land(self, limits: Limits) -> Future[None]:
        del limits  # the autopilots' landings take no speed: MPC_LAND_SPEED, LAND_SPEED
        return self._command("land", lambda session, _: (commands.set_mode(session.autopilot.land_mode, "land"),))

    @override
    def take_control(self) -> Future[None]:
        def make(session: Session, _: Snapshot) -> tuple[Step, ...]:
            autopilot = session.autopilot
            return (commands.set_mode(autopilot.setpoint_mode, "take control", autopilot.setpoints_before_mode_s),)

        return self._command("take control", make)

    @override
    def hold(self) -> Future[None]:
        return self._command("hold", lambda session, _: (commands.set_mode(session.autopilot.hold_mode, "hold"),))

    @override
    def utc_s(self) -> float:
        return self.clock.utc_s()

    @override
    def safety_pilot(self) -> SafetyPilot | None:
        return SimulatedPilot(lambda: self._session_in_reach(self.clock.now_s()), self.arm)

    # --- On the link's thread -----------------------------------------------------------------------------------------

    def _step(self) -> None:
        """Does what is due: after each batch of messages, and at least every 0.1 s."""
        now_s = self.clock.now_s()
        discovery = self._discovery
        if discovery is None:
            return
        self._watch_pause(now_s)
        posted, self._retried = self._retried, []
        while self._posted:
            posted.append(self._posted.popleft())
        for request in posted:
            request(now_s)
        discovery.tick(now_s)
        if self._has_news or now_s - self._updated_s >= UPDATE_S:
            self._has_news, self._updated_s = False, now_s
            self._publish(now_s)

    def _take(self, session: Session, topic: str, message: object, now_s: float) -> None:
        """Takes a message of MAVROS for the session; one with a field that is missing is logged by the link."""
        was_ours = session.takes_setpoints
        session.on_message(topic, message, now_s)  # type: ignore[arg-type]
        if was_ours and not session.takes_setpoints and self._link is not None:
            self._link.withdraw(self._setpoint_topic)  # the safety pilot has taken over: one may wait in a full socket
        self._has_news = self._has_news or topic == topics.POSE

    def _watch_pause(self, now_s: float) -> None:
        session = None if self._discovery is None else self._discovery.session
        pause_s = self._scheduling_gap.woke(now_s, math.inf if session is None else session.freshness.link_s)
        if pause_s and session is not None:
            logs.event(_log, logging.WARNING, "thread_paused", pause_s=round(pause_s, 1))
            session.restart()

    def _publish(self, now_s: float) -> None:
        discovery = self._discovery
        assert discovery is not None
        session, why = discovery.session, discovery.why_not
        if session is not None:
            self.freshness = session.freshness
            info = session.info()
            if info != self._info:
                self._info = info
        else:
            self._info = discovery.info
        snapshot = Snapshot(now_s) if session is None else session.snapshot(now_s)
        snapshot = snapshot._replace(updated_s=now_s, scheduling_gap=self._scheduling_gap.why(now_s))
        self._snapshot = snapshot = snapshot._replace(status_text=why, link_trouble=why) if why else snapshot
        try:
            self._on_update(snapshot)
        except Exception:  # noqa: BLE001 - a defect of the layers above must not end the exchange with the autopilot
            _log.exception("an update failed")

    def _command(self, what: str, make: Make) -> Future[None]:
        """Passes a command to the link's thread; its future ends there."""
        asked_s = self.clock.now_s()
        if self._session_in_reach(asked_s) is None:
            why = "" if self._discovery is None else self._discovery.why_not
            return futures.failed(LinkLostError(f"cannot {what}: {why or f'no autopilot is heard at {self.url}'}"))
        result: Future[None] = Future()
        self._posted.append(partial(self._submit, what, make, asked_s, result))
        return result

    def _submit(self, what: str, make: Make, asked_s: float, result: Future[None], now_s: float) -> None:
        session = self._session_in_reach(now_s)
        if result.cancelled():
            return
        if session is None:
            futures.end(result, LinkLostError(f"cannot {what}: no autopilot is heard at {self.url}"))
            return
        try:
            steps = make(session, session.snapshot(now_s))
        except UalError as error:
            if isinstance(error, HomeUnknownError) and now_s - asked_s < HOME_PATIENCE_S:
                self._retried.append(partial(self._submit, what, make, asked_s, result))
            else:
                futures.end(result, error)
            return
        done = session.submit(steps, now_s, result.cancelled)
        done.add_done_callback(lambda ended: futures.end(result, ended.exception()))

    def _session_in_reach(self, now_s: float) -> Session | None:
        """The session with the autopilot while MAVROS passes on what it sends, else None. From any thread."""
        discovery, link = self._discovery, self._link
        session = None if discovery is None else discovery.session
        if session is None or link is None or not link.is_up or not session.telemetry.is_connected:
            return None
        heard_s = session.telemetry.heard_s
        return session if heard_s is not None and now_s - heard_s <= session.freshness.link_s else None
