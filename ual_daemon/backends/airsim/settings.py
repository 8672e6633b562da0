"""Settings of the backend, and the address of the simulator."""

from __future__ import annotations

import re
from typing import Annotated, NamedTuple

from msgspec import Meta

from ual_daemon.settings import ConfigError, Positive, Settings

SECTION = "airsim"
DEFAULT_URL = "127.0.0.1:41451"
_DEFAULT_PORT = 41451
_URL = re.compile(r"(?P<host>\[[0-9A-Fa-f:.]+\]|[^\[\]:/\s]+)(?::(?P<port>[0-9]{1,5}))?\Z")


class AirsimSettings(Settings, frozen=True, kw_only=True):
    """The section ``airsim`` of the configuration.

    `vehicle_name` is the vehicle's name in the simulator's settings.json; empty: its only vehicle. `rate_hz` is how
    often, in simulated time, the vehicle's state is read and a setpoint is sent. `mass_kg` is that of the vehicle's
    model: what stands still with less thrust than its weight stands on the ground.
    """

    vehicle_name: Annotated[str, Meta(max_length=64)] = ""
    rate_hz: Annotated[float, Meta(ge=10.0, le=100.0)] = 50.0
    mass_kg: Positive = 1.0


class AirsimAddress(NamedTuple):
    """Address of the simulator's RPC server."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def parse_address(url: str) -> AirsimAddress:
    """Parses ``HOST:PORT``, ``HOST`` or ``[IPV6]:PORT``.

    Raises:
        ConfigError: It is none of these.
    """
    found = _URL.match(url)
    port = int(found["port"] or _DEFAULT_PORT) if found else 0
    if found is None or not 0 < port < 65536:
        raise ConfigError(f"{url!r} is no address of a simulator: HOST:PORT, such as {DEFAULT_URL}", "url")
    return AirsimAddress(found["host"].strip("[]"), port)
