"""Reads YAML strictly: what it allows and a file written by hand should not have is refused, with its line. Needs
PyYAML.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import count
from typing import Any

import yaml
from typing_extensions import override

from ual.shared.text import sure_encoding

_MOST_NODES = 100_000
_MOST_LEVELS = 50


class YamlError(Exception):
    """The text is not accepted. `line` counts from 1."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


def read(data: bytes) -> yaml.Node | None:
    """Returns the nodes of a file's content; None where it is empty.

    Raises:
        YamlError: It is neither UTF-8 nor UTF-16, or not YAML. A key is given twice, or is no text. A value contains
            itself, is nested too deeply, or has too many values within.

    """
    try:
        return parse(data.decode(sure_encoding(data)))
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise YamlError(f"byte {data[error.start]:#04x} is not UTF-8 text", line) from None


def parse(text: str) -> yaml.Node | None:
    """Returns the nodes of a text; None where it is empty.

    Raises:
        YamlError: As in `read`.

    """
    try:
        loader = _Loader(text)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise YamlError(f"character {error.character:#06x} is not allowed", line) from None
    try:
        node: yaml.Node | None = loader.get_single_node()
    except RecursionError:
        raise YamlError("values are nested too deeply", loader.line + 1) from None
    except yaml.MarkedYAMLError as error:
        raise _refused(error) from None
    if node is not None:
        _check(node, count())
    return node


def value(node: yaml.Node | None) -> Any:  # noqa: ANN401  whatever the text says
    """Returns what some nodes mean: numbers, texts, lists, mappings.

    Raises:
        YamlError: A tag is not known, or its value does not fit it.

    """
    try:
        return None if node is None else _Loader("").construct_document(node)
    except yaml.MarkedYAMLError as error:
        raise _refused(error) from None


class _Loader(yaml.SafeLoader):
    """Reads scalars by the rules of YAML 1.2: ``1e3`` is a number, ``12:30`` and ``on`` are text."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012  as in the base class

    @override
    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        form = _NUMBERS.get(node.tag)
        if form and isinstance(node, yaml.ScalarNode) and not form.fullmatch(node.value):
            raise _unfit(node)  # the base class would read ``!!int 8_0`` and ``!!int 1:20``, as YAML 1.1 has them
        try:
            return super().construct_object(node, deep)
        except (ValueError, LookupError, AttributeError):
            # The base class raises these for a value that does not fit its explicit tag: ``!!timestamp x``.
            raise _unfit(node) from None


_INT = r"[-+]?(?:0|[1-9][0-9]*)|0o[0-7]+|0x[0-9a-fA-F]+"
_FLOAT = r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
_NUMBERS = {f"tag:yaml.org,2002:{name}": re.compile(form) for name, form in (("int", _INT), ("float", _FLOAT))}

for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ("~", "n", "N", "")),
    ("bool", r"true|True|TRUE|false|False|FALSE", tuple("tTfF")),
    ("int", _INT, tuple("-+0123456789")),
    ("float", _FLOAT, tuple("-+.0123456789")),
    ("merge", r"<<", ("<",)),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^(?:{_pattern})$"), list(_first))


def _check(node: yaml.Node, numbers: Iterator[int], path: str = "", above: tuple[yaml.Node, ...] = ()) -> None:
    """Refuses what `read` says of nodes. `numbers` counts the values, those of an alias each time."""
    if next(numbers) >= _MOST_NODES:
        message = f"more than {_MOST_NODES} values, those that aliases (*name) repeat included"
        raise YamlError(message, _row_number(node))
    if isinstance(node, yaml.ScalarNode):
        return
    if node in above:
        raise YamlError(f"{path}: the value contains itself", _row_number(node))
    if len(above) >= _MOST_LEVELS:
        raise YamlError("values are nested too deeply", _row_number(node))
    for key, inner in _within(node, path):
        _check(inner, numbers, key, (*above, node))


def _within(node: yaml.Node, path: str) -> Iterator[tuple[str, yaml.Node]]:
    """Yields the values of a list or a mapping, each with its key."""
    if isinstance(node, yaml.SequenceNode):
        yield from ((f"{path}[{index}]", inner) for index, inner in enumerate(node.value))
    elif isinstance(node, yaml.MappingNode):
        lines: dict[str, int] = {}
        for key, inner in node.value:
            if not isinstance(key, yaml.ScalarNode) or not key.tag.endswith((":str", ":merge")):
                raise YamlError("a key must be text", _row_number(key))
            name = f"{path}.{key.value}".lstrip(".")
            if key.value in lines:
                raise YamlError(f"{name}: given twice, first in line {lines[key.value]}", _row_number(key))
            lines[key.value] = _row_number(key)
            yield name, inner


def _unfit(node: yaml.Node) -> YamlError:
    kind = node.tag.rpartition(":")[2]
    return YamlError(f"{node.value!r:.40} is not a valid {kind}", _row_number(node))


def _refused(error: yaml.MarkedYAMLError) -> YamlError:
    mark = error.problem_mark or error.context_mark
    return YamlError("; ".join(part for part in (error.context, error.problem) if part), mark.line + 1 if mark else 1)


def _row_number(node: yaml.Node) -> int:
    return int(node.start_mark.line) + 1
