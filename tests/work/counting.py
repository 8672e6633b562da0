"""Counts the work of code, without a clock: what a busy computer cannot change."""

from __future__ import annotations

import cProfile
import math
import statistics
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import ual
from tests.conftest import LIMIT_S
from ual.types import Telemetry
from ual_daemon import UAL

_ROOT = Path(__file__).parents[2]
_PACKAGES = (str(_ROOT / "ual_daemon"), str(Path(ual.__file__).parent))
_LONG_S = 60.0


class Work(NamedTuple):
    """Work of UAL's code on one thread.

    Attributes:
        calls: How often it called a function, of Python or of C.
        blocks: How many blocks of memory Python took between two such calls, as far as they were not given back before
            the next call.
    """

    calls: float
    blocks: float


class Counter:
    """Counts on the threads on which `note` is set as the profile function.

    Without `has_blocks` it counts none: Python looks through all of its memory for their number, at each call.
    """

    def __init__(self, *, has_blocks: bool = True) -> None:
        self.calls = 0
        self.blocks = 0
        self._blocks_before = sys.getallocatedblocks()
        self._has_blocks = has_blocks

    def note(self, frame: FrameType, event: str, _: Any) -> None:
        """Counts an event; see `sys.setprofile`."""
        if not self._has_blocks:
            self.calls += event in ("call", "c_call") and frame.f_code.co_filename.startswith(_PACKAGES)
            return
        blocks = sys.getallocatedblocks()
        if frame.f_code.co_filename.startswith(_PACKAGES):
            self.calls += event in ("call", "c_call")
            self.blocks += max(0, blocks - self._blocks_before)
        self._blocks_before = sys.getallocatedblocks()

    def taken(self) -> Work:
        """Returns what was counted since the last time."""
        work = Work(self.calls, self.blocks if self._has_blocks else math.inf)
        self.calls = self.blocks = 0
        return work


def counted(act: Callable[[], object], *, has_blocks: bool = True) -> Work:
    """Returns the work of a function on this thread; infinitely many blocks where they are not counted."""
    counter = Counter(has_blocks=has_blocks)
    interval_s = sys.getswitchinterval()
    sys.setswitchinterval(_LONG_S)  # the blocks that other threads take would count, too
    sys.setprofile(counter.note)
    try:
        act()
    finally:
        sys.setprofile(None)
        sys.setswitchinterval(interval_s)
    return counter.taken()


def usual(works: Sequence[Work]) -> Work:
    """Returns the median of each number."""
    calls, blocks = zip(*works, strict=True)
    return Work(statistics.median(calls), statistics.median(blocks))


def least(works: Sequence[Work]) -> Work:
    """Returns the least of each number."""
    calls, blocks = zip(*works, strict=True)
    return Work(min(calls), min(blocks))


def calls_of_samples(uav: UAL, count: int, begin: Callable[[], object]) -> float:
    """Returns how many functions of UAL are called for a sample, on the thread that hears the autopilot. It is the
    mean of all that is called between the first and the last of some samples. `begin` is called at the first one.
    """
    profile = cProfile.Profile()
    seen: list[Telemetry] = []
    is_done = threading.Event()

    def on_sample(sample: Telemetry) -> None:
        seen.append(sample)
        if len(seen) == 1:
            begin()
            profile.enable()
        elif len(seen) == count + 1:
            profile.disable()
            is_done.set()

    end = uav.vehicle.subscribe(on_sample)
    try:
        assert is_done.wait(LIMIT_S), "no samples"
    finally:
        end()
    return sum(map(_calls, profile.getstats())) / count


def _calls(entry: Any) -> int:
    """Returns how often a function of UAL was called, with its calls of functions of C."""
    if isinstance(entry.code, str) or not entry.code.co_filename.startswith(_PACKAGES):
        return 0
    of_c = (each.callcount for each in entry.calls or () if isinstance(each.code, str))
    return int(entry.callcount) + int(sum(of_c))
