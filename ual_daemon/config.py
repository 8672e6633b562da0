"""The daemon's configuration: flags over environment over the file over defaults, and where each value came from.

A configuration is one mapping: the daemon's own settings (`DaemonSettings`), those of the vehicle
(`ual_daemon.settings.VehicleSettings`), and one section for each backend, handed to it as it is. Whatever is wrong
becomes one line that names the place: ``uav.yaml:7: limits.climb_speed_m_s: Expected `float` > 0.0``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import yaml
from msgspec import Meta

from ual import discovery
from ual_daemon.settings import NAMESPACE_PATTERN, ConfigError, Settings, VehicleSettings, convert


class DaemonSettings(Settings, frozen=True, kw_only=True):
    """What the daemon's flags say; each is a key of the file, too."""

    backend: str = "light"
    ns: Annotated[str, Meta(pattern=NAMESPACE_PATTERN)] = "uav_1"
    url: str | None = None
    listen: tuple[str, ...] = ()
    insecure: bool = False
    tls_certificate: str | None = None
    tls_key: str | None = None
    allow_arming: bool = False
    auto_arm: bool = False
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
        """The addresses to listen on; the default follows from the namespace."""
        return self.daemon.listen or (discovery.default_address(self.daemon.ns),)

    def as_yaml(self) -> str:
        """The same configuration as a file. Limits that are infinite, which is none at all, are left out."""
        values = {
            **msgspec.to_builtins(self.daemon),
            "listen": list(self.listen),
            **msgspec.to_builtins(self.vehicle),
            **{name: dict(section) for name, section in self.backends.items()},
        }
        values["limits"] = {name: limit for name, limit in values["limits"].items() if math.isfinite(limit)}
        return yaml.safe_dump(_plain(values), sort_keys=False, allow_unicode=True)


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
        name = next(name for key, name in self.names.items() if _steps(error.key)[0] == _steps(key)[0])
        return f"{name}: {error.message if error.key in self.names else error}"


@dataclass(frozen=True, slots=True)
class FileSource(Source):
    """The values of a file."""

    path: Path
    root: yaml.Node | None

    def describe(self, error: ConfigError) -> str:
        return f"{self.path}:{_line_of(self.root, error.key)}: {error}"


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


def assignment(text: str, name: str) -> tuple[str, Any]:
    """The key and the value of a ``key=value``, the value read as in the file. `name` is how it was given."""
    key, equals, value = text.partition("=")
    if not equals or not all(re.fullmatch(r"\w+", part) for part in key.split(".")):
        raise ConfigurationError(f"{name}: expected KEY=VALUE, as limits.climb_speed_m_s=2, got {text!r}")
    try:
        loader = _Loader(value)
        node = loader.get_single_node()
        _check_node(node)
        return key, None if node is None else loader.construct_document(node)
    except (yaml.YAMLError, _BadNodeError) as error:
        raise ConfigurationError(f"{name} {key}: {_yaml_message(error)}") from None


def nested(key: str, value: object) -> dict[str, Any]:
    """A dotted key and its value as mappings within each other."""
    for part in reversed(key.split(".")):
        value = {part: value}
    assert isinstance(value, dict)
    return value


def read_file(path: Path) -> FileSource:
    """The values of a YAML file. Raises `ConfigurationError`, with the line."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error.strerror}") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigurationError(f"{path}:{line}: byte {data[error.start]:#04x} is not UTF-8 text") from None
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        _check_node(node)
        values = {} if node is None else loader.construct_document(node)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise ConfigurationError(f"{path}:{line}: character {error.character:#06x} is not allowed") from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{path}:{mark.line + 1}" if mark else str(path)
        raise ConfigurationError(f"{place}: {_yaml_message(error)}") from None
    except _BadNodeError as error:
        raise ConfigurationError(f"{path}:{error.line}: {error}") from None
    if values is None:
        values = {}
    if not isinstance(values, dict):
        raise ConfigurationError(f"{path}:1: expected settings as 'key: value' lines, got {values!r:.60}")
    return FileSource(values, path, node)


class _Loader(yaml.SafeLoader):
    """Reads scalars as YAML 1.2 does: ``1e3`` is a number, ``12:30`` and ``on`` are text."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012  as in the base class


for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ("~", "n", "N", "")),
    ("bool", r"true|True|TRUE|false|False|FALSE", tuple("tTfF")),
    ("int", r"[-+]?(?:0|[1-9][0-9]*)|0o[0-7]+|0x[0-9a-fA-F]+", tuple("-+0123456789")),
    (
        "float",
        r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        tuple("-+.0123456789"),
    ),
    ("merge", r"<<", ("<",)),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^(?:{_pattern})$"), list(_first))


class _BadNodeError(Exception):
    """YAML allows it, a configuration does not."""

    def __init__(self, message: str, node: yaml.Node) -> None:
        super().__init__(message)
        self.line: int = node.start_mark.line + 1


def _check_node(node: yaml.Node | None, path: str = "", above: tuple[yaml.Node, ...] = ()) -> None:
    """Refuses keys given twice, keys that are not text, and values that contain themselves."""
    if node is None or isinstance(node, yaml.ScalarNode):
        return
    if node in above:
        raise _BadNodeError(f"{path}: the value contains itself", node)
    if isinstance(node, yaml.SequenceNode):
        for index, inner in enumerate(node.value):
            _check_node(inner, f"{path}[{index}]", (*above, node))
    elif isinstance(node, yaml.MappingNode):
        lines: dict[str, int] = {}
        for key, inner in node.value:
            if not isinstance(key, yaml.ScalarNode) or not key.tag.endswith((":str", ":merge")):
                raise _BadNodeError("a key must be text", key)
            name = f"{path}.{key.value}".lstrip(".")
            if key.value in lines:
                raise _BadNodeError(f"{name}: given twice, first in line {lines[key.value]}", key)
            lines[key.value] = key.start_mark.line + 1
            _check_node(inner, name, (*above, node))


def _yaml_message(error: Exception) -> str:
    if isinstance(error, yaml.MarkedYAMLError):
        return "; ".join(part for part in (error.context, error.problem) if part)
    return str(error)


def _steps(key: str) -> list[str | int]:
    """``frames[0].frame_id`` as ``["frames", 0, "frame_id"]``."""
    return [int(part[1:-1]) if part.startswith("[") else part for part in re.findall(r"\[\d+\]|[^.\[\]]+", key)]


def _line_of(node: yaml.Node | None, key: str) -> int:
    """The line where a key stands; that of what is around it where it has none of its own."""
    line = 1
    for step in _steps(key):
        if isinstance(step, int) and isinstance(node, yaml.SequenceNode) and step < len(node.value):
            node = node.value[step]
            line = node.start_mark.line + 1
            continue
        found = next((pair for pair in _pairs(node) if pair[0].value == step), None)
        if found is None:
            break
        line, node = found[0].start_mark.line + 1, found[1]
    return line


def _pairs(node: yaml.Node | None) -> Iterator[tuple[yaml.Node, yaml.Node]]:
    return iter(node.value if isinstance(node, yaml.MappingNode) else ())


def _has(values: Mapping[str, Any], key: str) -> bool:
    """True where as much of the key is there as any source can have: what is missing in a section belongs to it."""
    steps = _steps(key)
    return bool(steps) and steps[0] in values


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """The mappings as one; where both have a mapping these become one, else the upper value wins."""
    result = dict(below)
    for key, value in above.items():
        old = result.get(key)
        result[key] = _merged(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return result


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {key: _plain(inner) for key, inner in value.items()}
    return [_plain(inner) for inner in value] if isinstance(value, (list, tuple)) else value
