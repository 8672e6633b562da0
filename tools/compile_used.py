"""Compiles what `ual-daemon` and `ual` import, so that no start compiles it: ``python tools/compile_used.py``.

Python keeps a compiled module only where it may write beside its source. Elsewhere (``PYTHONDONTWRITEBYTECODE``, a
read-only container, another user's installation) each start would compile all modules anew: half a second and 90 MiB
for pymavlink's dialect alone. `pip install` compiles every module of each package, of which a tenth is imported.
"""

from __future__ import annotations

import ast
import importlib
import os
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("ual", "ual_tools", "ual_daemon")


def main() -> None:
    """Imports each module of the packages and what these import, functions included. Python compiles them then."""
    if sys.dont_write_bytecode:
        sys.exit("PYTHONDONTWRITEBYTECODE is set, or -B: Python would compile, and keep nothing")
    os.environ["PYGAME_HIDE_SUPPORT_PROMPT"] = "1"
    for name in sorted({name for package in PACKAGES for name in _names(package)}):
        try:
            importlib.import_module(name)
        except ImportError:
            continue  # an extra that is not installed, another system's module, or a name in a module


def _names(package: str) -> Iterator[str]:
    """Yields the modules of a package, and whatever may be a module in their import statements."""
    spec = find_spec(package)
    if spec is None:
        sys.exit(f"{sys.executable} has no package {package}: install it first")
    for place in spec.submodule_search_locations or ():
        for file in Path(place).rglob("*.py"):
            parts = file.relative_to(Path(place).parent).with_suffix("").parts
            if parts[-1] != "__main__":  # it runs its program
                yield ".".join(parts).removesuffix(".__init__")
            yield from _imported(ast.parse(file.read_bytes()))


def _imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None and not node.level:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


if __name__ == "__main__":
    main()
