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
from ual_daemon.backends.dji.authority import Holding
from ual_daemon.backends.dji.commands import Commands
from ual_daemon.backends.dji.discovery import Discovery
from ual_daemon.backends.dji.landing import LandingRequest
from ual_daemon.backends.dji.settings import SECTION, DjiSettings
from ual_daemon.backends.dji.telemetry import LINK_S, Telemetry
from ual_daemon.backends.dji.wrappers import JOY, Call, OsdkVehicleNode, Topic, Wrapper
from ual_daemon.backends.engine.scheduling_gap import SchedulingGap
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
    VelocityResponse,
    VelocityResponses,
)
from ual_daemon.settings import convert

_log = logging.getLogger(__name__)

_Choose = Callable[[Wrapper], tuple[Call, ...]]

_UPDATE_S = 0.05
_BLIND_S, _CATCH_UP_S = 0.2, 0.1
"""After this thread has not run for so long, it takes so long to read what waited. No setpoint leaves meanwhile."""
_SILENCE_S = 3.0
_MOST_MISSING = 3
"""More topics are not named at once."""
_HEARD_S = 0.5
"""Nothing is called in a longer silence. The wrappers send the attitude 50 times a second or more, and their slowest
position ten times: at least five messages of each are lost then."""
_CONFIRM_AGAIN_S = 1.0
_LONGEST_GAP_S = 10.0
"""After a longer silence the aircraft's own landing may be that of others."""
_GIVEN_UP = "the landing was given up, as nothing was heard for a while and others may fly; land it, or let the pilot"
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
    freshness = Freshness(link_s=LINK_S, pose_s=1.0, mode_s=2.5, landed_s=2.5, estimator_s=3.0)

    def __init__(self, options: BackendOptions) -> None:
        super().__init__(options)
        self._settings = convert(options.settings, DjiSettings, SECTION)
        self._url = parse_url(options.url or DEFAULT_URL)
        self.clock = MonotonicClock()
        self._link = self._make_link()
        self._discovery = Discovery(self._link)
        self._commands = Commands(self._link, self.clock, self._words, self._why_silent, self._tell)
        self._telemetry: Telemetry | None = None
        self._info: tuple[Telemetry | None, VehicleInfo | None] = (None, None)
        self._on_update: UpdateCallback | None = None
        self._poses_count = 0
        self._scheduling_gap = SchedulingGap()
        self._stepped_s = self._read_s = self._late_s = float("-inf")
        self._updated_s = self._confirmed_s = float("-inf")
        self._holding = Holding()
        self._had_authority = False
        self._ended_landings_count = self._discards_count = 0
        self._landing: LandingRequest | None = None
        self._joystick: Future[Message] | None = None
        self._landing_call: Future[None] | None = None
        """The newest confirmation of a landing."""
        self._braked = ""
        self._opened_s = 0.0

    def _make_link(self) -> RosbridgeLink:
        return RosbridgeLink(self._url, self.clock, self._step)

    # --- The backend --------------------------------------------------------------------------------------------------

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._on_update = on_update
        self._opened_s = self.clock.now_s()
        self._link.open()

    @override
    def close(self) -> None:
        """Releases the control authority if it was obtained here and was not lost since, and ends the link."""
        telemetry = self._telemetry
        if telemetry is not None and self._holding.is_held:
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
        made_for, info = self._info
        if info is None or made_for is not telemetry:  # each setpoint asks three times
            info = self._make_info(telemetry)
            self._info = (telemetry, info)
        return info

    def _make_info(self, telemetry: Telemetry | None) -> VehicleInfo:
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
    def snapshot(self) -> Snapshot:
        now_s = self.clock.now_s()
        telemetry = self._telemetry
        if telemetry is None:
            why = self._why_no_vehicle()
            return Snapshot(now_s, status_text=why, link_trouble=why, updated_s=max(self._opened_s, self._stepped_s))
        snapshot = telemetry.snapshot(now_s, self._missing(telemetry, now_s))
        snapshot = snapshot._replace(
            updated_s=max(self._opened_s, self._read_s), scheduling_gap=self._scheduling_gap.why(now_s)
        )
        why = self._link.why_not
        return snapshot if self._link.is_up else snapshot._replace(status_text=why, link_trouble=why)

    def _missing(self, telemetry: Telemetry, now_s: float) -> str:
        """Returns which topics do not come without which it cannot be flown, for people; empty if they come."""
        missing = telemetry.missing_topics(now_s)
        return "; ".join(self._fault(topic) for topic in missing[:_MOST_MISSING])

    def _fault(self, topic: Topic) -> str:
        name = self._url.resolve(topic.name)
        known = (fault for fault in self._link.faults() if name in fault.split())
        return next(known, f"nothing comes on {name}")

    def _why_no_vehicle(self) -> str:
        if self._link.state is not LinkState.UP:
            return self._link.why_not
        return self._discovery.why_not

    @override
    def send(self, setpoint: Setpoint) -> None:
        telemetry = self._telemetry
        if telemetry is None or not telemetry.has_authority or not self._link.is_up or self._commands.is_blocked:
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
        return self._with_authority(lambda wrapper: (wrapper.motors_on,))

    @override
    def disarm(self) -> Future[None]:
        telemetry = self._telemetry
        if telemetry is None or not telemetry.is_on_ground:
            return _refusal("Disarm: not on the ground")
        return self._with_authority(lambda wrapper: (wrapper.motors_off,))

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        del height_m, limits  # it climbs to 1.2 m by itself, and UAL's setpoints fly the rest
        return self._with_authority(lambda wrapper: (wrapper.take_off,))

    @override
    def land(self, limits: Limits) -> Future[None]:
        telemetry = self._telemetry
        if telemetry is not None and telemetry.wrapper.land is None:
            return _refusal("Land: this wrapper's own landing blocks it (VehicleInfo.flies_landing_on_setpoints)")
        # DJI's own landing takes no speed.
        landing = self._run(lambda wrapper: () if wrapper.land is None else (wrapper.land,))
        landing.add_done_callback(partial(self._landing_answered, self._ended_landings_count))
        return landing

    def _landing_answered(self, ended_count: int, answer: Future[None]) -> None:
        """Takes a landing that was accepted. Where it was refused, one that is under way goes on."""
        is_accepted = not answer.cancelled() and answer.exception() is None
        if is_accepted and self._ended_landings_count == ended_count:
            self._landing = LandingRequest(self.clock.now_s())

    @override
    def disarm_landed(self) -> Future[None]:
        telemetry = self._telemetry
        if telemetry is None or not telemetry.is_on_ground:
            return _refusal("Disarm: not on the ground")
        if telemetry.is_authority_lost:
            return _refusal("Disarm: others have taken it over, and its motors are theirs to stop")
        return self._run(lambda wrapper: (wrapper.motors_off,))

    def _end_landing(self) -> None:
        """Forgets a landing that was asked for: it is not confirmed any more."""
        self._ended_landings_count += 1
        self._landing = None
        self._withdraw_landing_call()

    def _withdraw_landing_call(self) -> None:
        """Withdraws the confirmation that may wait."""
        if self._landing_call is not None:
            self._landing_call.cancel()

    @override
    def take_control(self) -> Future[None]:
        self._end_landing()
        return self._with_authority(lambda _: (), is_known=False)

    @override
    def hold(self) -> Future[None]:
        self._end_landing()
        telemetry = self._telemetry
        if telemetry is not None:
            telemetry.note_released()
        if telemetry is None or not self._link.is_up:
            return futures.failed(LinkLostError(self._why_no_vehicle()))
        telemetry.words = ""
        released = self._commands.release(telemetry.wrapper.release)
        released.add_done_callback(self._released)
        return released

    def _released(self, answer: Future[None]) -> None:
        if not answer.cancelled() and answer.exception() is None:
            self._holding.drop()

    def _run(self, choose: _Choose) -> Future[None]:
        telemetry, why = self._telemetry, self._why_unreachable()
        if telemetry is None or why:
            return futures.failed(LinkLostError(why))
        telemetry.words = ""
        return self._commands.run(choose(telemetry.wrapper))

    def _with_authority(self, choose: _Choose, *, is_known: bool = True) -> Future[None]:
        """Obtains the control authority first, unless it `is_known` to be ours: DJI starts nothing without it."""
        telemetry = self._telemetry
        if (
            telemetry is None
            or self._why_unreachable()
            or (is_known and telemetry.wrapper.says_authority and telemetry.has_authority)
        ):
            return self._run(choose)
        telemetry.words = ""
        self._holding.ask(self.clock.now_s())
        calls = (*telemetry.wrapper.obtain, *choose(telemetry.wrapper))
        result = self._commands.run(calls, partial(self._obtained, telemetry))
        result.add_done_callback(partial(self._let_go, telemetry))
        return result

    def _obtained(self, telemetry: Telemetry, call: Call) -> None:
        """Notes which of the services that obtain the control authority were executed."""
        obtain = telemetry.wrapper.obtain
        if call is obtain[0]:
            self._holding.is_granted = True
        if call is obtain[-1]:
            telemetry.note_granted(self._holding.asked_s, self.clock.now_s())

    def _let_go(self, telemetry: Telemetry, result: Future[None]) -> None:
        """Releases the control authority where the rest of the command was refused, or not called in a silence."""
        error = None if result.cancelled() else result.exception()
        was_granted = self._holding.is_granted
        if not isinstance(error, RejectedByAutopilotError) and not (was_granted and isinstance(error, LinkLostError)):
            return
        self._holding.drop()
        if was_granted:
            telemetry.note_released()
            self._commands.release(telemetry.wrapper.release).add_done_callback(_log_refusal)

    def _words(self) -> str:
        telemetry = self._telemetry
        if telemetry is None:
            return ""
        return "; ".join(filter(None, (telemetry.words, telemetry.why_not_start, telemetry.wrapper.reasons)))

    def _why_unreachable(self) -> str:
        """Returns why nothing can be commanded now, for people; empty if it can."""
        if self._telemetry is None or not self._link.is_up:
            return self._why_no_vehicle()
        return self._why_silent()

    def _why_silent(self) -> str:
        """Returns why the aircraft counts as not heard now, for people; empty while it is heard."""
        telemetry = self._telemetry
        silent_s = float("inf") if telemetry is None else telemetry.silent_s(self.clock.now_s())
        if silent_s <= _HEARD_S:
            return ""
        return f"nothing was heard of the aircraft {f'for {silent_s:.1f} s' if silent_s < float('inf') else 'yet'}"

    def _tell(self, words: str) -> None:
        logs.event(_log, logging.WARNING, "call_open", why=words)
        if self._telemetry is not None:
            self._telemetry.say(words, self.clock.now_s())

    # --- The link's thread --------------------------------------------------------------------------------------------

    def _step(self) -> None:
        now_s = self.clock.now_s()
        self._watch_pause(now_s)
        self._commands.tick(now_s)
        if self._telemetry is None and self._link.is_up:
            self._discover(now_s)
        telemetry = self._telemetry
        if telemetry is not None:
            if telemetry.is_authority_known:
                self._holding.observe(now_s, is_ours=not telemetry.is_authority_lost)
            self._withdraw_setpoint(telemetry)
            if telemetry.discards_count != self._discards_count:
                self._discards_count = telemetry.discards_count
                self._give_up_landing(telemetry, now_s)
            if self._read_s == now_s:
                self._confirm_landing(telemetry, now_s)
        poses_count = 0 if telemetry is None else telemetry.poses_count
        if poses_count != self._poses_count or now_s - self._updated_s >= _UPDATE_S:
            self._poses_count, self._updated_s = poses_count, now_s
            self._update()

    def _withdraw_setpoint(self, telemetry: Telemetry) -> None:
        """Withdraws the setpoint that may wait in a full socket, once the authority is lost."""
        had_authority, self._had_authority = self._had_authority, telemetry.has_authority
        if not had_authority or self._had_authority:
            return
        if telemetry.wrapper.setpoint_topic:
            self._link.withdraw(telemetry.wrapper.setpoint_topic)
        elif self._joystick is not None:
            self._joystick.cancel()

    def _watch_pause(self, now_s: float) -> None:
        """Notes when this thread has read what came. What it finds after a pause is old, and so is what it knows."""
        pause_s = self._scheduling_gap.woke(now_s, self.freshness.link_s)
        if pause_s and self._telemetry is not None:
            logs.event(_log, logging.WARNING, "thread_paused", pause_s=round(pause_s, 1))
            self._telemetry.discard_state(pause_s)
        if now_s - self._stepped_s > _BLIND_S:
            self._late_s = now_s + _CATCH_UP_S
        self._stepped_s = now_s
        if now_s >= self._late_s:
            self._read_s = now_s

    def _discover(self, now_s: float) -> None:
        wrapper = self._discovery.find(now_s)
        if wrapper is not None:
            telemetry = Telemetry(wrapper, self._settings)
            self._subscribe(wrapper, telemetry)  # raises OSError where the connection breaks: it is found anew then
            self._telemetry = telemetry

    def _update(self) -> None:
        if self._on_update is None:
            return
        try:
            self._on_update(self.snapshot())
        except Exception:  # noqa: BLE001 - a defect of the layers above must not end the exchange with the aircraft
            _log.exception("an update failed")

    def _subscribe(self, wrapper: Wrapper, telemetry: Telemetry) -> None:
        for topic in wrapper.topics:
            is_log = topic.name == "/rosout"
            self._link.subscribe(
                topic.name,
                topic.kind,
                # Every node logs there: that is no sign of life of the aircraft.
                telemetry.take_log if is_log else partial(telemetry.take, topic.taken_by),
                queue_length=10 if is_log else 1,
                silence_s=float("inf") if is_log else _SILENCE_S,
            )
        if wrapper.setpoint_topic:
            self._link.advertise(wrapper.setpoint_topic, JOY)

    def _give_up_landing(self, telemetry: Telemetry, now_s: float) -> None:
        """Ends a landing, once the flight may have become another's unseen.

        The landing goes on in a silence, and waits above the ground for its confirmation. If the mode and the authority
        still are those of our landing after a short silence, it is confirmed: within that time nobody takes over, hands
        over to another program, and lands with it. After a long one it waits for the pilot.
        """
        request = self._landing
        if request is not None and not request.has_ended and telemetry.blind_s > _LONGEST_GAP_S:
            self._end_landing()
            telemetry.say(_GIVEN_UP, now_s)
            logs.event(_log, logging.WARNING, "landing_given_up", why=_GIVEN_UP)

    def _confirm_landing(self, telemetry: Telemetry, now_s: float) -> None:
        """Confirms a landing that was asked for: near the ground the aircraft waits for that."""
        request, call = self._landing, telemetry.wrapper.confirm_landing
        if request is None:
            return
        is_needed = request.needs_confirmation(telemetry, self._settings.confirm_landing_below_m, now_s)
        if is_needed and call is not None and now_s - self._confirmed_s >= _CONFIRM_AGAIN_S:
            self._confirmed_s = now_s
            self._landing_call = self._commands.run((call,))
            self._landing_call.add_done_callback(_log_refusal)
        if request.has_ended:
            self._withdraw_landing_call()


def _log_refusal(answer: Future[None]) -> None:
    """Logs what was refused of what nobody waits for."""
    error = None if answer.cancelled() else answer.exception()
    if error is not None:
        logs.event(_log, logging.WARNING, "not_executed", why=str(error))


def _refusal(words: str) -> Future[None]:
    return futures.failed(RejectedByAutopilotError(f"refused: {words}", {"text": words}))
