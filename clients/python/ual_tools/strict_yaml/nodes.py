"""The values of a YAML file, each by its kind, each error with its line. Needs PyYAML.

The nodes of the file are read, not the objects that YAML makes of them: so each value knows its line, and no tag of
the file can make anything.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import TypeVar

import yaml

from ual.shared import bounded_file, strict_yaml
from ual.shared.numbers import parse_number
from ual_tools.help import close, did_you_mean
from ual_tools.strict_yaml.loading import YamlFileError
from ual_tools.strict_yaml.placeholders import PlaceholderError, fill, is_one

E = TypeVar("E", bound=Enum)

_PLAIN = re.compile(r"[\w.+-]+")


@dataclass(frozen=True)
class Node:
    """A value of the file, and what its placeholders stand for."""

    path: Path
    node: yaml.Node
    key: str = ""
    line: int = 1
    names: Mapping[str, str] = field(default_factory=dict)

    def error(self, message: str) -> YamlFileError:
        """Returns the error with the place of this value."""
        return YamlFileError(f"{self.path}:{self.line}: {self.key + ': ' if self.key else ''}{message}")

    def named(self, names: Mapping[str, str]) -> Node:
        """Returns the same value with other placeholders."""
        return Node(self.path, self.node, self.key, self.line, names)

    def entries(self, known: Collection[str] | None = None) -> dict[str, Node]:
        """Returns the entries of a mapping.

        Raises:
            YamlFileError: It is not a mapping, or has a key that is not `known`.
        """
        if not isinstance(self.node, yaml.MappingNode):
            of = "" if known is None else f" ({', '.join(known)})"
            raise self.error(f"expected 'key: value' lines{of}")
        found: dict[str, Node] = {}
        for key, value in self.node.value:
            name = str(key.value)
            entry = Node(self.path, value, f"{self.key}.{name}".lstrip("."), key.start_mark.line + 1, self.names)
            if known is not None and name not in known:
                meant = did_you_mean(close(name, known)) or f" There are {', '.join(known)}."
                raise entry.error(f"there is no such key.{meant}")
            found[name] = entry
        return found

    def items(self) -> list[Node]:
        """Returns the values of a list.

        Raises:
            YamlFileError: It is not a list.
        """
        if not isinstance(self.node, yaml.SequenceNode):
            raise self.error("expected a list: a line that begins with '- ' for each")
        return [
            Node(self.path, value, f"{self.key}[{i}]", value.start_mark.line + 1, self.names)
            for i, value in enumerate(self.node.value)
        ]

    @property
    def is_list(self) -> bool:
        """Whether it is a list."""
        return isinstance(self.node, yaml.SequenceNode)

    @property
    def is_text(self) -> bool:
        """Whether it is a text or a number."""
        return isinstance(self.node, yaml.ScalarNode)

    def text(self) -> str:
        """Returns a text, with its placeholders filled in.

        Raises:
            YamlFileError: It is not a text, is empty, or has a placeholder that does not exist.
        """
        if not isinstance(self.node, yaml.ScalarNode) or self.node.tag.endswith(":null") or not self.node.value:
            raise self.error("expected a text")
        if any(character < " " and character not in "\t\n" for character in self.node.value):
            raise self.error("control characters are not allowed")
        return self._filled()

    def number(self, at_least: float = 0.0) -> float:
        """Returns a finite number.

        Raises:
            YamlFileError: It is not a number, or is below `at_least`.
        """
        try:
            value = parse_number(self.text())
        except ValueError:
            raise self.error(f"expected a number, got {self.text()!r}") from None
        if value < at_least:
            raise self.error(f"expected a number of at least {at_least:g}")
        return value

    def whole(self, at_least: int) -> int:
        """Returns a whole number.

        Raises:
            YamlFileError: It is not a whole number, or is below `at_least`.
        """
        value = self.number(at_least)
        if value != int(value):
            raise self.error("expected a whole number")
        return int(value)

    def boolean(self) -> bool:
        """Returns true or false.

        Raises:
            YamlFileError: It is neither.
        """
        text = self.text()
        if text not in ("true", "false"):
            raise self.error(f"expected true or false, got {text!r}")
        return text == "true"

    def choice(self, kind: type[E]) -> E:
        """Returns the member of `kind` with this value.

        Raises:
            YamlFileError: There is none.
        """
        text, known = self.text(), [str(each.value) for each in kind]
        if text not in known:
            raise self.error(f"expected {', '.join(known)}, got {text!r}.{did_you_mean(close(text, known))}")
        return kind(text)

    def flow(self) -> str:
        """Returns the value in one line of YAML that means the same, as ``--set KEY=VALUE`` of the daemon takes it.

        Raises:
            YamlFileError: A placeholder does not exist.
        """
        if isinstance(self.node, yaml.MappingNode):
            entries = self.entries().items()
            return "{" + ", ".join(f"{json.dumps(name)}: {value.flow()}" for name, value in entries) + "}"
        if self.is_list:
            return "[" + ", ".join(value.flow() for value in self.items()) + "]"
        assert isinstance(self.node, yaml.ScalarNode)
        text = self._filled()
        is_plain = self.node.style is None or is_one(self.node.value)
        return text if is_plain and (_PLAIN.fullmatch(text) or not text) else json.dumps(text, ensure_ascii=False)

    def _filled(self) -> str:
        try:
            return fill(str(self.node.value), self.names)
        except PlaceholderError as error:
            raise self.error(str(error)) from None


def read(path: Path) -> Node:
    """Reads a file.

    Raises:
        YamlFileError: It cannot be read, or is not YAML.
    """
    try:
        root = strict_yaml.read(bounded_file.read(path))
    except OSError as error:
        raise YamlFileError(f"{path}: cannot be read: {error.strerror}") from None
    except strict_yaml.YamlError as error:
        raise YamlFileError(f"{path}:{error.line}: {error}") from None
    if root is None:
        raise YamlFileError(f"{path}:1: the file is empty")
    return Node(path, root)
