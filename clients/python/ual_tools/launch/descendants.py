"""Finds what the programs of a team have started, also what has left its process group.

On Linux `PR_SET_CHILD_SUBREAPER` makes this process the parent of the orphans below it. Elsewhere only the process
groups are known.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from collections.abc import Collection
from pathlib import Path

_PR_SET_CHILD_SUBREAPER = 36
"""Of `prctl` (linux/prctl.h)."""


def adopt_orphans() -> None:
    """Makes this process the parent of what its children leave behind. Does nothing where the system cannot."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def children(pid: int | None = None) -> set[int]:
    """Returns the processes that a process has started, or has adopted; by default those of this one."""
    found: set[int] = set()
    for file in Path(f"/proc/{pid or os.getpid()}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            found.update(map(int, file.read_text().split()))
    return found


def all_below(pid: int | None = None) -> set[int]:
    """Returns the processes that a process has started, and those that they have started."""
    found = set()
    for child in children(pid):
        found |= {child} | all_below(child)
    return found


def reap(known: Collection[int]) -> None:
    """Collects the exit status of adopted processes that have ended. `known` are those that others wait for."""
    for pid in children() - set(known):
        with contextlib.suppress(ChildProcessError):
            os.waitpid(pid, os.WNOHANG)
