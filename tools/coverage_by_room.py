"""Prints how much of each room the tests reach: ``python tools/coverage_by_room.py build/coverage.json [--missing]``.

A room is a package one level below the top, and each backend and client package has rooms of its own.
"""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

_DEEPER = {"ual_daemon/backends", "clients/python"}
"""Folders that are shown room by room."""


class CoveredRoom(NamedTuple):
    """The statements of a room, and how many of them are reached."""

    statements_count: int
    reached_count: int

    @property
    def percent(self) -> float:
        """The part that is reached."""
        return 100.0 * self.reached_count / self.statements_count if self.statements_count else 100.0


def room_of(file: str) -> str:
    """Returns the room of a file: ``ual_daemon/flight``, ``ual_daemon/backends/light``, ``clients/python/ual``."""
    folders = Path(file).parent.parts
    return "/".join(folders[: 3 if "/".join(folders[:2]) in _DEEPER else 2])


def rooms(files: dict[str, Any]) -> dict[str, CoveredRoom]:
    """Sums up the files of coverage's report by their rooms, the least reached first."""
    counts: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for name, file in files.items():
        total = counts[room_of(name)]
        total[0] += file["summary"]["num_statements"]
        total[1] += file["summary"]["covered_lines"]
    found = {name: CoveredRoom(*total) for name, total in counts.items()}
    return dict(sorted(found.items(), key=lambda each: each[1].percent))


def missing(files: dict[str, Any]) -> Iterator[str]:
    """Yields each file with lines that no test reaches, and these: ``file.py: 3, 7-9``."""
    for name, file in sorted(files.items()):
        if lines := file["missing_lines"]:
            yield f"{name}: {', '.join(spans(lines))}"


def spans(lines: Sequence[int]) -> Iterator[str]:
    """Yields runs of numbers: ``3``, ``7-9``."""
    begin = last = lines[0]
    for line in [*lines[1:], None]:
        if line is not None and line == last + 1:
            last = line
            continue
        yield str(begin) if begin == last else f"{begin}-{last}"
        if line is not None:
            begin = last = line


def main(words: Sequence[str]) -> None:
    """Prints the rooms, or with ``--missing`` the lines that are not reached."""
    files = json.loads(Path(words[0]).read_text(encoding="utf-8"))["files"]
    if "--missing" in words:
        print("\n".join(missing(files)))
        return
    found = rooms(files)
    total = CoveredRoom(*(sum(column) for column in zip(*found.values(), strict=True)))
    for name, room in {**found, "all": total}.items():
        print(f"{name:<36} {room.percent:6.1f} %  {room.statements_count - room.reached_count:6d} not reached")


if __name__ == "__main__":
    main(sys.argv[1:])
