"""Finds docstrings that begin with a relative clause: ``python -m tests.openings`` lists them with proposals.

A docstring begins with a noun phrase or, for a function, with a verb. It looks at the files that are named, or at all.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from tests.sentences import ROOT, docstrings, statements

FOLDERS = ("ual_daemon", "clients", "tools", "benchmarks", "examples", "deploy", "tests")
_NOT_OURS = re.compile(r"_pb2|/(?:\.venv|build|dist|gen|node_modules)/")

_PROPOSALS = {
    r"What|Which|Those|That|The ones?": "name the thing: 'Fence values cached under `key`.'",
    r"Who|Whom|Whose": "name the owner: 'Holder of the lease.'",
    r"How (?:many|much|often)": "count or measure: 'Samples that slow readers have missed.', 'Seconds between …'",
    r"How": "name the measure or the manner: 'Age of the sample in s.', 'Encoding of a picture.'",
    r"When": "name the time, or the condition: 'Time of the last message.'",
    r"Where": "name the place: 'Address of the server.', 'Position in the local frame.'",
    r"(?:For |After |Within |By |Up to )?[Ss]o (?:long|many|much|often|far|near|late|soon|fast|small|large)": (
        "name the number with its unit: 'Seconds without progress after which a transfer is given up.'"
    ),
    r"(?:By|For|From|To|In|On|With|At|After|Until) (?:which|whom|whose|what)": "name the thing: 'Clock of the times.'",
}
_OPENING = re.compile("|".join(f"(?P<p{number}>{opening})\\b" for number, opening in enumerate(_PROPOSALS)))
_OF_A_FUNCTION = re.compile(r"Whether\b")
_SUSPECT = re.compile(r'["\']\s*(?:' + "|".join((*_PROPOSALS, "Whether")) + r")\b")
_RETURNS_WHETHER = "begin with the verb: 'Returns whether …' (a property or an attribute may begin with 'Whether')"


class Opening(NamedTuple):
    """A docstring's beginning that is forbidden: its line, the first words, and a proposal."""

    line: int
    words: str
    proposal: str


def of_module(text: str) -> list[Opening]:
    """Returns the forbidden beginnings of a module's docstrings."""
    if not _SUSPECT.search(text):
        return []  # to parse takes most of the time
    found = list(statements(ast.parse(text)))
    of_functions = set(_function_rows(found))
    return [
        Opening(line, " ".join(said.split()[:8]), proposal)
        for line, said in docstrings(found)
        if (proposal := _proposal(said.strip(), is_functions=line in of_functions))
    ]


def _proposal(said: str, *, is_functions: bool) -> str:
    """Returns how to begin instead; empty where the beginning is allowed."""
    if is_functions and _OF_A_FUNCTION.match(said):
        return _RETURNS_WHETHER
    found = _OPENING.match(said)
    return list(_PROPOSALS.values())[int(str(found.lastgroup)[1:])] if found else ""


def _function_rows(found: Iterable[ast.stmt]) -> Iterator[int]:
    """Yields the lines of the docstrings of functions; properties and fixtures are read as nouns."""
    for node in found:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and not _is_noun(node):
            yield node.body[0].lineno


def _is_noun(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Returns whether a decorator makes the function a property or a fixture."""
    names = [ast.unparse(each) for each in node.decorator_list]
    return any("property" in name or "fixture" in name for name in names)


def files() -> list[Path]:
    """Returns all modules whose docstrings are checked."""
    found = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
    return sorted(path for path in found if not _NOT_OURS.search(f"/{path.relative_to(ROOT).as_posix()}"))


def main() -> None:
    """Prints the forbidden beginnings."""
    for path in [Path(name).resolve() for name in sys.argv[1:]] or files():
        for each in of_module(path.read_text(encoding="utf-8")):
            print(f"{path.relative_to(ROOT)}:{each.line}: {each.words} … → {each.proposal}")


if __name__ == "__main__":
    main()
