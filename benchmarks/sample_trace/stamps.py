"""The stamps of samples in one process: when each passed which station, and how many Python calls that took."""

from __future__ import annotations

import functools
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

_OWN = str(Path(__file__).parent)

Stamp = tuple[int, int]
"""The time (monotonic clock, ns), and the Python calls of the thread since the stamp before."""


class Station(NamedTuple):
    """A function that a sample passes, with the names of its beginning and its end in the table; empty: not shown.

    `begins`: a sample begins here on this thread. `number` returns the number of the sample from the function's result
    and arguments; None where they do not tell.
    """

    owner: object
    function: str
    before: str = ""
    after: str = ""
    begins: bool = False
    number: Callable[..., int | None] | None = None


class Stamps:
    """All stamps of this process. A thread's stamps belong to the sample that began last on it."""

    def __init__(self) -> None:
        self._local = threading.local()
        self._rows: dict[int, list[dict[str, Stamp]]] = defaultdict(list)

    def wrap(self, station: Station) -> None:
        """Puts stamps around a function from now on."""
        function = getattr(station.owner, station.function)
        setattr(station.owner, station.function, functools.wraps(function)(self._stamped(function, station)))

    def take(self) -> dict[int, dict[str, Stamp]]:
        """Returns all stamps since the last call, for each sample by the names of its stations."""
        rows, self._rows = self._rows, defaultdict(list)
        return {number: {name: stamp for row in of for name, stamp in row.items()} for number, of in rows.items()}

    def count_calls(self) -> None:
        """Counts the Python calls of this thread and of each that begins from now on. This makes all slow."""
        threading.setprofile(self._count)
        sys.setprofile(self._count)

    def _count(self, frame: FrameType, event: str, _: object) -> None:
        if event == "call" and not frame.f_code.co_filename.startswith(_OWN):
            self._local.calls = getattr(self._local, "calls", 0) + 1

    def _stamped(self, function: Callable[..., Any], station: Station) -> Callable[..., Any]:
        _, _, before, after, begins, number = station

        def stamped(*arguments: Any, **named: Any) -> Any:  # noqa: ANN401  of any function
            if begins:
                self._local.row, self._local.calls = {}, 0
            if before:
                self._stamp(before)
            result = function(*arguments, **named)
            if after:
                self._stamp(after)
            if number is not None:
                self._file(number(result, *arguments))
            return result

        return stamped

    def _stamp(self, name: str) -> None:
        local = self._local
        row = getattr(local, "row", None)
        if row is not None and name not in row:
            row[name] = (time.monotonic_ns(), getattr(local, "calls", 0))
            local.calls = 0

    def _file(self, number: int | None) -> None:
        row = getattr(self._local, "row", None)
        if number is not None and row is not None:
            self._rows[number].append(row)
