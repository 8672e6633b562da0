"""DJI's aircraft as a backend."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

from typing_extensions import override

from ual.errors import LinkLostError, RejectedByAutopilotError
from ual.types import Capability, Limits
from ual_daemon import logs
from ual_daemon.backends import futures
from ual_daemon.backends.base import Backend, BackendOptions, UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.dji.commands import Commands
from ual_daemon.backends.dji.discovery import Discovery
from ual_daemon.backends.dji.settings import SECTION, DjiSettings
from ual_daemon.backends.dji.telemetry import Telemetry
from ual_daemon.backends.dji.wrappers import JOY, Call, OsdkVehicleNode, Wrapper
from ual_daemon.backends.rosbridge import DEFAULT_URL, LinkState, Message, RosbridgeLink, parse_url
from ual_daemon.backends.values import (
    Freshness,
    PositionSetpoint,
    Setpoint,
    SetpointLoss,
    Snapshot,
    Takes,
    VehicleInfo,
    VelocityGains,
)
from ual_daemon.settings import convert

_log = logging.getLogger(__name__)

_Choose = Callable[[Wrapper], tuple[Call, ...]]
_Choose1 = Callable[[Wrapper], Call]

_UPDATE_S = 0.05
_SILENCE_S = 3.0
_CONFIRM_AGAIN_S = 1.0
_RELEASE_S = 1.0
"""How long the end of the backend waits for the release of the control authority."""
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


class DjiBackend(Backend):
    """One aircraft."""

    name = SECTION
    clock: MonotonicClock
    # The wrappers send some of this once a second, unless they are told to send it more often.
    freshness = Freshness(link_s=1.0, pose_s=1.0, mode_s=2.5, landed_s=2.5, estimator_s=3.0)

    def __init__(self, options: BackendOptions) -> None:
        super().__init__(options)
        self._settings = convert(options.settings, DjiSettings, SECTION)
        self._url = parse_url(options.url or DEFAULT_URL)
        self.clock = MonotonicClock()
        self._link = self._make_link()
        self._discovery = Discovery(self._link)
        self._commands = Commands(self._link, self._words)
        self._telemetry: Telemetry | None = None
        self._on_update: UpdateCallback | None = None
        self._poses_count = 0
        self._connections_count = 0
        self._updated_s = self._confirmed_s = float("-inf")
        self._is_landing_asked = self._is_obtained = False
        self._joystick: Future[Message] | None = None
        self._braked = ""

    def _make_link(self) -> RosbridgeLink:
        return RosbridgeLink(self._url, self.clock, self._step)

    # --- The backend --------------------------------------------------------------------------------------------------

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._on_update = on_update
        self._link.open()

    @override
    def close(self) -> None:
        """Releases the control authority if it was obtained here and is ours still, and ends the link."""
        telemetry = self._telemetry
        if telemetry is not None and self._is_obtained and telemetry.has_authority:
            self._release(telemetry.wrapper.release)
        self._link.close()

    def _release(self, call: Call) -> None:
        answer = self._link.call_service(call.service, call.arguments, _RELEASE_S)
        try:
            answer.result(_RELEASE_S)
        except Exception as error:  # noqa: BLE001  the aircraft hovers without setpoints, too
            logs.event(_log, logging.WARNING, "authority_not_released", why=str(error) or repr(error))

    @override
    def info(self) -> VehicleInfo:
        telemetry = self._telemetry
        return VehicleInfo(
            autopilot="DJI" if telemetry is None else f"DJI through {telemetry.wrapper.name}",
            capabilities=_CAPABILITIES,
            limits=_LIMITS,
            flies_takeoff_on_setpoints=False,
            takes=Takes.VELOCITY,
            velocity_gains=VelocityGains(response_s=self._settings.response_s),
            setpoint_loss=SetpointLoss.HOLDS,
            limitation=_UNFLOWN,
        )

    @override
    def snapshot(self) -> Snapshot:
        now_s = self.clock.now_s()
        telemetry = self._telemetry
        if telemetry is None:
            return Snapshot(now_s, status_text=self._why_no_vehicle())
        snapshot = telemetry.snapshot(now_s)
        return snapshot if self._link.is_up else snapshot._replace(status_text=self._link.why_not)

    def _why_no_vehicle(self) -> str:
        if self._link.state is not LinkState.UP:
            return self._link.why_not
        return self._discovery.why_not

    @override
    def send(self, setpoint: Setpoint) -> None:
        telemetry = self._telemetry
        if telemetry is None or not self._link.is_up or not telemetry.has_authority:
            return
        assert not isinstance(setpoint, PositionSetpoint)  # VehicleInfo.takes
        message = telemetry.wrapper.setpoint(setpoint)
        if telemetry.wrapper.setpoint_topic:
            self._link.publish(telemetry.wrapper.setpoint_topic, message)
        elif self._joystick is None or self._joystick.done():  # else the next one leaves when this one is answered
            self._joystick = self._link.call_service(OsdkVehicleNode.joystick, message, 0.5)
        braked = telemetry.note_setpoint(setpoint.velocity, self.clock.now_s())
        if braked and not self._braked:
            logs.event(_log, logging.WARNING, "braked", why=braked)
        self._braked = braked

    @override
    def arm(self) -> Future[None]:
        telemetry = self._telemetry
        if telemetry is not None and telemetry.why_not_start:
            return _refusal(telemetry.why_not_start)
        return self._with_authority(lambda wrapper: wrapper.motors_on)

    @override
    def disarm(self) -> Future[None]:
        telemetry = self._telemetry
        if telemetry is None or not telemetry.is_on_ground:
            return _refusal("Disarm: not on the ground")
        return self._with_authority(lambda wrapper: wrapper.motors_off)

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        del height_m, limits  # it climbs to 1.2 m by itself, and UAL's setpoints fly the rest
        return self._with_authority(lambda wrapper: wrapper.take_off)

    @override
    def land(self, limits: Limits) -> Future[None]:
        del limits  # DJI's own landing takes no speed
        self._is_landing_asked = True
        return self._run(lambda wrapper: (wrapper.land,))

    @override
    def take_control(self) -> Future[None]:
        return self._run(lambda wrapper: wrapper.obtain, obtains=True)

    @override
    def hold(self) -> Future[None]:
        telemetry = self._telemetry
        if telemetry is not None:
            telemetry.authority.grant(is_granted=False)
        return self._run(lambda wrapper: (wrapper.release,))

    def _with_authority(self, choose: _Choose1) -> Future[None]:
        """Obtains the control authority first, where it is not known to be ours: DJI starts nothing without it."""
        telemetry = self._telemetry
        if telemetry is not None and telemetry.wrapper.says_authority and telemetry.has_authority:
            return self._run(lambda wrapper: (choose(wrapper),))
        return self._run(lambda wrapper: (*wrapper.obtain, choose(wrapper)), obtains=True)

    def _run(self, choose: _Choose, *, obtains: bool = False) -> Future[None]:
        telemetry = self._telemetry
        if telemetry is None:
            return futures.failed(LinkLostError(self._why_no_vehicle()))
        telemetry.words = ""
        calls = choose(telemetry.wrapper)
        if not obtains:
            return self._commands.run(calls)
        count = len(telemetry.wrapper.obtain)
        whole: Future[None] = Future()
        first = self._commands.run(calls[:count], partial(self._obtained, telemetry))
        first.add_done_callback(lambda done: self._go_on(done, calls[count:], whole))
        return whole

    def _obtained(self, telemetry: Telemetry) -> None:
        self._is_obtained = True
        telemetry.authority.grant(is_granted=True)

    def _go_on(self, done: Future[None], calls: tuple[Call, ...], whole: Future[None]) -> None:
        """Goes on with a command once the authority was obtained."""
        error = done.exception()
        if error is not None:
            futures.end(whole, error)
        elif not calls:
            futures.end(whole)
        elif not whole.cancelled():
            rest = self._commands.run(calls)
            rest.add_done_callback(lambda ended: futures.end(whole, ended.exception()))

    def _words(self) -> str:
        telemetry = self._telemetry
        return "" if telemetry is None else "; ".join(filter(None, (telemetry.words, telemetry.why_not_start)))

    # --- The link's thread --------------------------------------------------------------------------------------------

    def _step(self) -> None:
        now_s = self.clock.now_s()
        if self._telemetry is None and self._link.is_up:
            wrapper = self._discovery.find(now_s)
            if wrapper is not None:
                self._telemetry = Telemetry(wrapper, self._settings)
                self._subscribe(wrapper, self._telemetry)
        telemetry = self._telemetry
        if telemetry is not None:
            self._confirm_landing(telemetry, now_s)
        poses_count = 0 if telemetry is None else telemetry.poses_count
        if (poses_count != self._poses_count or now_s - self._updated_s >= _UPDATE_S) and self._on_update is not None:
            self._poses_count, self._updated_s = poses_count, now_s
            self._on_update(self.snapshot())

    def _subscribe(self, wrapper: Wrapper, telemetry: Telemetry) -> None:
        for topic in wrapper.topics:
            take = partial(telemetry.take, topic.taken_by)
            is_log = topic.name == "/rosout"
            self._link.subscribe(
                topic.name,
                topic.kind,
                take,
                queue_length=10 if is_log else 1,
                silence_s=float("inf") if is_log else _SILENCE_S,
            )
        if wrapper.setpoint_topic:
            self._link.advertise(wrapper.setpoint_topic, JOY)

    def _confirm_landing(self, telemetry: Telemetry, now_s: float) -> None:
        """Confirms a landing that was asked for: near the ground the aircraft waits for that."""
        if telemetry.is_on_ground:
            self._is_landing_asked = False
        call = telemetry.wrapper.confirm_landing
        height_m = telemetry.height_m
        if not self._is_landing_asked or not telemetry.is_landing or call is None or height_m is None:
            return
        if height_m <= self._settings.confirm_landing_below_m and now_s - self._confirmed_s >= _CONFIRM_AGAIN_S:
            self._confirmed_s = now_s
            self._commands.run((call,))


def _refusal(words: str) -> Future[None]:
    return futures.failed(RejectedByAutopilotError(f"refused: {words}", {"text": words}))
