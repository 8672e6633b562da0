"""Links to autopilots: UDP, TCP and serial lines behind one interface, and the connection that keeps one open."""

from ual_daemon.backends.mavlink.links.base import Address, Chunk, LinkError, MavlinkLink, MessageTransport
from ual_daemon.backends.mavlink.links.connection import LinkConnection
from ual_daemon.backends.mavlink.links.endpoints import Endpoint, SerialEndpoint, TcpEndpoint
from ual_daemon.backends.mavlink.links.serial import SerialLink
from ual_daemon.backends.mavlink.links.tcp import TcpClientLink, TcpServerLink
from ual_daemon.backends.mavlink.links.udp import UdpLink

__all__ = ["Address", "Chunk", "LinkConnection", "LinkError", "MavlinkLink", "MessageTransport", "make_link"]


def make_link(endpoint: Endpoint) -> MavlinkLink:
    """Returns the link to an endpoint, not open yet.

    Raises:
        ConfigError: The optional package for this kind of link is not installed.

    """
    if isinstance(endpoint, SerialEndpoint):
        return SerialLink(endpoint)
    if isinstance(endpoint, TcpEndpoint):
        return TcpServerLink(endpoint) if endpoint.is_listening else TcpClientLink(endpoint)
    return UdpLink(endpoint)
