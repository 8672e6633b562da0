"""The addresses of autopilots, spelled as in MAVSDK and MAVROS. An ambiguous one is refused, never guessed."""

from __future__ import annotations

import re
from dataclasses import dataclass
from ipaddress import ip_address
from typing import NamedTuple
from urllib.parse import SplitResult, urlsplit

from ual_daemon.backends.mavlink.settings import SECTION
from ual_daemon.settings import ConfigError

KEY = f"{SECTION}.url"
SUPPORTED = (
    "udpin://HOST:PORT or udp://:PORT to listen, udpout://HOST:PORT to call, tcp://HOST:PORT to connect, "
    "tcpin://HOST:PORT to be connected to, serial:///dev/DEVICE:BAUD; behind each of them ?system_id=N"
)
EVERY_INTERFACE = "0.0.0.0"  # noqa: S104 - only used where the URL requests it

_LISTENING = {"udp": True, "udpin": True, "udpout": False, "tcp": False, "tcpout": False, "tcpin": True}
_FOREIGN = {
    "tcp-l": "tcpin",
    "udp-b": "udpin",
    "udp-pb": "udpin",
    "udpbcast": "udpin",
    "serial-hwfc": "serial",
    "serial_flowcontrol": "serial",
}
_BAUDS = range(1200, 12_000_001)
_SYSTEM_ID = "?system_id="
_SYSTEM_IDS = range(1, 255)


@dataclass(frozen=True, slots=True)
class _IpEndpoint:
    host: str
    port: int
    is_listening: bool


class UdpEndpoint(_IpEndpoint):
    """A UDP address: to listen at, or to call."""

    __slots__ = ()

    def __str__(self) -> str:
        return f"UDP {_host_and_port(self.host, self.port)}"


class TcpEndpoint(_IpEndpoint):
    """A TCP address: to be connected to at, or to connect to."""

    __slots__ = ()

    def __str__(self) -> str:
        return f"TCP {_host_and_port(self.host, self.port)}"


@dataclass(frozen=True, slots=True)
class SerialEndpoint:
    """A serial line, 8N1 without flow control."""

    device: str
    baud: int

    def __str__(self) -> str:
        return self.device


Endpoint = UdpEndpoint | TcpEndpoint | SerialEndpoint


class AutopilotAddress(NamedTuple):
    """Place of an autopilot: the link, and its system id if the URL names one."""

    endpoint: Endpoint
    system_id: int | None


def parse_address(url: str) -> AutopilotAddress:
    """Returns the place that a URL of one vehicle names.

    Raises:
        ConfigError: The URL cannot be used; the message says why, and how to spell it.

    """
    link, system_ids = split_url(url)
    if len(system_ids) > 1:
        raise ConfigError(f"{url!r} names {len(system_ids)} vehicles: give it as --fleet-url", KEY)
    return AutopilotAddress(parse_url(link), next(iter(system_ids), None))


def vehicle_urls(url: str) -> list[str]:
    """Returns a URL for each vehicle that one with ``?system_id=1,2,3`` names.

    Raises:
        ConfigError: These are no system ids.

    """
    link, system_ids = split_url(url)
    return [f"{link}{_SYSTEM_ID}{each}" for each in system_ids] or [url]


def vehicle_key(url: str) -> str:
    """Returns a text that is the same for all URLs of one vehicle, as far as the URLs say it."""
    try:
        return str(parse_address(url))
    except ConfigError:
        return url  # is refused later


def split_url(url: str) -> tuple[str, tuple[int, ...]]:
    """Returns the URL of the link, and the system ids behind it.

    Raises:
        ConfigError: These are no system ids.

    """
    link, is_there, text = url.partition(_SYSTEM_ID)
    if not is_there:
        return url, ()
    if not re.fullmatch(r"[0-9]{1,3}(,[0-9]{1,3})*", text):
        raise _refusal(url, "its system ids are not numbers", f"{link}{_SYSTEM_ID}1 or {link}{_SYSTEM_ID}1,2,3")
    system_ids = tuple(map(int, text.split(",")))
    if not all(each in _SYSTEM_IDS for each in system_ids):
        raise _refusal(url, "system ids are from 1 to 254")
    return link, system_ids


def parse_url(url: str) -> Endpoint:
    """Returns the address that a URL names.

    Raises:
        ConfigError: The URL cannot be used; the message says why, and how to spell it.

    """
    if url.startswith("/"):  # MAVROS's spelling
        return _serial(url, url)
    try:
        parts = urlsplit(url)
        scheme, host = url.partition(":")[0] if ":" in url else "", parts.hostname or ""
        if scheme == "serial":
            return _serial(url, url.partition(":")[2])
        _refuse_foreign(url, scheme)
        if parts.username is not None:
            raise _refusal(url, "there is more than a host and a port in it", _of_mavros(parts.netloc))
    except ValueError:  # urllib's: of brackets
        raise _refusal(url, "its host is no name and no IP address") from None
    port = _port(parts)
    if port == 0:
        raise _refusal(url, "it needs a port from 1 to 65535")
    if parts.path or parts.query or parts.fragment:
        raise _refusal(url, "there is more than a host and a port in it", f"{scheme}://{parts.netloc}")
    if scheme == "udp" and host not in ("", EVERY_INTERFACE, "::"):
        where = _host_and_port(host, port)
        raise _refusal(
            url, "udp:// with a host is ambiguous", f"udpin://{where} to listen there or udpout://{where} to call"
        )
    if _is_for_many(host):
        raise _refusal(
            url,
            "it addresses several vehicles at once (broadcast, multicast)",
            f"udpin://:{port} to listen for the one that comes, or udpout:// with the vehicle's own address",
        )
    is_listening = _LISTENING[scheme]
    if not host and not is_listening:
        raise _refusal(url, f"{scheme}:// needs a host to call")
    kind = UdpEndpoint if scheme.startswith("udp") else TcpEndpoint
    return kind(host or EVERY_INTERFACE, port, is_listening)


def _port(parts: SplitResult) -> int:
    """Returns the port; 0 where there is none that can be used."""
    try:
        return parts.port or 0
    except ValueError:
        return 0


def _is_for_many(host: str) -> bool:
    try:
        address = ip_address(host)
    except ValueError:
        return False
    return address.is_multicast or host == "255.255.255.255"


def _refuse_foreign(url: str, scheme: str) -> None:
    if scheme in _FOREIGN:
        raise _refusal(url, f"{scheme}:// is not supported", f"{_FOREIGN[scheme]}://")
    if scheme not in _LISTENING:
        raise _refusal(url, f"{scheme}:// is not supported" if scheme else "it has no scheme")
    found = re.fullmatch(r"(\w+):([^/].*):(\d+)", url)  # pymavlink's and MAVProxy's spelling
    if found:
        name = {"udp": "udpin", "tcp": "tcp"}.get(found[1], found[1])
        raise _refusal(url, "the two slashes are missing", f"{name}://{found[2]}:{found[3]}")


def _of_mavros(netloc: str) -> str:
    """Returns our spelling of MAVROS's ``udp://HERE@THERE``, which binds and calls; our links do one of these."""
    here, _, there = netloc.rpartition("@")
    return f"udpout://{there} to call" if re.search(r":\d", there) and not there.startswith(":") else f"udpin://{here}"


def _serial(url: str, rest: str) -> SerialEndpoint:
    """Returns the line that ``///dev/DEVICE:BAUD`` or ``/dev/DEVICE:BAUD`` names; a device may be elsewhere (socat)."""
    path = "/" + rest.lstrip("/")
    query = re.fullmatch(r"(/[^?]+)\?baud(?:rate)?=(\d+)", path)
    comma = re.fullmatch(r"(/[^,]+),(\d+)", path)
    if foreign := query or comma:
        raise _refusal(url, "the baud rate goes behind a colon", f"serial://{foreign[1]}:{foreign[2]}")
    device, _, baud = path.rpartition(":")
    if not device or not re.fullmatch(r"[0-9]+", baud):
        whole = _device_path(path.rstrip(":"))
        raise _refusal(url, "it needs a baud rate", f"serial://{whole}:57600, or the rate that the autopilot has")
    is_whole = rest.startswith("/") and not rest.startswith("////") and (not rest.startswith("//") or rest[2] == "/")
    if not is_whole or "/" not in device[1:]:
        raise _refusal(url, "it needs the device's whole path", f"serial://{_device_path(device)}:{baud}")
    if int(baud) not in _BAUDS:
        raise _refusal(url, f"{baud} is no baud rate (usual are 57600, 115200, 921600)")
    return SerialEndpoint(device, int(baud))


def _device_path(device: str) -> str:
    return device if "/" in device[1:] else f"/dev{device}"


def _host_and_port(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def _refusal(url: str, why: str, instead: str = "") -> ConfigError:
    hint = f"; write {instead}" if instead else ""
    return ConfigError(f"{url!r} cannot be used: {why}{hint}; supported: {SUPPORTED}", KEY)
