"""Decodes recorded packets as those of a link: the same session, without a link, a thread or a clock."""

from __future__ import annotations

from typing_extensions import override

from ual.geometry import Vector3
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.links import Address, MessageTransport
from ual_daemon.backends.mavlink.packet_tap import ENCODING, peer_address
from ual_daemon.backends.mavlink.session.discovery import Discovery
from ual_daemon.backends.mavlink.settings import MavlinkSettings
from ual_daemon.backends.values import Freshness, Packet, PositionSetpoint, Sample, Snapshot, VehicleInfo

__all__ = ["ENCODING", "NoLink", "Playback"]

_TICK_S = 0.05


class NoLink(MessageTransport):
    """Sends nothing, and says that it has: what the session requests was answered in the recording."""

    def __init__(self, *, is_stream: bool) -> None:
        self._is_stream = is_stream
        self._peer: Address | None = None

    @property
    @override
    def is_stream(self) -> bool:
        return self._is_stream

    @property
    @override
    def peer(self) -> Address | None:
        return self._peer

    @override
    def answer_to(self, address: Address | None) -> None:
        self._peer = address

    @override
    def send(self, data: bytes, *, is_perishable: bool = False) -> bool:
        return True


class Playback:
    """The session with a recorded autopilot. Times are those of the recording, and never go back.

    `system_id` is the only autopilot that is received (None: the first received).
    """

    def __init__(self, url: str, system_id: int | None = None) -> None:
        self._url = url
        self._settings = MavlinkSettings(system_id=system_id)
        self._setpoints = SetpointMonitor()
        self._discovery: Discovery | None = None
        self._ticked_s = float("-inf")

    @property
    def info(self) -> VehicleInfo:
        """Description of the vehicle."""
        session = None if self._discovery is None else self._discovery.session
        return VehicleInfo() if session is None else session.info()

    @property
    def freshness(self) -> Freshness:
        """Ages that the autopilot's values may reach."""
        session = None if self._discovery is None else self._discovery.session
        return Dialect.freshness if session is None else session.freshness

    @property
    def pose(self) -> Sample[object] | None:
        """The newest pose."""
        session = None if self._discovery is None else self._discovery.session
        return None if session is None else session.telemetry.pose.sample

    def receive(self, packet: Packet) -> None:
        """Takes a packet that was received."""
        if not packet.data:
            if self._discovery is not None:
                self._discovery.discard_state()
            return
        address = peer_address(packet.peer)
        if self._discovery is None:  # only now it is known what kind of link it was
            link = NoLink(is_stream=address is None)
            self._discovery = Discovery(self._settings, link, self._url, self._setpoints)
        self._discovery.receiver.receive(packet.data, address, packet.time_s, packet.utc_s)
        self._tick(packet.time_s)

    def on_setpoint(self, time_s: float, position: Vector3 | None) -> None:
        """Takes note of a setpoint that was sent; None: a velocity."""
        self._setpoints.on_sent(time_s, None if position is None else PositionSetpoint(position, 0.0))

    def snapshot(self, now_s: float) -> Snapshot:
        """Returns the newest data."""
        self._tick(now_s)
        session = None if self._discovery is None else self._discovery.session
        return Snapshot(now_s) if session is None else session.snapshot(now_s)

    def _tick(self, now_s: float) -> None:
        if self._discovery is not None and now_s - self._ticked_s >= _TICK_S:
            self._ticked_s = now_s
            self._discovery.tick(now_s)
