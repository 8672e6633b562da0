"""Finds words of a private dialect in names of modules, classes and functions: ``python -m tests.names`` lists them.

Each of these words stands for many things, so that a name with it does not say which one. A name has the noun of what
it is, or the verb of what it does: `parse_address` and not `parse_place`.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.openings import files
from tests.sentences import ROOT

PROPOSALS = {
    "told": "reported, report_of",
    "said": "status_text, reported",
    "heard": "received, subscribed",
    "seen": "observed, noticed",
    "given": "passed, issued; given up: abandoned",
    "asked": "requested, queried",
    "judged": "assessed, estimated",
    "flown": "executed, followed, is_in_control",
    "offered": "available, driver",
    "beside": "services, next_to, offset",
    "way": "path, route, direction; on its way: en_route; under way: in_progress",
    "ways": "variants, paths",
    "place": "position, address",
    "places": "positions, addresses",
    "reach": "range, distance_limit",
    "desk": "entrance, queue",
    "line": "row, path, link, message",
    "lines": "rows, paths, messages",
    "look": "poll, update, check",
    "looks": "points, poll",
}
KEPT = re.compile(r"place_on_ground|PlaceOnGround|^(test_)?lines$")
"""The contract keeps its names, and what is derived from it has them. `tools/lines.py` counts lines."""
RENAMED = {"ual_daemon/backends/engine/command_desk.py", "ual_daemon/backends/judged.py"}
"""Old names of modules, which warn until 0.4."""
_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")


class Name(NamedTuple):
    """A name with a word that is not used: its line (0: the module itself), the name, and the word."""

    line: int
    name: str
    word: str


def of_module(path: Path, text: str) -> list[Name]:
    """Returns the names that have such a word: of the module, its folder, its classes and its functions."""
    folder = path.parent.name if path.name == "__init__.py" else ""
    named = [(0, folder or path.stem), *_definitions(text)]
    return [Name(number, name, word) for number, name in named for word in dialect_of(name)]


def dialect_of(name: str) -> list[str]:
    """Returns the words of a name that are not used in names."""
    words = [word.lower() for word in _WORDS.findall(KEPT.sub("", name))]
    return [word for word in words if word in PROPOSALS]


def _definitions(text: str) -> Iterator[tuple[int, str]]:
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.lineno, node.name


def all_found() -> list[str]:
    """Returns, human-readable, all names that have such a word, with proposals."""
    return [
        f"{path.relative_to(ROOT).as_posix()}:{each.line}: {each.name}: not `{each.word}` but: {PROPOSALS[each.word]}"
        for path in files()
        if path.relative_to(ROOT).as_posix() not in RENAMED
        for each in of_module(path, path.read_text(encoding="utf-8"))
    ]


def main() -> None:
    """Prints the names."""
    print(*all_found(), sep="\n")


if __name__ == "__main__":
    main()
