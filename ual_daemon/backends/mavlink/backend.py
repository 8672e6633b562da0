"""The backend: commands go to the thread that receives, setpoints leave from the caller's thread."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial
from typing import TypeVar

from msgspec import structs
from typing_extensions import override

from ual.errors import LinkLostError, RejectedByAutopilotError, UalError
from ual.geometry import Pose, Vector3
from ual.types import Limits
from ual_daemon.backends import futures
from ual_daemon.backends.base import Backend, BackendOptions, SafetyPilot, UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.engine.backend import EngineBackend
from ual_daemon.backends.engine.command_entrance import CommandEntrance
from ual_daemon.backends.firmwares.safety_pilot import LinkPilot
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.firmwares.trigger_camera import TriggerCamera
from ual_daemon.backends.firmwares.triggered_photos import viewpoint_of
from ual_daemon.backends.mavlink.dialects.command_long import CommandLong, LongCommand
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.links import LinkConnection, MavlinkLink, make_link
from ual_daemon.backends.mavlink.links.endpoints import (
    AutopilotAddress,
    SerialEndpoint,
    parse_address,
    vehicle_key,
    vehicle_urls,
)
from ual_daemon.backends.mavlink.offers import derived
from ual_daemon.backends.mavlink.offers.cameras import MavlinkCameras, trigger_order
from ual_daemon.backends.mavlink.offers.corrections import MavlinkCorrections
from ual_daemon.backends.mavlink.offers.gimbals import MavlinkGimbals
from ual_daemon.backends.mavlink.offers.http_pictures import HttpPictures
from ual_daemon.backends.mavlink.offers.lists import MavlinkLists, fence_of, missions_of
from ual_daemon.backends.mavlink.offers.logs import MavlinkLogs
from ual_daemon.backends.mavlink.offers.parameters import MavlinkParameters
from ual_daemon.backends.mavlink.offers.protocol_access import Orders, ProtocolAccess
from ual_daemon.backends.mavlink.packet_tap import PacketTap
from ual_daemon.backends.mavlink.payload import MavlinkPayload
from ual_daemon.backends.mavlink.protocols.camera_link import CameraLink
from ual_daemon.backends.mavlink.protocols.gimbal_link import GimbalLink
from ual_daemon.backends.mavlink.session.discovery import Discovery
from ual_daemon.backends.mavlink.session.payload_messages import PayloadMessages
from ual_daemon.backends.mavlink.session.receive_loop import ReceiveLoop
from ual_daemon.backends.mavlink.session.session import MavlinkSession
from ual_daemon.backends.mavlink.session.supervision import LinkStatistics
from ual_daemon.backends.mavlink.settings import SECTION, MavlinkSettings, default_url
from ual_daemon.backends.mavlink.wire.shared_link import SharedLink
from ual_daemon.backends.mavlink.wire.signing import Signer, read_key
from ual_daemon.backends.offers.cameras import Viewpoint
from ual_daemon.backends.values import ExternalPose, Freshness, LinkReport, Setpoint, VehicleInfo
from ual_daemon.settings import ConfigError, convert

T = TypeVar("T")


class MavlinkBackend(EngineBackend[CommandLong]):
    """Flies a PX4 or an ArduCopter over MAVLink; only watches others. See ``docs/reference/backends/mavlink.md``."""

    name = SECTION
    clock: MonotonicClock
    freshness = Dialect.freshness
    outlived = True
    has_packets = True

    def __init__(self, options: BackendOptions, new_link: Callable[[], MavlinkLink] | None = None) -> None:
        """`new_link` makes the link of a vehicle that shares it with others; by default it has one of its own."""
        self._settings = convert(options.settings, MavlinkSettings, SECTION)
        self.url = options.url or self._settings.url or default_url(options.ns)
        super().__init__(dataclasses.replace(options, url=self.url))
        place = parse_address(self.url)
        self._settings = _with_system_id(self._settings, place)
        self._is_serial = isinstance(place.endpoint, SerialEndpoint)
        self._new_link = new_link or partial(make_link, place.endpoint)
        self._new_link()  # so that a missing extra is an error here
        key_file = self._settings.signing_key_file
        self._signer = None if key_file is None else Signer(read_key(key_file))
        self.clock = MonotonicClock()
        self._setpoints = SetpointMonitor()
        self._payload_messages = PayloadMessages()
        self._payload = MavlinkPayload(lambda what, make: self._command(what, lambda _: make()), self._payload_messages)
        self._discovery: Discovery | None = None
        self._receiving: ReceiveLoop | None = None
        self._pictures = HttpPictures(self._settings.picture_hosts)
        access = ProtocolAccess(self._last_session, self._require_session, self._post, self._run_on_loop)
        parameters, lists = MavlinkParameters(access), MavlinkLists(access)
        self._offers = (
            parameters,
            missions_of(access, lists, parameters, self._fly_mission, lambda: self.snapshot().motion.position_geo),
            fence_of(access, lists),
            MavlinkLogs(access),
            MavlinkCorrections(self._require_session, self._post, lambda: self._discovery, self.clock.now_s),
            MavlinkCameras(self._cameras_found, self._now_s, access, self._pictures, self._camera_trigger()),
            MavlinkGimbals(self._gimbals_found, self._now_s, access),
            *derived.offers(
                Orders(access, lambda what, command: self._command(what, lambda _: command), self._payload_messages)
            ),
        )

    def _fly_mission(self) -> Future[None]:
        return self._command("fly the mission", lambda dialect: dialect.fly_mission())

    @classmethod
    @override
    def fleet(cls, options: Sequence[BackendOptions], places: Sequence[Vector3], first: int = 0) -> list[Backend]:
        if any(each.url is None for each in options):
            raise ConfigError("a fleet of autopilots needs a --fleet-url for each", "fleet")
        links = _links([each.url for each in options if each.url is not None])
        return [cls(each, new_link) for each, new_link in zip(options, links, strict=True)]

    @classmethod
    @override
    def vehicle_key(cls, url: str) -> str:
        return vehicle_key(url)

    @classmethod
    @override
    def vehicle_urls(cls, url: str) -> list[str]:
        return vehicle_urls(url)

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._start(LinkConnection(self._new_link(), self.url), on_update)

    @override
    def close(self) -> None:
        self._pictures.close()
        if self._receiving is not None:
            self._receiving.close()

    @override
    def info(self) -> VehicleInfo:
        return VehicleInfo() if self._receiving is None else self._receiving.info

    def link_statistics(self) -> LinkStatistics:
        """Returns the quality of the link. From any thread."""
        discovery = self._discovery
        return LinkStatistics() if discovery is None else discovery.link_statistics(self.clock.now_s())

    @override
    def link(self) -> LinkReport:
        found = self.link_statistics()
        return LinkReport(found.rate_hz, found.loss, found.round_trip_s, found.lost_count, found.reboots_count)

    @override
    def send(self, setpoint: Setpoint) -> None:
        now_s, discovery = self.clock.now_s(), self._discovery
        if discovery is None:
            return
        session = discovery.session
        if session is None or not discovery.watch.is_up(now_s) or session.telemetry.conflict:
            return
        plain = session.setpoint_encoder.velocity(setpoint, now_s)
        if plain is not None:
            velocity, target = plain
            if discovery.sender.send_velocity(target):
                self._setpoints.on_sent(now_s, velocity)
            return
        setpoint, message = session.setpoint_encoder.encode(setpoint, now_s)
        if discovery.sender.send(message, is_perishable=True):
            self._setpoints.on_sent(now_s, setpoint)

    @override
    def arm(self) -> Future[None]:
        return self._command("arm", lambda dialect: dialect.arm(self.snapshot()))

    @override
    def disarm(self) -> Future[None]:
        return self._command("disarm", lambda dialect: dialect.disarm())

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        is_slower = limits.climb_speed_m_s < self.info().limits.climb_speed_m_s
        return self._command(
            "take off", lambda dialect: dialect.take_off(height_m, self.snapshot(), is_slower=is_slower)
        )

    @override
    def land(self, limits: Limits) -> Future[None]:
        del limits  # the autopilots' landings take no speed: MPC_LAND_SPEED, LAND_SPEED
        return self._command("land", lambda dialect: dialect.land())

    @override
    def take_control(self) -> Future[None]:
        return self._command("take control", lambda dialect: dialect.take_control())

    @override
    def hold(self) -> Future[None]:
        return self._command("hold", lambda dialect: dialect.hold())

    @override
    def set_external_pose(self, measured: ExternalPose) -> None:
        discovery, session = self._discovery, self._connected_session(self.clock.now_s())
        if discovery is None or session is None or session.telemetry.conflict:
            return
        discovery.sender.send(session.dialect.encode_external_pose(measured), is_perishable=True)

    @override
    def request_home(self) -> None:
        session, loop = self._connected_session(self.clock.now_s()), self._loop
        if session is not None and loop is not None:
            loop.post(session.request_home)

    @override
    def utc_s(self) -> float:
        return self.clock.utc_s()

    @override
    def safety_pilot(self) -> SafetyPilot | None:
        return None if self._is_serial else LinkPilot(lambda: self._connected_session(self.clock.now_s()), self.arm)

    @override
    def payload(self) -> MavlinkPayload:
        return self._payload

    def _now_s(self) -> float:
        return self.clock.now_s()

    def _camera_trigger(self) -> TriggerCamera | None:
        if not self._settings.has_camera_trigger:
            return None
        return TriggerCamera(
            0,
            lambda: None if self._discovery is None else self._discovery.protocols.cameras.trigger,
            self._order_trigger,
            lambda act: self._post(lambda _: act()),
            lambda what, begin: self._run_on_loop(what, lambda _, future: begin(future)),
            lambda: self._connected_session(self.clock.now_s()) is not None,
        )

    def _order_trigger(self, what: str, command_id: int, params: tuple[float, ...]) -> Future[None]:
        return self._command(what, lambda _: trigger_order(what, command_id, params))

    def _cameras_found(self) -> Sequence[CameraLink]:
        return () if self._discovery is None else self._discovery.protocols.cameras.found

    def _gimbals_found(self) -> Sequence[GimbalLink]:
        return () if self._discovery is None else self._discovery.protocols.gimbals.found

    def _carried(self, device_id: int, body: Pose | None) -> Pose | None:
        """Returns where the gimbal of a device id looks now. Where it is in the body is not known: at its origin."""
        link = next((each for each in self._gimbals_found() if each.device_id == device_id), None)
        attitude = None if link is None else link.attitude_at(self._now_s())
        orientation = None if attitude is None else attitude.in_body(body)
        return None if orientation is None else Pose(Vector3(), orientation)

    def _viewpoint(self) -> Viewpoint:
        return viewpoint_of(self.snapshot(), self.freshness)

    def _last_session(self) -> MavlinkSession | None:
        return None if self._discovery is None else self._discovery.session

    def _post(self, request: Callable[[Discovery], None]) -> None:
        """Has something done on the thread that receives."""
        discovery, loop = self._discovery, self._loop
        if discovery is not None and loop is not None:
            loop.post(lambda _: request(discovery))

    def _run_on_loop(self, what: str, begin: Callable[[Discovery, Future[T]], object]) -> Future[T]:
        """Returns a future that is ended on the thread that receives."""
        discovery, loop = self._discovery, self._loop
        if discovery is None or loop is None:
            return futures.failed(self._unreached(what))
        return loop.run_on_loop(what, lambda future, _: begin(discovery, future))

    def _start(self, connection: LinkConnection, on_update: UpdateCallback) -> None:
        """Starts the thread that receives through a connection."""
        discovery = self._discovery = Discovery(
            self._settings, connection, self.url, self._setpoints, self._signer, self._payload_messages
        )
        cameras = discovery.protocols.cameras
        cameras.look = cameras.trigger.look = self._viewpoint
        cameras.trigger.utc_s = self.utc_s
        cameras.carried = self._carried
        cameras.first_number = int(self._settings.has_camera_trigger)
        name = f"mavlink {self.options.ns}"
        receiving = ReceiveLoop(connection, discovery, self.clock, self._use_freshness, on_update, name)
        self._receiving, self._loop = receiving, receiving.loop
        self._entrance = CommandEntrance(receiving.loop, self.clock, self._require_session)
        if self.on_packet is not None:
            tap = PacketTap(self.on_packet, connection, self.clock)
            connection.on_sent, receiving.on_received = tap.sent, tap.received
        receiving.thread.open()

    def _use_freshness(self, freshness: Freshness) -> None:
        self.freshness = freshness

    def _command(self, what: str, make: Callable[[Dialect], LongCommand]) -> Future[None]:
        """Passes a command to the thread that receives; its future ends there."""
        session = self._require_session(what)
        if isinstance(session, UalError):
            return futures.failed(session)
        return self._order(what, lambda: make(session.dialect))

    def _require_session(self, what: str) -> MavlinkSession | UalError:
        """Returns the session that commands go to now, or why there is none."""
        session = self._connected_session(self.clock.now_s())
        if session is None:
            return self._unreached(what)
        conflict = session.telemetry.conflict
        return RejectedByAutopilotError(f"cannot {what}: {conflict}") if conflict else session

    @override
    def _unreached(self, what: str) -> LinkLostError:
        return LinkLostError(f"cannot {what}: no autopilot is heard at {self.url}")

    def _connected_session(self, now_s: float) -> MavlinkSession | None:
        """The session with the autopilot while its link is up, else None."""
        discovery = self._discovery
        return discovery.session if discovery is not None and discovery.watch.is_up(now_s) else None


def _with_system_id(settings: MavlinkSettings, place: AutopilotAddress) -> MavlinkSettings:
    """Returns the settings with the system id that the URL names."""
    if place.system_id is None:
        return settings
    if settings.system_id not in (None, place.system_id):
        raise ConfigError(f"it is {settings.system_id}, but the URL names {place.system_id}", f"{SECTION}.system_id")
    return structs.replace(settings, system_id=place.system_id)


def _links(urls: Sequence[str]) -> list[Callable[[], MavlinkLink]]:
    """Returns what makes the link of each vehicle of a fleet: those behind one link have a part of it each.

    Raises:
        ConfigError: A URL does not say which of the vehicles behind its link it means.

    """
    places = [parse_address(each) for each in urls]
    counts = Counter(each.endpoint for each in places)
    shared = {
        each: SharedLink(partial(make_link, each), str(each), MonotonicClock())
        for each, count in counts.items()
        if count > 1
    }
    made: list[Callable[[], MavlinkLink]] = []
    for url, (endpoint, system_id) in zip(urls, places, strict=True):
        if endpoint not in shared:
            made.append(partial(make_link, endpoint))
        elif system_id is None:
            raise ConfigError(f"{url}: other vehicles are on this link, so say which: {url}?system_id=N", "url")
        else:
            made.append(partial(shared[endpoint].vehicle, system_id))
    return made
