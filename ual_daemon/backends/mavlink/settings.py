"""Settings of the backend, and the addresses that it understands."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated
from urllib.parse import urlsplit

from msgspec import Meta

from ual_daemon.settings import ConfigError, Settings

SECTION = "mavlink"
SUPPORTED = "udp://:PORT, udp://HOST:PORT or udpin://HOST:PORT to listen there, udpout://HOST:PORT to call"
FIRST_PORT = 14540
"""Where PX4's simulator sends its first vehicle's onboard stream; the next vehicle's is one higher."""

MavlinkId = Annotated[int, Meta(ge=1, le=254)]


class MavlinkSettings(Settings, frozen=True, kw_only=True):
    """The section ``mavlink`` of the configuration.

    `url` is where the autopilot is (default: see `default_url`). `system_id` is the only autopilot listened to (None:
    the first heard). `component_id` is our own, beside the autopilot in its system; two programs on one vehicle need
    different ones. `pose_rate_hz` is how often the autopilot is asked for its position and attitude.
    """

    url: str | None = None
    system_id: MavlinkId | None = None
    component_id: MavlinkId = 191
    pose_rate_hz: Annotated[float, Meta(ge=5.0, le=200.0)] = 50.0


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A UDP address: to listen at, or to call."""

    host: str
    port: int
    is_listening: bool


def default_url(ns: str) -> str:
    """Where PX4's simulator sends the vehicle of a namespace: ``uav_2`` is at 14541. Loopback only."""
    number = re.search(r"_(\d{1,5})$", ns)
    port = FIRST_PORT + (int(number[1]) if number else 1) - 1
    return f"udpin://127.0.0.1:{port}"


def parse_url(url: str) -> Endpoint:
    """The address that a URL names. Without a host it listens on every interface, as MAVSDK does.

    Raises `ConfigError` that says what is supported.
    """
    try:
        parts = urlsplit(url)
        host, port = parts.hostname or "", parts.port
    except ValueError as error:
        raise _refusal(url, str(error)) from None
    if parts.scheme not in ("udp", "udpin", "udpout"):
        raise _refusal(url, f"{parts.scheme}:// is not supported" if parts.scheme else "it has no scheme")
    if port is None or not 0 < port < 65536:
        raise _refusal(url, "it needs a port from 1 to 65535")
    if parts.path or parts.query or parts.fragment or parts.username is not None:
        raise _refusal(url, "there is more than a host and a port in it")
    is_listening = parts.scheme != "udpout"
    if not host and not is_listening:
        raise _refusal(url, "udpout:// needs a host to call")
    return Endpoint(host or "0.0.0.0", port, is_listening)  # noqa: S104 - asked for, by leaving out the host


def _refusal(url: str, why: str) -> ConfigError:
    return ConfigError(f"{url!r} cannot be used: {why}; supported: {SUPPORTED}", f"{SECTION}.url")
