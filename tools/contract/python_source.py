"""Python sources that are written by hand, as the generators read them."""

from __future__ import annotations

import ast
from functools import lru_cache
from pathlib import Path


@lru_cache
def parsed(path: Path) -> ast.Module:
    """Returns a module; an empty one where there is none."""
    return ast.parse(path.read_text(encoding="utf-8") if path.exists() else "")


def classes(path: Path) -> dict[str, ast.ClassDef]:
    """Returns the classes of a module, by name."""
    return {node.name: node for node in parsed(path).body if isinstance(node, ast.ClassDef)}


def functions(owner: ast.Module | ast.ClassDef) -> dict[str, ast.FunctionDef]:
    """Returns the public functions of a module or a class, by name."""
    found = (node for node in owner.body if isinstance(node, ast.FunctionDef))
    return {node.name: node for node in found if not node.name.startswith("_")}


def names_in(source: str) -> set[str]:
    """Returns the names that a source uses."""
    return {node.id for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Name)}


def imports(path: Path, used: set[str]) -> str:
    """Returns the imports of names that a module has from elsewhere."""
    found = ""
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.ImportFrom) and node.module != "__future__":
            names = used.intersection(alias.name for alias in node.names if alias.asname is None)
            found += f"from {node.module} import {', '.join(sorted(names))}\n" * bool(names)
    return found
