"""Prints the test files that can see a change, the nearest first: what `make test-changed` runs.

    python tools/changed_tests.py [--since REVISION] [--within IMPORTS] [PATH...]

Without paths, the change is what differs from `--since` (the commit before that the branch shares with main), committed
or not. A test sees a module that it imports, directly or through others, and a file whose name it contains. `--within`
limits the imports from the test to the module: 2 by default, 0 for no limit.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import grimp

_REPOSITORY = Path(__file__).parents[1]
_ROOTS = {"ual_daemon": ".", "tests": ".", "benchmarks": ".", "ual": "clients/python", "ual_tools": "clients/python"}
_WITHIN = 2


def main() -> None:
    """Prints one path a line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--since", default="", help="the revision to compare with")
    parser.add_argument("--within", type=int, default=_WITHIN, help="most imports in between; 0: no limit")
    parser.add_argument("paths", nargs="*", help="changed files, instead of those that git names")
    arguments = parser.parse_args()
    sys.path[:0] = sorted({str(_REPOSITORY / root) for root in _ROOTS.values()})
    changed = arguments.paths or _changed(arguments.since)
    graph = grimp.build_graph(*_ROOTS, cache_dir=None)
    for path in affected_tests(graph, changed, arguments.within):
        print(path)


def _changed(since: str) -> list[str]:
    base = since or _git("merge-base", "HEAD", "main").strip()
    return [*_git("diff", "--name-only", base).split(), *_git("ls-files", "--others", "--exclude-standard").split()]


def _git(*arguments: str) -> str:
    git = shutil.which("git") or "git"
    found = subprocess.run([git, *arguments], cwd=_REPOSITORY, capture_output=True, text=True, check=True)  # noqa: S603
    return found.stdout


def affected_tests(graph: grimp.ImportGraph, changed: Iterable[str], within: int) -> list[str]:
    """Returns the test files that see changed files, the nearest first, and then by name."""
    modules = {name for path in changed if (name := module_of(path)) in graph.modules}
    found = {path: far for name, far in distances(graph, modules).items() if (path := _test_file(name))}
    for path in _readers([path for path in changed if module_of(path) not in graph.modules]):
        found[path] = min(1, found.get(path, 1))
    near = [path for path, far in found.items() if not within or far <= within]
    return sorted(near, key=lambda path: (found[path], path))


def module_of(path: str) -> str:
    """Returns the name of the module in a file; empty where there is none."""
    for name, root in _ROOTS.items():
        begin = f"{name}/" if root == "." else f"{root}/{name}/"
        if path.startswith(begin) and path.endswith(".py"):
            parts = Path(path).relative_to(root).with_suffix("").parts
            return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
    return ""


def distances(graph: grimp.ImportGraph, modules: Iterable[str]) -> Mapping[str, int]:
    """Returns how many imports lie between each module that sees one of these and the nearest of them."""
    found = dict.fromkeys(modules, 0)
    waiting = deque(found)
    while waiting:
        module = waiting.popleft()
        for importer in graph.find_modules_that_directly_import(module):
            if importer not in found:
                found[importer] = found[module] + 1
                waiting.append(importer)
    return found


def _test_file(module: str) -> str:
    """Returns the path of a module of tests; empty where it is none."""
    path = Path(*module.split(".")).with_suffix(".py")
    return str(path) if module.startswith("tests.") and path.name.startswith("test_") else ""


def _readers(paths: Iterable[str]) -> Iterator[str]:
    """Yields the test files that contain the name of one of these files, or the pattern of all that end alike."""
    names = {name for path in map(Path, paths) for name in (path.name, f"*{path.suffix}")}
    for path in sorted((_REPOSITORY / "tests").rglob("test_*.py")) if names else ():
        text = path.read_text(encoding="utf-8")
        if any(name in text for name in names):
            yield str(path.relative_to(_REPOSITORY))


if __name__ == "__main__":
    main()
