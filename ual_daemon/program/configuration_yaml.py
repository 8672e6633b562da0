"""Reads configuration in YAML, files and single values of the command line, and finds the line of each key."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import yaml
from typing_extensions import override

from ual_daemon.program.configuration import ConfigurationError, Source, steps
from ual_daemon.server import bounded_file
from ual_daemon.settings import ConfigError

_MOST_NODES = 100_000


@dataclass(frozen=True, slots=True)
class FileSource(Source):
    """The values of a file."""

    path: Path
    root: yaml.Node | None

    @override
    def describe(self, error: ConfigError) -> str:
        return f"{self.path}:{_line_of(self.root, error.key)}: {error}"


def dump(values: Mapping[str, Any]) -> str:
    """Returns the values as the text of a file."""
    return yaml.safe_dump(_plain(values), sort_keys=False, allow_unicode=True)


def assignment(text: str, name: str) -> tuple[str, Any]:
    """Splits ``key=value`` and reads the value as in a file. `name` is the flag or variable that gave it, for errors.

    Raises:
        ConfigurationError: The text is not ``key=value``, or the value is not valid YAML.
    """
    key, equals, value = text.partition("=")
    if not equals or not all(re.fullmatch(r"\w+", part) for part in key.split(".")):
        raise ConfigurationError(f"{name}: expected KEY=VALUE, as limits.climb_speed_m_s=2, got {text!r}")
    try:
        return key, _read(value)[1]
    except (yaml.YAMLError, _BadNodeError) as error:
        raise ConfigurationError(f"{name} {key}: {_yaml_message(error)}") from None


def read_file(path: Path) -> FileSource:
    """Reads a YAML file.

    Raises:
        ConfigurationError: The file cannot be read or is not valid; the message has the line.
    """
    try:
        data = bounded_file.read(path)
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error.strerror}") from None
    node, values = _read_data(data, str(path))
    return FileSource(values, path, node)


def read_text(data: bytes) -> dict[str, Any]:
    """Returns the values of the content of a YAML file.

    Raises:
        ConfigurationError: It is not valid; the message begins with ``line:`` and its number.
    """
    return _read_data(data, "line")[1]


def _read_data(data: bytes, path: str) -> tuple[yaml.Node | None, dict[str, Any]]:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigurationError(f"{path}:{line}: byte {data[error.start]:#04x} is not UTF-8 text") from None
    try:
        node, values = _read(text)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise ConfigurationError(f"{path}:{line}: character {error.character:#06x} is not allowed") from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{path}:{mark.line + 1}" if mark else path
        raise ConfigurationError(f"{place}: {_yaml_message(error)}") from None
    except _BadNodeError as error:
        raise ConfigurationError(f"{path}:{error.line}: {error}") from None
    if values is None:
        values = {}
    if not isinstance(values, dict):
        raise ConfigurationError(f"{path}:1: expected settings as 'key: value' lines, got {values!r:.60}")
    return node, values


def _read(text: str) -> tuple[yaml.Node | None, Any]:
    """Parses a text; returns its nodes and its values."""
    loader = _Loader(text)
    try:
        node = loader.get_single_node()
        _check_node(node, count())
        return node, None if node is None else loader.construct_document(node)
    except RecursionError:
        raise _BadNodeError("values are nested too deeply", loader.line + 1) from None


class _Loader(yaml.SafeLoader):
    """Reads scalars by the rules of YAML 1.2: ``1e3`` is a number, ``12:30`` and ``on`` are text."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012  as in the base class

    @override
    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep)
        except (ValueError, LookupError, AttributeError):
            # The base class raises these for a value that does not fit its explicit tag: ``!!int x``.
            kind = node.tag.rpartition(":")[2]
            raise _BadNodeError(f"{node.value!r:.40} is not a valid {kind}", node.start_mark.line + 1) from None


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
    """Something that YAML allows and a configuration does not."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


def _check_node(
    node: yaml.Node | None, numbers: Iterator[int], path: str = "", above: tuple[yaml.Node, ...] = ()
) -> None:
    """Refuses keys that are given twice, keys that are not text, and values that contain themselves or are too many.

    `numbers` counts the values, those of an alias each time.
    """
    if node is None:
        return
    if next(numbers) >= _MOST_NODES:
        message = f"more than {_MOST_NODES} values, those that aliases (*name) repeat included"
        raise _BadNodeError(message, node.start_mark.line + 1)
    if isinstance(node, yaml.ScalarNode):
        return
    if node in above:
        raise _BadNodeError(f"{path}: the value contains itself", node.start_mark.line + 1)
    if isinstance(node, yaml.SequenceNode):
        for index, inner in enumerate(node.value):
            _check_node(inner, numbers, f"{path}[{index}]", (*above, node))
    elif isinstance(node, yaml.MappingNode):
        lines: dict[str, int] = {}
        for key, inner in node.value:
            if not isinstance(key, yaml.ScalarNode) or not key.tag.endswith((":str", ":merge")):
                raise _BadNodeError("a key must be text", key.start_mark.line + 1)
            name, line = f"{path}.{key.value}".lstrip("."), key.start_mark.line + 1
            if key.value in lines:
                raise _BadNodeError(f"{name}: given twice, first in line {lines[key.value]}", line)
            lines[key.value] = line
            _check_node(inner, numbers, name, (*above, node))


def _yaml_message(error: Exception) -> str:
    if isinstance(error, yaml.MarkedYAMLError):
        return "; ".join(part for part in (error.context, error.problem) if part)
    return str(error)


def _line_of(node: yaml.Node | None, key: str) -> int:
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
