"""The settings of the network: which site, how it is joined, and by which certificate. One YAML file, or none.

Daemons (``ual-daemon --network FILE``) and clients (``ual --network-config FILE``) read the same file.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from enum import Enum
from pathlib import Path
from typing import Any

from ual.discovery import LAST_PORT
from ual.errors import InvalidArgumentError
from ual.network import keys
from ual.shared import bounded_file, extras
from ual.shared.exposure import exposed

LOOPBACK = "loopback"
"""Stands for the settings without a file: this computer only."""
MOST_RATE_HZ = 50.0
_PROTOCOLS = ("tcp", "tls", "quic")
_ENCRYPTED = ("tls", "quic")
_ENDPOINT = re.compile(r"(?P<protocol>[a-z]+)/(?P<address>(?:\[[0-9A-Fa-f:.]+\]|[^\s:/\[\]?#]+):(?P<port>[0-9]{1,5}))")
_HOST = re.compile(r"[A-Za-z0-9._:-]{1,255}")
_MOST_ENDPOINTS = 32


class Scouting(Enum):
    """Scope in which programs find each other without a router."""

    NONE = "none"
    LOOPBACK = "loopback"
    LAN = "lan"


@dataclass(frozen=True, slots=True)
class NetworkSettings:
    """Settings for joining the network.

    Args:
        site: Daemons and clients of one site see each other.
        connect: The routers, ``tls/HOST:PORT``; the first that answers is used, another one when it fails.
        scouting: How others are found where there is no router. Default: on loopback, or not at all with `connect`.
        scouting_port: UDP; groups of programs with different ones do not meet.
        certificate: That of this program, with its `key`, PEM. Needed for whatever leaves this computer.
        key: Its private key.
        authority: The certificate of the authority that has signed all others, PEM.
        publishers: With `scouting` on the LAN: whose word is taken (``uav_7``, ``uav_1-200``), by their certificates.
        host: By which name or address other computers reach a daemon that listens everywhere. Default: the computer's.
        rate_hz: How often a daemon tells of each UAV.

    Raises:
        InvalidArgumentError: A value is not valid, or the network could be reached without certificates.
    """

    site: str = "local"
    connect: tuple[str, ...] = ()
    scouting: Scouting | None = None
    scouting_port: int = 7446
    certificate: Path | None = None
    key: Path | None = None
    authority: Path | None = None
    publishers: tuple[str, ...] = ()
    host: str = ""
    rate_hz: float = 1.0

    def __post_init__(self) -> None:
        _require(re.fullmatch(keys.SITE_PATTERN, self.site), "site", f"{self.site!r} is no name: letters, digits, _, -")
        _require(0.0 < self.rate_hz <= MOST_RATE_HZ, "rate_hz", f"{self.rate_hz} is not between 0 and {MOST_RATE_HZ:g}")
        _require(0 < self.scouting_port <= LAST_PORT, "scouting_port", f"{self.scouting_port} is no port")
        _require(not self.host or _HOST.fullmatch(self.host), "host", f"{self.host!r} is no host")
        _require(len(self.connect) <= _MOST_ENDPOINTS, "connect", f"more than {_MOST_ENDPOINTS} routers")
        for endpoint in self.connect:
            _require_endpoint(endpoint)
        for publisher in self.publishers:
            _require(keys.is_publisher(publisher), "publishers", f"{publisher!r} is no UAV: uav_7, or uav_1-200")
        self._require_whole_identity()
        self._require_safe()

    @property
    def means(self) -> Scouting:
        """Scope in which others are found without a router."""
        return self.scouting or (Scouting.NONE if self.connect else Scouting.LOOPBACK)

    @property
    def has_certificate(self) -> bool:
        """Whether this program shows a certificate, and wants one of others."""
        return self.certificate is not None

    def _require_whole_identity(self) -> None:
        files = {name: getattr(self, name) for name in ("certificate", "key", "authority")}
        missing = [name for name, value in files.items() if value is None]
        _require(len(missing) in (0, 3), (missing or ["key"])[0], "certificate, key and authority are needed together")

    def _require_safe(self) -> None:
        """Refuses what leaves this computer without certificates, as the daemon's gRPC is refused without TLS."""
        _require(
            not (self.connect and self.means is not Scouting.NONE), "scouting", "with routers (connect) leave it out"
        )
        _require(self.connect or self.means is not Scouting.NONE, "connect", "no router, and no scouting: no network")
        if self.means is Scouting.LAN:
            _require(self.has_certificate, "scouting", f"lan {_REACHED}")
            _require(
                self.publishers, "publishers", "scouting on the LAN has no router that checks names: list the UAVs"
            )
        for endpoint in self.connect:
            protocol, _, address = endpoint.partition("/")
            if exposed([address]):
                _require(self.has_certificate and protocol in _ENCRYPTED, "connect", f"{endpoint} {_REACHED}")


_REACHED = (
    "leaves this computer, where strangers could listen and publish: give certificate, key and authority "
    "(`ual certificates network` makes them), and tls/HOST:PORT"
)


def read(config: NetworkSettings | str | Path) -> NetworkSettings:
    """Returns the settings of a file; `LOOPBACK` stands for those without one.

    Raises:
        InvalidArgumentError: The file cannot be read, or a value is not valid. The message names the file and the key.
        NotSupportedError: PyYAML is missing.

    """
    if isinstance(config, NetworkSettings):
        return config
    if str(config) == LOOPBACK:
        return NetworkSettings()
    path = Path(config)
    try:
        return from_values(_values(path), path.parent)
    except InvalidArgumentError as error:
        raise InvalidArgumentError(f"{path}: {error.message}", error.metadata) from None


def from_values(values: Mapping[str, Any], directory: Path) -> NetworkSettings:
    """Returns the settings of the values of a file; paths in it start from its directory.

    Raises:
        InvalidArgumentError: See `read`.

    """
    unknown = sorted(str(key) for key in values if key not in _READERS)
    if unknown:
        raise InvalidArgumentError(f"there is no key {unknown[0]!r}: {', '.join(_READERS)}", {"field": unknown[0]})
    read_values = {name: _READERS[name](name, value) for name, value in values.items()}
    paths = {name: directory / value for name, value in read_values.items() if isinstance(value, Path)}
    return NetworkSettings(**{**read_values, **paths})


def _values(path: Path) -> Mapping[str, Any]:
    with extras.needs("the file of the network", "ual-client[network]"):
        from ual.shared import strict_yaml
    try:
        values = strict_yaml.value(strict_yaml.read(bounded_file.read(path)))
    except OSError as error:
        raise InvalidArgumentError(f"cannot be read: {error.strerror}", {"field": "network"}) from None
    except strict_yaml.YamlError as error:
        raise InvalidArgumentError(f"line {error.line}: {error}", {"field": "network"}) from None
    if not isinstance(values, Mapping):
        raise InvalidArgumentError("expected settings as 'key: value' lines", {"field": "network"})
    return values


def _require(is_fine: object, field: str, text: str) -> None:
    if not is_fine:
        raise InvalidArgumentError(f"{field}: {text}", {"field": field})


def _require_endpoint(endpoint: str) -> None:
    match = _ENDPOINT.fullmatch(endpoint)
    _require(
        match and match["protocol"] in _PROTOCOLS and 0 < int(match["port"]) <= LAST_PORT,
        "connect",
        f"{endpoint!r} is no router: tls/HOST:PORT, or tcp/127.0.0.1:PORT on this computer",
    )


def _text(name: str, value: object) -> str:
    _require(isinstance(value, str), name, f"expected text, got {value!r:.60}")
    return str(value)


def _texts(name: str, value: object) -> tuple[str, ...]:
    _require(isinstance(value, Sequence) and not isinstance(value, str), name, f"expected a list, got {value!r:.60}")
    assert isinstance(value, Sequence)
    return tuple(_text(name, each) for each in value)


def _number(name: str, value: object) -> float:
    _require(
        isinstance(value, (int, float)) and not isinstance(value, bool), name, f"expected a number, got {value!r:.60}"
    )
    assert isinstance(value, (int, float))
    return float(value)


def _whole(name: str, value: object) -> int:
    _require(
        isinstance(value, int) and not isinstance(value, bool), name, f"expected a whole number, got {value!r:.60}"
    )
    assert isinstance(value, int)
    return value


def _path(name: str, value: object) -> Path:
    return Path(_text(name, value))


def _scouting(name: str, value: object) -> Scouting:
    known = {each.value: each for each in Scouting}
    _require(_text(name, value) in known, name, f"{value!r} is none of {', '.join(known)}")
    return known[str(value)]


_READERS: Mapping[str, Callable[[str, object], Any]] = {
    "site": _text,
    "connect": _texts,
    "scouting": _scouting,
    "scouting_port": _whole,
    "certificate": _path,
    "key": _path,
    "authority": _path,
    "publishers": _texts,
    "host": _text,
    "rate_hz": _number,
}
assert set(_READERS) == {each.name for each in fields(NetworkSettings)}
