"""The daemon's configuration: flags over environment over the file over defaults, and where each value came from.

A configuration is one mapping: the daemon's own settings (`DaemonSettings`), those of the vehicle
(`ual_daemon.settings.VehicleSettings`), and one section for each backend, handed to it as it is. Whatever is wrong
becomes one line that names the place: ``uav.yaml:7: limits.climb_speed_m_s: Expected `float` > 0.0``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from ual import _discovery
from ual_daemon.settings import NAMESPACE_PATTERN, ConfigError, NotNegative, Settings, VehicleSettings, convert


class DaemonSettings(Settings, frozen=True, kw_only=True):
    """What the daemon's flags say; each is a key of the file, too."""

    backend: str = "light"
    ns: Annotated[str, Meta(pattern=NAMESPACE_PATTERN)] = "uav_1"
    fleet: Annotated[int, Meta(ge=1)] | None = None
    fleet_spacing_m: NotNegative = 3.0
    url: str | None = None
    listen: tuple[str, ...] = ()
    insecure: bool = False
    tls_certificate: str | None = None
    tls_key: str | None = None
    allow_arming: bool = False
    auto_arm: bool = False
    transport: Literal["auto", "core", "aio"] = "auto"
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    log_format: Literal["text", "json"] = "text"


class ConfigurationError(Exception):
    """The configuration cannot be taken; the message is one line that names the place and the key."""


@dataclass(frozen=True, slots=True)
class Configuration:
    """What the daemon is to do: its own settings, the vehicle's, and each backend's as they were given."""

    daemon: DaemonSettings
    vehicle: VehicleSettings
    backends: Mapping[str, Mapping[str, Any]]

    @property
    def listen(self) -> tuple[str, ...]:
        """The addresses to listen on, for a fleet as templates (`ual_daemon.program.fleet.addresses`). The default
        follows from the namespace.
        """
        if self.daemon.fleet is not None:
            return self.daemon.listen or (f"{_discovery.LOOPBACK}:{{port}}",)
        return self.daemon.listen or (_discovery.default_address(self.daemon.ns),)

    def as_yaml(self) -> str:
        """The same configuration as a file. Limits that are infinite, which is none at all, are left out."""
        values = {
            **msgspec.to_builtins(self.daemon),
            "listen": list(self.listen),
            **msgspec.to_builtins(self.vehicle),
            **{name: dict(section) for name, section in self.backends.items()},
        }
        values["limits"] = {name: limit for name, limit in values["limits"].items() if math.isfinite(limit)}
        from ual_daemon.program import (
            configuration_yaml,  # YAML is read, and so loaded, only where it is used: a faster start
        )

        return configuration_yaml.dump(values)


@dataclass(frozen=True, slots=True)
class Source:
    """Values from one place."""

    values: Mapping[str, Any]

    def describe(self, error: ConfigError) -> str:
        """The error with the place of its key in this source."""
        return str(error)


@dataclass(frozen=True, slots=True)
class FlagSource(Source):
    """Values given by flags and environment variables, and the name of each by its key."""

    names: Mapping[str, str]

    def describe(self, error: ConfigError) -> str:
        name = next(name for key, name in self.names.items() if steps(error.key)[0] == steps(key)[0])
        return f"{name}: {error.message if error.key in self.names else error}"


def resolve(sources: Sequence[Source], known_backends: Collection[str]) -> Configuration:
    """The configuration that the sources make together, later ones winning. Raises `ConfigurationError`."""
    values: dict[str, Any] = {}
    for source in sources:
        values = _merged(values, source.values)
    daemon = {key: values.pop(key) for key in DaemonSettings.__struct_fields__ if key in values}
    vehicle = {key: values.pop(key) for key in VehicleSettings.__struct_fields__ if key in values}
    try:
        return Configuration(
            daemon=convert(daemon, DaemonSettings),
            vehicle=convert(vehicle, VehicleSettings),
            backends={name: _section(name, section, known_backends) for name, section in values.items()},
        )
    except ConfigError as error:
        raise located(error, sources) from None


def _section(name: str, section: object, known_backends: Collection[str]) -> Mapping[str, Any]:
    if name not in known_backends:
        known = ", ".join(sorted(known_backends))
        raise ConfigError(f"there is no such setting, and no backend of that name (known: {known})", name)
    if not isinstance(section, Mapping):
        raise ConfigError(f"expected the settings of the backend, got {section!r}", name)
    return section


def located(error: ConfigError, sources: Sequence[Source]) -> ConfigurationError:
    """The error with the place where its key was given: the last source that has it, as that one won."""
    for source in reversed(sources):
        if _has(source.values, error.key):
            return ConfigurationError(source.describe(error))
    return ConfigurationError(str(error))


def nested(key: str, value: object) -> dict[str, Any]:
    """A dotted key and its value as mappings within each other."""
    for part in reversed(key.split(".")):
        value = {part: value}
    assert isinstance(value, dict)
    return value


def steps(key: str) -> list[str | int]:
    """``frames[0].frame_id`` as ``["frames", 0, "frame_id"]``."""
    return [int(part[1:-1]) if part.startswith("[") else part for part in re.findall(r"\[\d+\]|[^.\[\]]+", key)]


def _has(values: Mapping[str, Any], key: str) -> bool:
    """True where as much of the key is there as any source can have: what is missing in a section belongs to it."""
    path = steps(key)
    return bool(path) and path[0] in values


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """The mappings as one; where both have a mapping these become one, else the upper value wins."""
    result = dict(below)
    for key, value in above.items():
        old = result.get(key)
        result[key] = _merged(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return result
