"""What a forked process must not share with its parent: connections, streams, and locks that a thread held."""

from __future__ import annotations

import os
import weakref
from typing import Protocol


class Forked(Protocol):
    """Something that begins anew in a forked process."""

    def begin_anew(self) -> None:
        """Leaves to the parent what is its own. Called in the child, before anything else runs there."""


_alive: weakref.WeakSet[Forked] = weakref.WeakSet()


def renew_in_child(each: Forked) -> None:
    """Lets an object begin anew in each process that is forked from now on, while the object lives."""
    _alive.add(each)


def _begin_anew() -> None:
    for each in list(_alive):
        each.begin_anew()


if hasattr(os, "register_at_fork"):  # Windows has no fork
    os.register_at_fork(after_in_child=_begin_anew)
