"""Counts the handwritten lines of the product: ``python tools/lines.py [REVISION]``.

They are those of Python, ``.msg``, ``.srv`` and ``.action`` files under ``ual_daemon``, ``clients/python`` and
``clients/ros2``. Tests, examples and what a tool has written do not count.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("ual_daemon", "clients/python", "clients/ros2")
SUFFIXES = (".py", ".msg", ".srv", ".action")
_BESIDE = {"test", "tests", "examples"}
_STUBS = re.compile(r"_pb2(_grpc)?\.pyi?$")
_WRITTEN_BY_A_TOOL = re.compile(rb"``?make [a-z-]+``? writes (it|this file): do not edit")
_HEAD_BYTES = 400
"""A generated file says so within its first bytes."""


def is_product(path: str) -> bool:
    """Returns whether a path of the repository belongs to the product, by its name alone."""
    parts = PurePosixPath(path).parts
    in_room = any(path.startswith(f"{room}/") for room in ROOMS)
    return in_room and path.endswith(SUFFIXES) and not _BESIDE.intersection(parts) and not _STUBS.search(path)


def is_generated(content: bytes) -> bool:
    """Returns whether a tool has written a file."""
    return _WRITTEN_BY_A_TOOL.search(content[:_HEAD_BYTES]) is not None


def count(files: Iterable[tuple[str, bytes]]) -> Counter[str]:
    """Returns the handwritten lines of each room."""
    lines: Counter[str] = Counter()
    for path, content in files:
        if not is_generated(content):
            room = next(each for each in ROOMS if path.startswith(f"{each}/"))
            lines[room] += content.count(b"\n")
    return lines


def files_here() -> Iterator[tuple[str, bytes]]:
    """Yields the files of the product that git knows, as they are now."""
    for path in _git("ls-files").decode().splitlines():
        if is_product(path) and (ROOT / path).is_file():
            yield path, (ROOT / path).read_bytes()


def files_of(revision: str) -> Iterator[tuple[str, bytes]]:
    """Yields the files of the product in a revision."""
    for path in _git("ls-tree", "-r", "--name-only", revision).decode().splitlines():
        if is_product(path):
            yield path, _git("show", f"{revision}:{path}")


def _git(*arguments: str) -> bytes:
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True).stdout  # noqa: S603, S607


def main(arguments: list[str]) -> None:
    """Prints the lines of each room, and of all."""
    lines = count(files_of(arguments[0]) if arguments else files_here())
    for room in ROOMS:
        print(f"{lines[room]:>8,}  {room}")
    print(f"{sum(lines.values()):>8,}")


if __name__ == "__main__":
    main(sys.argv[1:])
