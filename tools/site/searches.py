"""Whether the search box of the built site finds what its readers look for: the site's own scripts, run by node."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

_ROOT = Path(__file__).parents[2]
_DATA = _ROOT / "tests" / "data" / "docs"
_FIRST = 3


def missed(site: Path) -> list[str]:
    """Returns the searches whose page is not among the first three, with what was found instead."""
    wanted = dict(_rows("searches_wanted.txt", ": "))
    queries = [query for query, _ in _rows("searches.txt", "|")]
    if unwanted := set(queries) ^ set(wanted):
        return [f"{query}: in one of the two files only" for query in sorted(unwanted)]
    return [
        f"{query}: not {wanted[query]}, but {', '.join(pages[:_FIRST]) or 'nothing'}"
        for query, pages in zip(queries, _found(site, queries), strict=True)
        if not set(pages[:_FIRST]) & set(wanted[query].split())
    ]


def _rows(name: str, separator: str) -> Iterator[tuple[str, str]]:
    for line in (_DATA / name).read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            left, _, right = line.partition(separator)
            yield left.strip(), right.strip()


def _found(site: Path, queries: list[str]) -> list[list[str]]:
    node = shutil.which("node")
    if node is None:
        raise SystemExit("node is needed to try the search of the site: it comes with npm")
    script = str(Path(__file__).parent / "search.mjs")
    command = [node, script, str(site)]
    asked = "\n".join(queries)
    done = subprocess.run(command, input=asked, capture_output=True, text=True, check=False)  # noqa: S603 (our own script)
    if done.returncode != 0:
        raise SystemExit(done.stderr)
    return [json.loads(line) for line in done.stdout.splitlines()]
