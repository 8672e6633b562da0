"""The backend: commands go to the thread that receives, setpoints leave from the caller's thread."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import LinkLostError
from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.backends import futures
from ual_daemon.backends.base import Backend, BackendOptions, SafetyPilot, SimulatedPilot, UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.crazyflie import packets
from ual_daemon.backends.crazyflie.links import CrtpLink, CrtpUdpLink, ScannedLink, make_link, vehicle_key
from ual_daemon.backends.crazyflie.parameters import CrazyflieParameters
from ual_daemon.backends.crazyflie.session import Ask, CrazyflieSession
from ual_daemon.backends.crazyflie.settings import SECTION, CrazyflieSettings
from ual_daemon.backends.crazyflie.vehicle import describe
from ual_daemon.backends.engine.backend import EngineBackend
from ual_daemon.backends.mailbox import SetpointMailbox
from ual_daemon.backends.values import ExternalPose, Freshness, Setpoint, VehicleInfo
from ual_daemon.settings import ConfigError, convert

_ARMING_LIMIT_S = 5.0


class CrazyflieBackend(EngineBackend[Ask]):
    """Flies a Crazyflie over Crazyradio, USB, or UDP to its simulator. See ``docs/reference/backends/crazyflie.md``."""

    name = SECTION
    clock: MonotonicClock
    outlived = True
    freshness = Freshness(link_s=1.0, pose_s=1.0, mode_s=1.0, landed_s=1.0, estimator_s=2.0)

    def __init__(self, options: BackendOptions) -> None:
        self._settings = convert(options.settings, CrazyflieSettings, SECTION)
        self.url = options.url or self._settings.url
        super().__init__(dataclasses.replace(options, url=self.url))
        self.clock = MonotonicClock()
        self._link = self._make_link()
        self._is_simulation = isinstance(self._link, CrtpUdpLink)
        self._mailbox: SetpointMailbox | None = None
        self._session: CrazyflieSession | None = None
        self._resets_count = 0
        self._offers = (CrazyflieParameters(lambda: self._session),)

    @classmethod
    @override
    def fleet(cls, options: Sequence[BackendOptions], places: Sequence[Vector3], first: int = 0) -> list[Backend]:
        if any(each.url is None for each in options):
            raise ConfigError("a fleet of Crazyflies needs a --fleet-url for each", "fleet")
        return [cls(each) for each in options]

    @classmethod
    @override
    def vehicle_key(cls, url: str) -> str:
        return vehicle_key(url)

    def _make_link(self) -> CrtpLink:
        return ScannedLink() if self.url is None else make_link(self.url)

    @override
    def open(self, on_update: UpdateCallback) -> None:
        if self._link.is_slow:
            self._mailbox = SetpointMailbox(self._send_now, self.clock, f"crazyflie setpoints {self.options.ns}")
            self._mailbox.open()
        self._session = self._make_session(on_update)
        self._loop = self._session.loop
        self._session.thread.open()

    def _make_session(self, on_update: UpdateCallback) -> CrazyflieSession:
        name, lost_s = f"crazyflie {self.options.ns}", self.freshness.link_s
        parts = self._link, self._settings, self.clock, on_update, lost_s
        return CrazyflieSession(*parts, name=name, is_watch_only=self.is_watch_only)

    @override
    def close(self) -> None:
        if self._mailbox is not None:
            self._mailbox.close()
        if self._session is not None:
            self._session.thread.close()

    @override
    def info(self) -> VehicleInfo:
        if self._session is None:
            return describe({}, self._settings.yaw_rate_rad_s, is_simulation=self._is_simulation)
        return self._session.info

    @override
    def send(self, setpoint: Setpoint) -> None:
        session, mailbox = self._session, self._mailbox
        if session is None or not session.is_connected:
            return
        if mailbox is None:
            session.send(setpoint)
        else:
            mailbox.put(setpoint)

    def _send_now(self, setpoint: Setpoint) -> None:
        session = self._session
        if session is not None and session.is_connected:
            session.send(setpoint)

    @override
    def arm(self) -> Future[None]:
        return self._command("arm", lambda session: session.arm())

    @override
    def disarm(self) -> Future[None]:
        return self._command("disarm", lambda session: session.disarm())

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        del height_m, limits  # UAL's setpoints fly the climb
        return self._command("take off", lambda session: session.take_off())

    @override
    def land(self, limits: Limits) -> Future[None]:
        return self._command("land", lambda session: session.land(limits.descent_speed_m_s))

    @override
    def take_control(self) -> Future[None]:
        return self._command("take control", lambda session: session.take_control())

    @override
    def hold(self) -> Future[None]:
        return self._command("hold", lambda session: session.hold())

    @override
    def set_external_pose(self, measured: ExternalPose) -> None:
        session = self._session
        if session is not None and measured.resets_count != self._resets_count:
            # Smoothed by its filter, the jump that follows may be too slow to be seen.
            self._resets_count = measured.resets_count
            session.loop.post(lambda _: session.telemetry.on_jump(Vector3()))
        if session is not None and session.is_connected:
            position, orientation = measured.pose.position, measured.pose.orientation
            has_orientation = self._settings.sends_orientation
            self._link.send_pose(
                packets.external_pose(position, orientation) if has_orientation else packets.external_position(position)
            )

    @override
    def estimate_jumped(self, offset: Vector3) -> None:
        session = self._session
        if session is not None:
            session.telemetry.on_jump(offset)

    @override
    def utc_s(self) -> float:
        return self.clock.utc_s()

    @override
    def safety_pilot(self) -> SafetyPilot | None:
        return SimulatedPilot(self._may_arm, self._pilot_arms) if self._is_simulation else None

    def _may_arm(self) -> bool:
        health = self.snapshot().condition.health
        return health is not None and bool(health.is_ready_to_arm)

    def _pilot_arms(self) -> None:
        futures.wait(self.arm(), _ARMING_LIMIT_S, f"the Crazyflie has not armed within {_ARMING_LIMIT_S:g} s")

    def _command(self, what: str, command: Callable[[CrazyflieSession], Future[None]]) -> Future[None]:
        session = self._session
        if session is None:
            return futures.failed(LinkLostError(f"cannot {what}: no Crazyflie is connected"))
        return command(session)
