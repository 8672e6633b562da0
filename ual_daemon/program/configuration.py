"""The daemon's configuration, and the source of each value: flags win over the environment, the environment over the
file, the file over the defaults.

A configuration is one mapping: the daemon's own settings (`DaemonSettings`), those of the vehicle
(`ual_daemon.settings.VehicleSettings`), and one section for each backend, which the backend checks. Every error is one
line that names its place: ``uav.yaml:7: limits.climb_speed_m_s: Expected `float` > 0.0``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta
from typing_extensions import override

from ual import discovery
from ual_daemon.settings import (
    NAMESPACE_PATTERN,
    ConfigError,
    NotNegative,
    Settings,
    VehicleSettings,
    convert,
    did_you_mean,
    keys,
)


class DaemonSettings(Settings, frozen=True, kw_only=True):
    """The settings that have flags; each is also a key of the file."""

    backend: str = "light"
    ns: Annotated[str, Meta(pattern=NAMESPACE_PATTERN)] = "uav_1"
    fleet: Annotated[int, Meta(ge=1)] | None = None
    fleet_spacing_m: NotNegative = 3.0
    fleet_url: tuple[str, ...] = ()
    workers: Annotated[int, Meta(ge=1)] | Literal["auto"] | None = None
    url: str | None = None
    listen: tuple[str, ...] = ()
    insecure: bool = False
    tls_certificate: str | None = None
    tls_key: str | None = None
    tls_client_ca: str | None = None
    tokens: str | None = None
    roles: str | None = None
    audit: str | None = None
    audit_required: bool = False
    network: str | None = None
    allow_arming: bool = False
    auto_arm: bool = False
    watch_only: bool = False
    record: str | None = None
    record_raw: bool = False
    record_pictures: bool = False
    record_file_mib: Annotated[int, Meta(ge=1)] = 1024
    record_file_minutes: Annotated[float, Meta(gt=0.0)] = 60.0
    metrics: str | None = None
    transport: Literal["auto", "core", "aio"] = "auto"
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    log_format: Literal["text", "json"] = "text"


class ConfigurationError(Exception):
    """The configuration is not valid; the message is one line that names the place and the key."""


@dataclass(frozen=True, slots=True)
class Configuration:
    """The daemon's settings, the vehicle's, and each backend's as they were given."""

    daemon: DaemonSettings
    vehicle: VehicleSettings
    backends: Mapping[str, Mapping[str, Any]]
    extensions: Mapping[str, Any]
    """The extensions to load, each with its settings."""

    @property
    def is_fleet(self) -> bool:
        """Whether this daemon flies several UAVs."""
        return self.daemon.fleet is not None or bool(self.daemon.fleet_url)

    @property
    def listen(self) -> tuple[str, ...]:
        """The addresses to listen on; for a fleet these are templates (`ual_daemon.program.fleet.addresses`). The
        default depends on the namespace.
        """
        if self.is_fleet:
            return self.daemon.listen or (f"{discovery.LOOPBACK}:{{port}}",)
        return self.daemon.listen or (discovery.default_address(self.daemon.ns),)

    def defaults(self) -> dict[str, Any]:
        """Returns the values of a file that says which UAV it is, and no more."""
        which = DaemonSettings(backend=self.daemon.backend, ns=self.daemon.ns)
        values = Configuration(which, VehicleSettings(), {}, {}).as_values()
        return {name: value for name, value in values.items() if name not in ("backend", "ns")}

    def as_values(self) -> dict[str, Any]:
        """Returns the same configuration as the values of a file. Leaves out infinite limits: they mean no limit."""
        values = {
            **msgspec.to_builtins(self.daemon),
            "listen": list(self.listen),
            **msgspec.to_builtins(self.vehicle),
            **({"extensions": dict(self.extensions)} if self.extensions else {}),
            **{name: dict(section) for name, section in self.backends.items()},
        }
        values["limits"] = {name: limit for name, limit in values["limits"].items() if math.isfinite(limit)}
        return values


@dataclass(frozen=True, slots=True)
class ValuesSource:
    """Values from one source."""

    values: Mapping[str, Any]

    def describe(self, error: ConfigError) -> str:
        """Returns the error as text, with the place of its key in this source."""
        return str(error)


@dataclass(frozen=True, slots=True)
class FlagSource(ValuesSource):
    """Values given by flags and environment variables, and the name of each by its key."""

    names: Mapping[str, str]

    @override
    def describe(self, error: ConfigError) -> str:
        name = next(name for key, name in self.names.items() if steps(error.key)[0] == steps(key)[0])
        return f"{name}: {error.message if error.key in self.names else error}"


def resolve(sources: Sequence[ValuesSource], known_backends: Collection[str]) -> Configuration:
    """Merges the sources into one configuration; later sources win.

    Raises:
        ConfigurationError: A value is not valid.
    """
    values: dict[str, Any] = {}
    for source in sources:
        values = _merged(values, source.values)
    daemon = {key: values.pop(key) for key in (*DaemonSettings.__struct_fields__, "extension") if key in values}
    vehicle = {key: values.pop(key) for key in VehicleSettings.__struct_fields__ if key in values}
    try:
        extensions = _extensions(values.pop("extensions", None), daemon.pop("extension", ()))
        return Configuration(
            daemon=convert(daemon, DaemonSettings),
            vehicle=convert(vehicle, VehicleSettings),
            extensions=extensions,
            backends={name: _section(name, section, known_backends) for name, section in values.items()},
        )
    except ConfigError as error:
        raise located(error, sources) from None


def _extensions(sections: object, named: Sequence[str]) -> Mapping[str, Any]:
    """Returns the extensions of the section, and those that are named by flags, without settings."""
    sections = {} if sections is None else sections
    if not isinstance(sections, Mapping):
        raise ConfigError(f"expected a section for each extension, got {sections!r:.60}", "extensions")
    return {**dict.fromkeys(named), **sections}


def _section(name: str, section: object, known_backends: Collection[str]) -> Mapping[str, Any]:
    if name not in known_backends:
        known = ", ".join(sorted(known_backends))
        meant = did_you_mean(name, (*keys(DaemonSettings), *keys(VehicleSettings), *known_backends))
        raise ConfigError(f"there is no setting and no backend with this name (backends: {known}){meant}", name)
    if not isinstance(section, Mapping):
        raise ConfigError(f"expected the settings of the backend, got {section!r}", name)
    return section


def located(error: ConfigError, sources: Sequence[ValuesSource]) -> ConfigurationError:
    """Returns the error with the place where its key was given: the last source that has the key, because that won."""
    for source in reversed(sources):
        if _has(source.values, error.key):
            return ConfigurationError(source.describe(error))
    return ConfigurationError(str(error))


def nested(key: str, value: object) -> dict[str, Any]:
    """Returns a dotted key and its value as nested mappings."""
    for part in reversed(key.split(".")):
        value = {part: value}
    assert isinstance(value, dict)
    return value


def steps(key: str) -> list[str | int]:
    """Splits ``frames[0].frame_id`` into ``["frames", 0, "frame_id"]``."""
    return [int(part[1:-1]) if part.startswith("[") else part for part in re.findall(r"\[\d+\]|[^.\[\]]+", key)]


def _has(values: Mapping[str, Any], key: str) -> bool:
    """Returns whether the key's first part is there. An error about a key that is missing belongs to its section's
    source.
    """
    path = steps(key)
    return bool(path) and path[0] in values


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Merges two mappings, and the mappings within them; any other value of `above` replaces that of `below`."""
    result = dict(below)
    for key, value in above.items():
        old = result.get(key)
        result[key] = _merged(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return result
