"""DJI's aircraft as a backend."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

from typing_extensions import override

from ual.types import Capability, Limits
from ual_daemon import logs
from ual_daemon.backends import futures
from ual_daemon.backends.base import BackendOptions, UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.dji.cameras import DjiCameras, Surroundings
from ual_daemon.backends.dji.commands import DjiRequest, Grant, landing, request
from ual_daemon.backends.dji.gimbals import DjiGimbal
from ual_daemon.backends.dji.session import DjiSession
from ual_daemon.backends.dji.settings import SECTION, DjiSettings
from ual_daemon.backends.dji.telemetry import LINK_S, DjiTelemetry
from ual_daemon.backends.dji.wrappers import DjiCall, Wrapper
from ual_daemon.backends.engine.backend import EngineBackend
from ual_daemon.backends.engine.command import FLYING, Command
from ual_daemon.backends.engine.command_entrance import CommandEntrance
from ual_daemon.backends.engine.contained import ErrorBarrier
from ual_daemon.backends.engine.loop import Loop
from ual_daemon.backends.offers.cameras import Viewpoint
from ual_daemon.backends.offers.gimbals import OneGimbal
from ual_daemon.backends.rosbridge import DEFAULT_URL, Message, RosbridgeLink, parse_url
from ual_daemon.backends.values import (
    Freshness,
    PositionSetpoint,
    Setpoint,
    SetpointLoss,
    Takes,
    VehicleInfo,
    VelocityGains,
    VelocityResponse,
    VelocityResponses,
)
from ual_daemon.settings import convert

_log = logging.getLogger(__name__)

_RELEASE_S = 1.0
"""Seconds for which the end of the backend waits for the release of the control authority."""
_LIMITS = Limits(
    horizontal_speed_m_s=10.0,
    climb_speed_m_s=3.0,
    descent_speed_m_s=2.0,
    horizontal_acceleration_m_s2=2.0,
    vertical_acceleration_m_s2=1.5,
    yaw_rate_rad_s=1.0,
)
_CAPABILITIES = frozenset(
    {
        Capability.ARM,
        Capability.TAKE_OFF,
        Capability.LAND,
        Capability.POSITION,
        Capability.VELOCITY,
        Capability.GEO,
        Capability.RECOVER,
    }
)
_UNFLOWN = "the dji backend has flown a simulated aircraft only: see its check list for the first flight"


class DjiBackend(EngineBackend[DjiRequest]):
    """One aircraft."""

    name = SECTION
    clock: MonotonicClock
    _loop: Loop
    # The wrappers send some of this once a second, unless they are configured to send it more often.
    freshness = Freshness(link_s=LINK_S, pose_s=1.0, mode_s=2.5, landed_s=2.5, estimator_s=3.0)

    def __init__(self, options: BackendOptions) -> None:
        super().__init__(options)
        self._settings = convert(options.settings, DjiSettings, SECTION)
        self._url = parse_url(options.url or DEFAULT_URL)
        self.clock = MonotonicClock()
        self._link = self._make_link()
        self._session = DjiSession(self._link, self.clock, self._settings)
        self._loop = Loop(self._session, self.clock, self._session.watch)
        self._entrance = CommandEntrance(self._loop, self.clock, self._session.require_runner)
        self._info: tuple[DjiTelemetry | None, VehicleInfo | None] = (None, None)
        around = Surroundings(
            self._link.call_slow_service,
            self._viewpoint,
            self.clock.now_s,
            self.utc_s,
            self._why_no_camera,
            lambda: self._session.watch.why_silent(self.clock.now_s()),
        )
        self._cameras = DjiCameras(around)
        self._gimbal = DjiGimbal(around, self._link.publish, self._heading_rad)
        self._offers = (self._cameras, OneGimbal(self._gimbal))
        self._session.on_payload = self._on_payload
        self._contained = ErrorBarrier("the cameras"), ErrorBarrier("the gimbal")

    def _make_link(self) -> RosbridgeLink:
        return RosbridgeLink(self._url, self.clock, self._step, on_woke=self._woke)

    # --- The backend --------------------------------------------------------------------------------------------------

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._loop.on_update = on_update
        self._loop.restart(self.clock.now_s())
        self._link.open()

    @override
    def close(self) -> None:
        """Releases the control authority if it was obtained here and was not lost since, and ends the link."""
        telemetry = self._session.telemetry
        if telemetry is not None and self._session.holding.is_held:
            self._release(telemetry.wrapper.release)
        self._link.close()
        self._loop.end()

    def _release(self, call: DjiCall) -> None:
        answer = self._link.call_service(call.service, call.arguments, _RELEASE_S)
        try:
            answer.result(_RELEASE_S)
        except Exception as error:  # noqa: BLE001  the aircraft hovers without setpoints, too
            logs.event(_log, logging.WARNING, "authority_not_released", why=str(error) or repr(error))

    @override
    def info(self) -> VehicleInfo:
        telemetry = self._session.telemetry
        made_for, info = self._info
        if info is None or made_for is not telemetry:  # each setpoint asks three times
            info = self._make_info(telemetry)
            self._info = (telemetry, info)
        return info

    def _make_info(self, telemetry: DjiTelemetry | None) -> VehicleInfo:
        return VehicleInfo(
            autopilot="DJI" if telemetry is None else f"DJI through {telemetry.wrapper.name}",
            capabilities=_CAPABILITIES,
            limits=_LIMITS,
            flies_takeoff_on_setpoints=False,
            flies_landing_on_setpoints=telemetry is not None and telemetry.wrapper.land is None,
            takes=Takes.VELOCITY,
            velocity_gains=VelocityGains(response_s=self._settings.response_s),
            velocity_responses=VelocityResponses(
                VelocityResponse(self._settings.response_s), VelocityResponse(self._settings.response_s)
            ),
            setpoint_loss=SetpointLoss.HOLDS,
            limitation=_UNFLOWN,
        )

    @override
    def send(self, setpoint: Setpoint) -> None:
        assert not isinstance(setpoint, PositionSetpoint)  # VehicleInfo.takes
        self._session.send(setpoint)

    @override
    def arm(self) -> Future[None]:
        return self._with_authority("arm", lambda wrapper, grant: request("arm", wrapper.motors_on, grant=grant))

    @override
    def disarm(self) -> Future[None]:
        if not self._is_on_ground:
            return futures.refused("Disarm: not on the ground")
        return self._with_authority("disarm", lambda wrapper, grant: request("disarm", wrapper.motors_off, grant=grant))

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        del height_m, limits  # it climbs to 1.2 m by itself, and UAL's setpoints fly the rest
        return self._with_authority(
            "take off", lambda wrapper, grant: request("take off", wrapper.take_off, grant=grant)
        )

    @override
    def land(self, limits: Limits) -> Future[None]:
        del limits  # DJI's own landing takes no speed
        telemetry = self._session.telemetry
        if telemetry is not None and telemetry.wrapper.land is None:
            return futures.refused(
                "Land: this wrapper's own landing blocks it (VehicleInfo.flies_landing_on_setpoints)"
            )
        return self._order("land", self._landing)

    def _landing(self) -> Command[DjiRequest]:
        telemetry = self._session.telemetry
        assert telemetry is not None
        assert telemetry.wrapper.land is not None  # `land` has looked
        return landing(telemetry.wrapper.land, self._session.begin_landing)

    @override
    def disarm_landed(self) -> Future[None]:
        telemetry = self._session.telemetry
        if telemetry is None or not self._is_on_ground:
            return futures.refused("Disarm: not on the ground")
        why_lost = telemetry.why_authority_lost
        if why_lost:
            return futures.refused(f"Disarm: others have taken it over ({why_lost}), and its motors are theirs to stop")
        return self._order("disarm", lambda: request("stop its motors", telemetry.wrapper.motors_off))

    @override
    def take_control(self) -> Future[None]:
        return self._with_authority("take control", None, is_known=False)

    @override
    def hold(self) -> Future[None]:
        return self._order("hold", lambda: self._session.release(FLYING))

    def _with_authority(
        self, what: str, command: Callable[[Wrapper, Grant], Command[DjiRequest]] | None, *, is_known: bool = True
    ) -> Future[None]:
        grant, session = Grant(), self._session

        def make() -> Command[DjiRequest]:
            if command is None:
                session.end_landing()
            return session.with_authority(grant, command, is_known=is_known)

        result = self._order(what, make)
        result.add_done_callback(partial(session.let_go, grant))
        return result

    @property
    def _is_on_ground(self) -> bool:
        telemetry = self._session.telemetry
        return telemetry is not None and telemetry.is_on_ground

    # --- The link's thread --------------------------------------------------------------------------------------------

    def _woke(self) -> float:
        return self._loop.woke(self.clock.now_s())

    def _step(self) -> None:
        has_news, self._session.has_news = self._session.has_news, False
        now_s = self.clock.now_s()
        self._loop.step(now_s, has_news=has_news)
        of_cameras, of_gimbal = self._contained
        of_cameras.call(self._step_cameras, now_s, has_news=has_news)
        of_gimbal.call(self._gimbal.tick)

    def _step_cameras(self, now_s: float, *, has_news: bool) -> None:
        self._cameras.tick(now_s)
        pose = self._loop.newest.motion.pose
        if has_news and pose is not None:
            self._cameras.step(pose.value.position)

    def _on_payload(self, handler: str, message: Message, now_s: float) -> None:
        getattr(self._gimbal, handler)(message, now_s)

    def _heading_rad(self) -> float | None:
        pose = self._loop.newest.motion.pose
        return None if pose is None else pose.value.yaw_rad

    def _why_no_camera(self) -> str:
        telemetry = self._session.telemetry
        if telemetry is None or not self._link.is_up:
            return self._session.why_no_vehicle or "the wrapper was not found yet"
        return "" if telemetry.wrapper.has_cameras else f"{telemetry.wrapper.name} has no cameras for UAL"

    def _viewpoint(self) -> Viewpoint:
        """Returns from where a picture is taken now."""
        snapshot = self.snapshot()
        pose = snapshot.motion.pose
        is_fresh = pose is not None and snapshot.time_s - pose.time_s <= self.freshness.pose_s
        if pose is None or not is_fresh:
            return Viewpoint(boots_count=snapshot.link.boots_count)
        return Viewpoint(pose.value, snapshot.link.boots_count, None, snapshot.position_geo())
