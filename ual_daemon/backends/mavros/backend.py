"""The backend: commands go to the link's thread, setpoints leave from the caller's thread."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from typing_extensions import override

from ual.errors import LinkLostError
from ual.types import GeoPoint, Limits
from ual_daemon.backends import futures
from ual_daemon.backends.base import BackendOptions, SafetyPilot, UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.engine.backend import EngineBackend
from ual_daemon.backends.engine.command import Command
from ual_daemon.backends.engine.command_entrance import CommandEntrance
from ual_daemon.backends.engine.command_runner import CommandRunner
from ual_daemon.backends.engine.contained import ErrorBarrier
from ual_daemon.backends.engine.loop import Loop, Posted
from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.firmwares.listed_fence import KnownAutopilot, ListedFence
from ual_daemon.backends.firmwares.listed_missions import ListedMissions, MissionAccess, ReceivedMission
from ual_daemon.backends.firmwares.safety_pilot import LinkPilot
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.firmwares.triggered_photos import viewpoint_of
from ual_daemon.backends.mavros import commands, topics
from ual_daemon.backends.mavros.commands import MavrosCall
from ual_daemon.backends.mavros.corrections import MavrosCorrections
from ual_daemon.backends.mavros.discovery import MavrosDiscovery
from ual_daemon.backends.mavros.offers.cameras import CameraServices, MavrosCameras
from ual_daemon.backends.mavros.offers.gimbals import MavrosGimbal
from ual_daemon.backends.mavros.offers.gripper import MavrosGripper
from ual_daemon.backends.mavros.offers.lists import MavrosLists
from ual_daemon.backends.mavros.offers.parameters import MavrosParameters
from ual_daemon.backends.mavros.offers.services import MavrosAccess, Services
from ual_daemon.backends.mavros.session import FRESHNESS, MavrosSession
from ual_daemon.backends.mavros.settings import SECTION, MavrosSettings
from ual_daemon.backends.offers.gimbals import OneGimbal
from ual_daemon.backends.rosbridge import DEFAULT_URL, Message, RosbridgeLink, RosGeneration, parse_url
from ual_daemon.backends.values import Setpoint, Snapshot, VehicleInfo
from ual_daemon.settings import convert


class MavrosBackend(EngineBackend[MavrosCall]):
    """Flies a PX4 or an ArduCopter through MAVROS. See ``docs/reference/backends/mavros.md``."""

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
        self._link: RosbridgeLink | None = None
        self._discovery: MavrosDiscovery | None = None
        self._on_update: UpdateCallback = lambda _: None
        self._info = VehicleInfo()
        self._has_news = False
        self._corrections = self._make_corrections(f"{self._settings.node}/{topics.RTCM}")
        access = MavrosAccess(
            self._last_session, self._reached, self._give_future, self._call_slowly, self._ros, self._node
        )
        self._services = Services(access), Services(access)
        self._cameras = MavrosCameras(self._camera_means(), is_there=self._settings.has_camera_trigger)
        services: tuple[MavrosCorrections | MavrosCameras | Services, ...] = (
            self._corrections,
            self._cameras,
            *self._services,
        )
        self._payload_services = [(ErrorBarrier(type(each).__name__), each) for each in services]
        self._parameters = MavrosParameters(self._services[0])
        lists = MavrosLists(self._services[1])
        gripper = MavrosGripper(self._last_session, self._give, self._post)
        self._offers = (
            self._corrections,
            self._parameters,
            gripper,
            self._cameras,
            OneGimbal(MavrosGimbal(access, self._give, self._now_s)),
            ListedFence(lists, self._known),
            ListedMissions(self._mission_access(lists)),
        )

    def _camera_means(self) -> CameraServices:
        def why_not(what: str) -> LinkLostError | None:
            reached = self._reached(what)
            return reached if isinstance(reached, LinkLostError) else None

        def tells_photos() -> bool:
            session = self._last_session()
            return session is not None and session.autopilot.sends_image_captured

        def boots_count() -> int:
            session = self._last_session()
            return 0 if session is None else session.telemetry.boots_count

        return CameraServices(
            lambda order: self._give(order.what, commands.move(order)),
            lambda act: self._post(lambda _: act()),
            self._give_future,
            why_not,
            self.snapshot,
            lambda: viewpoint_of(self.snapshot(), self.freshness),
            self.utc_s,
            tells_photos,
            boots_count,
        )

    def _make_corrections(self, topic: str) -> MavrosCorrections:
        def publish(message: Message) -> None:
            if self._link is not None:
                self._link.publish(topic, message)

        return MavrosCorrections(
            publish,
            lambda: self._link is not None and self._link.waits(topic),
            self._why_no_corrections,
            self._post,
            self.clock.now_s,
        )

    def _why_no_corrections(self) -> str:
        is_connected = self._connected_session(self.clock.now_s()) is not None
        return "" if is_connected else self._unreached("send corrections").message

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._on_update = on_update
        link = self._link = self._make_link()
        link.advertise(self._setpoint_topic, topics.SETPOINT_TYPE)
        link.advertise(f"{self._settings.node}/{topics.RTCM}", topics.RTCM_TYPE)
        discovery = self._discovery = MavrosDiscovery(link, self._settings, self._sent, self._on_message, self.utc_s)
        self._loop = Loop(discovery, self.clock, discovery.watch, self._update)
        self._entrance = CommandEntrance(self._loop, self.clock, self._require_runner)
        link.open()

    def _make_link(self) -> RosbridgeLink:
        return RosbridgeLink(self.url, self.clock, self._step, on_woke=self._woke)

    @override
    def close(self) -> None:
        if self._link is not None:
            self._link.close()
        if self._loop is not None:
            self._loop.end()

    @override
    def info(self) -> VehicleInfo:
        return self._info

    @override
    def send(self, setpoint: Setpoint) -> None:
        now_s = self.clock.now_s()
        link, session = self._link, self._connected_session(now_s)
        if link is None or session is None:
            return
        setpoint, message = session.encode(setpoint, now_s)
        link.publish(self._setpoint_topic, message)
        self._sent.on_sent(now_s, setpoint)

    @override
    def arm(self) -> Future[None]:
        return self._command(
            "arm", lambda session: commands.arming(session.autopilot, session.snapshot(self.clock.now_s()))
        )

    @override
    def disarm(self) -> Future[None]:
        return self._command("disarm", lambda _: commands.arm_or_disarm(is_arming=False))

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        is_slower = limits.climb_speed_m_s < self.info().limits.climb_speed_m_s

        def make(session: MavrosSession) -> Command[MavrosCall]:
            snapshot = session.snapshot(self.clock.now_s())
            altitude_m = session.autopilot.takeoff_altitude_m(height_m, snapshot, is_slower=is_slower)
            return commands.taking_off(session.autopilot, altitude_m)

        return self._command("take off", make)

    @override
    def land(self, limits: Limits) -> Future[None]:
        del limits  # the autopilots' landings take no speed: MPC_LAND_SPEED, LAND_SPEED
        return self._command("land", lambda session: commands.set_mode(session.autopilot.land_mode, "land"))

    @override
    def take_control(self) -> Future[None]:
        def make(session: MavrosSession) -> Command[MavrosCall]:
            autopilot = session.autopilot
            return commands.set_mode(autopilot.setpoint_mode, "take control", autopilot.setpoints_before_mode_s)

        return self._command("take control", make)

    @override
    def hold(self) -> Future[None]:
        return self._command("hold", lambda session: commands.set_mode(session.autopilot.hold_mode, "hold"))

    @override
    def utc_s(self) -> float:
        return self.clock.utc_s()

    @override
    def safety_pilot(self) -> SafetyPilot | None:
        return LinkPilot(lambda: self._connected_session(self.clock.now_s()), self.arm)

    # --- On the link's thread -----------------------------------------------------------------------------------------

    def _woke(self) -> float:
        return 0.0 if self._loop is None else self._loop.woke(self.clock.now_s())

    def _step(self) -> None:
        """Does what is due: after each batch of messages, and at least every 0.1 s."""
        has_news, self._has_news = self._has_news, False
        session = self._last_session()
        if session is not None:
            session.reads_parameters = not self._parameters.is_pulling
        if self._loop is not None:
            now_s = self.clock.now_s()
            self._loop.step(now_s, has_news=has_news)
            for contained, each in self._payload_services:
                contained.call(each.tick, now_s)

    def _on_message(self, session: MavrosSession, topic: str, message: Message, now_s: float) -> None:
        """Takes a message of MAVROS for the session; one with a field that is missing is logged by the link."""
        was_ours, mode_name = session.takes_setpoints, session.telemetry.mode_name
        session.on_message(topic, message, now_s)
        if was_ours and not session.takes_setpoints and self._link is not None:
            self._link.withdraw(self._setpoint_topic)  # the safety pilot has taken over: one may wait in a full socket
        if self._loop is not None and session.telemetry.mode_name != mode_name:
            self._loop.publish(now_s)  # before the next message: a pilot may take over just then
        photo = session.telemetry.photo(message) if topic == topics.CAPTURED else None
        if photo is not None:
            self._cameras.trigger.on_report(*photo)
        self._has_news = self._has_news or topic == topics.POSE

    def _update(self, snapshot: Snapshot) -> None:
        discovery = self._discovery
        assert discovery is not None
        session = discovery.session
        info = discovery.info if session is None else session.info()
        self._info = self._info if info == self._info else info
        if session is not None:
            self.freshness = session.freshness
            session.telemetry.corrections_age_s = self._corrections.age_s(snapshot.time_s)
        self._on_update(snapshot)

    def _command(self, what: str, make: Callable[[MavrosSession], Command[MavrosCall]]) -> Future[None]:
        """Passes a command to the link's thread; its future ends there."""

        def make_now() -> Command[MavrosCall]:
            session = None if self._discovery is None else self._discovery.session
            if session is None:  # it was in reach a moment ago
                raise self._unreached(what)
            return make(session)

        return self._order(what, make_now)

    def _give(self, what: str, command: Command[MavrosCall]) -> Future[None]:
        return self._command(what, lambda _: command)

    def _require_runner(self, what: str) -> CommandRunner[MavrosCall] | LinkLostError:
        session = self._connected_session(self.clock.now_s())
        return self._unreached(what) if session is None else session.runner

    # --- For what is offered besides flying ---------------------------------------------------------------------------

    def _now_s(self) -> float:
        return self.clock.now_s()

    def _last_session(self) -> MavrosSession | None:
        return None if self._discovery is None else self._discovery.session

    def _known(self) -> KnownAutopilot | None:
        session = self._last_session()
        return None if session is None else KnownAutopilot(session.autopilot, session.telemetry.parameters)

    def _mission_access(self, lists: MavrosLists) -> MissionAccess:
        def autopilot() -> Autopilot | None:
            session = self._last_session()
            return None if session is None else session.autopilot

        def received_mission() -> ReceivedMission | None:
            session = self._last_session()
            return None if session is None else session.telemetry.missions.heard

        def fly() -> Future[None]:
            return self._command("fly the mission", lambda session: commands.fly_mission(session.autopilot))

        def here() -> GeoPoint | None:
            return self.snapshot().motion.position_geo

        return MissionAccess(lists, autopilot, received_mission, lists.choose, fly, self._parameters.read, here)

    def _reached(self, what: str) -> MavrosSession | LinkLostError:
        return self._connected_session(self.clock.now_s()) or self._unreached(what)

    def _post(self, request: Posted) -> None:
        if self._loop is not None:
            self._loop.post(request)

    def _give_future(self, what: str, begin: Callable[[Future[Any]], None]) -> Future[Any]:
        """Returns a future that `begin` has something end on the link's thread."""
        if self._loop is None:
            return futures.failed(self._unreached(what))
        return self._loop.run_on_loop(what, lambda future, _: begin(future))

    def _call_slowly(self, service: str, arguments: Message, limit_s: float) -> Future[Message]:
        assert self._link is not None  # a session is in reach
        name = service if service.startswith("/") else f"{self._settings.node}/{service}"
        return self._link.call_slow_service(name, arguments, limit_s)

    def _ros(self) -> RosGeneration | None:
        graph = None if self._link is None else self._link.graph
        return None if graph is None else graph.ros

    def _node(self) -> str:
        return self.url.resolve(self._settings.node)

    @override
    def _unreached(self, what: str) -> LinkLostError:
        why = "" if self._discovery is None else self._discovery.why_not
        return LinkLostError(f"cannot {what}: {why or f'no autopilot is heard at {self.url}'}")

    def _connected_session(self, now_s: float) -> MavrosSession | None:
        """The session with the autopilot while MAVROS passes on what it sends, else None. From any thread."""
        discovery, link = self._discovery, self._link
        session = None if discovery is None else discovery.session
        if discovery is None or session is None or link is None or not link.is_up:
            return None
        return session if session.telemetry.is_connected and discovery.watch.is_up(now_s) else None
