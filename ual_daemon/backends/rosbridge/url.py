"""The URL of a rosbridge server."""

from __future__ import annotations

import re
from typing import NamedTuple

from ual_daemon.settings import ConfigError

DEFAULT_URL = "rosbridge://127.0.0.1:9090"
_DEFAULT_PORT = 9090
_URL = re.compile(
    r"(?P<scheme>rosbridges?)://(?P<host>\[[0-9A-Fa-f:.]+\]|[^\[\]:/\s]+)(?::(?P<port>[0-9]{1,5}))?"
    r"(?P<namespace>(/[A-Za-z_][A-Za-z0-9_]*)*)/?\Z"
)


class BridgeUrl(NamedTuple):
    """Address of rosbridge, and the ROS namespace of the UAV ("/uav_1"; empty: none)."""

    host: str
    port: int
    namespace: str = ""
    has_tls: bool = False

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"rosbridge{'s' if self.has_tls else ''}://{host}:{self.port}{self.namespace}"

    @property
    def websocket(self) -> str:
        """The URL of the WebSocket."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"ws{'s' if self.has_tls else ''}://{host}:{self.port}/"

    def resolve(self, name: str) -> str:
        """Returns the global name of a topic or service: a relative one is in the namespace."""
        return name if name.startswith("/") else f"{self.namespace}/{name}"


def parse_url(url: str) -> BridgeUrl:
    """Parses ``rosbridge://HOST[:PORT][/NAMESPACE]``, or ``rosbridges://`` for TLS.

    Raises:
        ConfigError: It is none of these.
    """
    found = _URL.match(url)
    port = int(found["port"] or _DEFAULT_PORT) if found else 0
    if found is None or not 0 < port < 65536:
        raise ConfigError(f"{url!r} is no address of a rosbridge: rosbridge://HOST:PORT[/NAMESPACE]", "url")
    return BridgeUrl(found["host"].strip("[]"), port, found["namespace"], found["scheme"] == "rosbridges")
