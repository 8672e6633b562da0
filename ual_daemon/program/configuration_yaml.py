"""Reads configuration in YAML, files and single values of the command line, and finds the line of each key."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from textwrap import indent
from typing import Any

import yaml
from typing_extensions import override

from ual.shared import bounded_file, strict_yaml
from ual_daemon.program.configuration import ConfigurationError, ValuesSource, steps
from ual_daemon.settings import ConfigError


@dataclass(frozen=True, slots=True)
class FileSource(ValuesSource):
    """The values of a file."""

    path: Path
    root: yaml.Node | None

    @override
    def describe(self, error: ConfigError) -> str:
        return f"{self.path}:{_row_of(self.root, error.key)}: {error}"


def dump(values: Mapping[str, Any], defaults: Mapping[str, Any]) -> str:
    """Returns the values as the text of a file, defaults as comments.

    A file that sets a default keeps it when a release changes it. An older release refuses it.
    """
    return "".join(_entry(key, value, defaults) for key, value in values.items())


def _entry(key: str, value: object, defaults: Mapping[str, Any]) -> str:
    default = defaults.get(key)
    if isinstance(value, Mapping) and isinstance(default, Mapping) and value != default:
        return f"{key}:\n{indent(dump(value, default), '  ')}"
    text = yaml.safe_dump({key: _plain(value)}, sort_keys=False, allow_unicode=True)
    return indent(text, "# ") if key in defaults and value == default else text


def assignment(text: str, name: str) -> tuple[str, Any]:
    """Splits ``key=value`` and reads the value as in a file. `name` is the flag or variable that gave it, for errors.

    Raises:
        ConfigurationError: The text is not ``key=value``, or the value is not valid YAML.
    """
    key, equals, value = text.partition("=")
    if not equals or not all(re.fullmatch(r"\w+", part) for part in key.split(".")):
        raise ConfigurationError(f"{name}: expected KEY=VALUE, as limits.climb_speed_m_s=2, got {text!r}")
    try:
        return key, strict_yaml.value(strict_yaml.parse(value))
    except strict_yaml.YamlError as error:
        raise ConfigurationError(f"{name} {key}: {error}") from None


def read_file(path: Path) -> FileSource:
    """Reads a YAML file.

    Raises:
        ConfigurationError: The file cannot be read or is not valid; the message has the line.
    """
    try:
        data = bounded_file.read(path)
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error.strerror}") from None
    node, values = _read_data(data, f"{path}:")
    return FileSource(values, path, node)


def read_text(data: bytes) -> dict[str, Any]:
    """Returns the values of the content of a YAML file.

    Raises:
        ConfigurationError: It is not valid; the message begins with ``line`` and its number.
    """
    return _read_data(data, "line ")[1]


def _read_data(data: bytes, before_line: str) -> tuple[yaml.Node | None, dict[str, Any]]:
    try:
        node = strict_yaml.read(data)
        values = strict_yaml.value(node)
    except strict_yaml.YamlError as error:
        raise ConfigurationError(f"{before_line}{error.line}: {error}") from None
    if values is None:
        values = {}
    if not isinstance(values, dict):
        raise ConfigurationError(f"{before_line}1: expected settings as 'key: value' lines, got {values!r:.60}")
    return node, values


def _row_of(node: yaml.Node | None, key: str) -> int:
    """Returns the line of a key, or the line of the value around it if the key is missing."""
    line = 1
    for step in steps(key):
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


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {key: _plain(inner) for key, inner in value.items()}
    return [_plain(inner) for inner in value] if isinstance(value, (list, tuple)) else value
