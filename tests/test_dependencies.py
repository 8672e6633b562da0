"""Imports of our packages are their declared dependencies: another package's own dependency may be gone in its next
version.
"""

from __future__ import annotations

import ast
import re
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from tests.sentences import statements

ROOT = Path(__file__).parents[1]


def imported(package: Path) -> set[str]:
    """The names of the packages that it imports, those of the standard library left out."""
    found = set()
    for file in package.rglob("*.py"):
        for node in statements(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {each.name for each in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module is not None:
                found.add(node.module)
    return {name.partition(".")[0] for name in found} - sys.stdlib_module_names


def requested(pyproject: Path) -> set[str]:
    """The names of the distributions that it asks for, always or as an extra."""
    text = pyproject.read_text(encoding="utf-8").partition("\ndev = [")[0]
    return {name.lower() for name in re.findall(r'"([A-Za-z0-9-]+)\s*[=><]', text)}


@pytest.mark.parametrize(
    ("project", "package"), [(".", "ual_daemon"), ("clients/python", "ual"), ("clients/python/ual_tools", "ual_tools")]
)
def test_what_is_imported_is_requested(project: str, package: str) -> None:
    known = {"ual": ["ual-client"], **packages_distributions()}
    declared = requested(ROOT / project / "pyproject.toml") | {package.replace("_", "-")}
    missing = {
        name
        for name in imported(ROOT / project / package)
        if not declared & {each.lower().replace("_", "-") for each in (name, *known.get(name, ()))}
    }
    assert not missing
