"""The links to Crazyflies: UDP to the firmware's simulator, Crazyradio and USB through the drivers of cflib.

UDP needs no cflib, whose client cannot be used on it (docs/evidence/decisions/0023): it never repeats what is lost.
"""

from __future__ import annotations

import errno
import importlib
import logging
import select
import socket
import threading
from abc import ABC, abstractmethod
from contextlib import suppress
from typing import Any, Protocol
from urllib.parse import urlsplit

from typing_extensions import override

from ual_daemon.backends.crazyflie.outbox import PacketOutbox
from ual_daemon.backends.crazyflie.packets import CrtpPacket
from ual_daemon.settings import ConfigError

LARGEST_PACKET_BYTES = 64
_UNREACHABLE = (errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EHOSTDOWN)
"""Temporary errors of routers and firewalls; the link may come back, like a port where nobody listens."""
_RATES = ("250K", "1M", "2M")
_DEFAULT_CHANNEL, _DEFAULT_RATE, _DEFAULT_ADDRESS = "2", "2M", "E7E7E7E7E7"
_LOOPBACK = "127.0.0.1"
_FLUSH_S = 0.5
"""Seconds that a radio may take to send waiting packets when it is closed."""
_EXTRA = "install the extra: pip install 'ual-daemon[crazyflie]'"


class CrtpLinkError(Exception):
    """The link cannot be opened, or is gone; says why, human-readable."""


class CrtpLink(ABC):
    """A link to one Crazyflie. `send` may be called from any thread, everything else by the thread that receives.

    `is_slow` says that `send_now` may block, so that setpoints need a mailbox.
    """

    is_slow = False
    url = ""
    """Address of the other end; empty while that is not known."""

    @abstractmethod
    def open(self) -> None:
        """Opens it. Raises `CrtpLinkError`."""

    @abstractmethod
    def close(self) -> None:
        """Closes it; it can be opened again."""

    @abstractmethod
    def receive(self, timeout_s: float) -> list[CrtpPacket]:
        """Waits for packets, and returns those that have come. Raises `CrtpLinkError`."""

    @abstractmethod
    def send(self, packet: CrtpPacket) -> None:
        """Sends a packet without blocking. What cannot be sent is lost."""

    def send_now(self, packet: CrtpPacket) -> None:
        """Sends a packet before it returns, which may take a while."""
        self.send(packet)

    def send_pose(self, packet: CrtpPacket) -> None:
        """Sends a pose from outside without blocking. One that cannot be sent at once is replaced by the next."""
        self.send(packet)


class CrtpUdpLink(CrtpLink):
    """One CRTP packet for each datagram, to the simulator at a host and port."""

    def __init__(self, host: str, port: int) -> None:
        self._address = host, port
        self.url = f"udp://{host}:{port}"
        self._socket: socket.socket | None = None

    @override
    def open(self) -> None:
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(*self._address, type=socket.SOCK_DGRAM)[0]
            opened = socket.socket(family, kind, protocol)
            opened.setblocking(False)
            opened.connect(address)
        except (OSError, UnicodeError) as error:  # the latter for a name that no host can have
            raise CrtpLinkError(str(error)) from error
        self._socket = opened

    @override
    def close(self) -> None:
        opened, self._socket = self._socket, None
        if opened is not None:
            opened.close()

    @override
    def receive(self, timeout_s: float) -> list[CrtpPacket]:
        opened = self._socket
        if opened is None:
            return []
        found: list[CrtpPacket] = []
        try:
            if select.select([opened], [], [], timeout_s)[0]:
                _receive_all(opened, found)
        except (BlockingIOError, ConnectionError):
            pass  # nobody listens there now: it may come back
        except OSError as error:
            if error.errno not in _UNREACHABLE:
                raise CrtpLinkError(str(error)) from error
        return found

    @override
    def send(self, packet: CrtpPacket) -> None:
        opened = self._socket
        if opened is not None:
            with suppress(OSError):
                opened.send(packet.encode())


def _receive_all(opened: socket.socket, found: list[CrtpPacket]) -> None:
    """Receives until nothing is left, which raises BlockingIOError."""
    while True:
        packet = CrtpPacket.decode(opened.recv(LARGEST_PACKET_BYTES))
        if packet is not None:
            found.append(packet)


class Driver(Protocol):
    """Used part of cflib's link drivers."""

    def receive_packet(self, wait: float) -> Any:  # noqa: ANN401  a CRTPPacket; cflib has no types
        """Waits for a packet; None if none came."""

    def send_packet(self, packet: Any) -> Any:  # noqa: ANN401
        """Sends a packet; may block for 2 s."""

    def close(self) -> None:
        """Closes the link."""


class CflibLink(CrtpLink):
    """A Crazyradio or a USB cable, through a driver of cflib. Several links share one radio."""

    is_slow = True

    def __init__(self, url: str) -> None:
        self.url = url
        self._cflib = load_cflib()
        self._driver: Driver | None = None
        self._broken = ""
        self._outbox = PacketOutbox()
        self._thread: threading.Thread | None = None

    @override
    def open(self) -> None:
        self._broken = ""
        try:
            driver = self._cflib.get_link_driver(self.url, None, self._on_error)
        except Exception as error:
            raise CrtpLinkError(str(error) or repr(error)) from error
        if driver is None:
            raise CrtpLinkError(f"cflib has no driver for {self.url}")
        self._driver, self._outbox = driver, PacketOutbox()
        self._thread = threading.Thread(
            target=self._send_all, args=(driver, self._outbox), name=f"crazyflie {self.url}", daemon=True
        )
        self._thread.start()

    @override
    def close(self) -> None:
        driver, self._driver = self._driver, None
        if driver is None:
            return
        self._outbox.close()
        if self._thread is not None:
            self._thread.join(_FLUSH_S)
        with suppress(Exception):  # an unplugged device cannot be closed
            driver.close()

    @override
    def receive(self, timeout_s: float) -> list[CrtpPacket]:
        if self._broken:
            raise CrtpLinkError(self._broken)
        driver = self._driver
        received = None if driver is None else driver.receive_packet(timeout_s)
        found = []
        while driver is not None and received is not None:
            packet = CrtpPacket.decode(bytes((received.header,)) + bytes(received.data))
            if packet is not None:
                found.append(packet)
            received = driver.receive_packet(0)
        return found

    @override
    def send(self, packet: CrtpPacket) -> None:
        self._outbox.put(packet)

    @override
    def send_pose(self, packet: CrtpPacket) -> None:
        self._outbox.put_pose(packet)

    @override
    def send_now(self, packet: CrtpPacket) -> None:
        driver = self._driver
        if driver is not None:
            self._send_through(driver, packet)

    def _send_all(self, driver: Driver, outbox: PacketOutbox) -> None:
        """Sends what waits until the link is closed; the last packets may be those that keep it in the air."""
        while (packet := outbox.take()) is not None:
            if not self._broken:
                self._send_through(driver, packet)

    def _send_through(self, driver: Driver, packet: CrtpPacket) -> None:
        from cflib.crtp.crtpstack import CRTPPacket

        try:
            driver.send_packet(CRTPPacket(packet.encode()[0], packet.data))
        except Exception as error:  # noqa: BLE001  USB errors of several libraries; the link is opened again
            self._on_error(str(error) or repr(error))

    def _on_error(self, text: str) -> None:
        self._broken = text.splitlines()[0] if text else "the link failed"


def load_cflib() -> Any:  # noqa: ANN401  a module without types
    """Imports the drivers of cflib.

    Raises:
        ConfigError: It is not installed; names the extra.
    """
    try:
        crtp = importlib.import_module("cflib.crtp")
    except ImportError as error:
        raise ConfigError(f"Crazyradio and USB need cflib ({error}); {_EXTRA}", "url") from error
    # It tells at INFO what each scan does, once a second while nothing is found; links say themselves what they do.
    logging.getLogger("cflib").setLevel(logging.WARNING)
    if not crtp.CLASSES:
        crtp.init_drivers()
    return crtp


def make_link(url: str) -> CrtpLink:
    """Returns the link for a URL; it is not open yet.

    Raises:
        ConfigError: The URL is none of a Crazyflie, or cflib is missing.
    """
    if url.startswith(("radio://", "usb://")):
        return CflibLink(url)
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError:  # urllib's: of brackets and ports
        host = port = None
    if not url.startswith("udp://") or not host or not port:
        raise ConfigError(
            f"{url!r} is no URL of a Crazyflie: radio://0/80/2M/E7E7E7E7E7, usb://0 or udp://HOST:PORT", "url"
        )
    return CrtpUdpLink(host, port)


def vehicle_key(url: str) -> str:
    """Returns a text that is the same for all URLs of one vehicle, as far as the URLs say it.

    The dongle is left out: two of them reach the same Crazyflie. What a radio's URL leaves out is cflib's default.
    """
    try:
        parts = urlsplit(url.strip())
    except ValueError:
        return url  # is refused later
    where = parts.path.strip("/").split("/")
    if parts.scheme == "radio":
        channel, rate, address = (*where, *("", "", "")[len(where) :])[:3]
        rate = rate if rate in _RATES else _DEFAULT_RATE
        return f"radio {channel.lstrip('0') or _DEFAULT_CHANNEL}/{rate}/{(address or _DEFAULT_ADDRESS).upper():0>10}"
    if parts.scheme not in ("udp", "usb"):
        return url  # is refused later
    host, _, port = parts.netloc.lower().partition(":")
    return f"{parts.scheme} {_LOOPBACK if host == 'localhost' else host}" + (f":{port.lstrip('0')}" if port else "")


def scan() -> list[str]:
    """Returns the URLs of the Crazyflies that are found, at least one. Takes some seconds.

    Raises:
        ConfigError: cflib is missing.
        LinkError: The scan failed or found none.
    """
    crtp = load_cflib()
    try:
        radios = len(importlib.import_module("cflib.drivers.crazyradio").get_serials())
        # Without a dongle the radio's driver prints so on the standard output, at every scan.
        drivers = [driver() for driver in crtp.CLASSES if radios or driver.__name__ != "RadioDriver"]
        found = [str(url) for driver in drivers for url, _ in driver.scan_interface(None)]
    except Exception as error:
        raise CrtpLinkError(str(error) or repr(error)) from error
    if not found:
        raise CrtpLinkError("no Crazyflie found" + ("" if radios else ", and no Crazyradio"))
    return found


class ScannedLink(CrtpLink):
    """The link to the only Crazyflie that a scan finds; scans whenever it is opened."""

    is_slow = True

    def __init__(self) -> None:
        load_cflib()
        self._link: CrtpLink | None = None

    @override
    def open(self) -> None:
        found = scan()
        if len(found) > 1:
            raise CrtpLinkError(f"several Crazyflies: give --url, one of {', '.join(found)}")
        link = make_link(found[0])
        link.open()
        self._link, self.url = link, found[0]

    @override
    def close(self) -> None:
        link, self._link = self._link, None
        if link is not None:
            link.close()

    @override
    def receive(self, timeout_s: float) -> list[CrtpPacket]:
        return [] if self._link is None else self._link.receive(timeout_s)

    @override
    def send(self, packet: CrtpPacket) -> None:
        if self._link is not None:
            self._link.send(packet)

    @override
    def send_now(self, packet: CrtpPacket) -> None:
        if self._link is not None:
            self._link.send_now(packet)

    @override
    def send_pose(self, packet: CrtpPacket) -> None:
        if self._link is not None:
            self._link.send_pose(packet)
