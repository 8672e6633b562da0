"""Hands over what is on the link, in both directions, for a recording."""

from __future__ import annotations

from collections.abc import Callable

from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.mavlink.links import Address, LinkConnection
from ual_daemon.backends.values import Packet

ENCODING = "mavlink"


class PacketTap:
    """Makes packets of the bytes that a connection receives and sends."""

    def __init__(self, on_packet: Callable[[Packet], None], connection: LinkConnection, clock: MonotonicClock) -> None:
        self._on_packet = on_packet
        self._connection = connection
        self._clock = clock

    def received(self, data: bytes, address: Address | None, now_s: float, utc_s: float) -> None:
        """Takes what was received."""
        self._on_packet(Packet(ENCODING, data, False, peer_text(address), now_s, utc_s))

    def sent(self, data: bytes) -> None:
        """Takes a frame that has just left."""
        peer = peer_text(self._connection.peer)
        self._on_packet(Packet(ENCODING, data, True, peer, self._clock.now_s(), self._clock.utc_s()))


def peer_text(address: Address | None) -> str:
    """Returns an address as text; empty for a link with one other end."""
    return "" if address is None else f"{address[0]}:{address[1]}"


def peer_address(text: str) -> Address | None:
    """Returns the address of such a text."""
    host, _, port = text.rpartition(":")
    return (host, int(port)) if port else None
