"""Resources that a forked process must not share with its parent: connections, streams, and locks that a thread
held.
"""

from __future__ import annotations

import os
import weakref
from typing import Protocol

from ual.errors import ClientUnusableError, UalError


class Forked(Protocol):
    """Something that begins again in a forked process."""

    def begin_anew(self) -> None:
        """Leaves to the parent what is its own. Called in the child, before anything else runs there."""


_alive: weakref.WeakSet[Forked] = weakref.WeakSet()


def renew_in_child(each: Forked) -> None:
    """Lets an object begin again in each process that is forked from now on, while the object lives."""
    _alive.add(each)


class _Asyncio:
    """gRPC's asyncio: in the child of a process that used it, its calls hang or crash."""

    is_used = False
    is_lost = False


def use_asyncio() -> None:
    """Notes that this process uses gRPC's asyncio. Raises `UalError` where its parent did before the fork."""
    if _Asyncio.is_lost:
        raise asyncio_lost()
    _Asyncio.is_used = True


def asyncio_lost() -> UalError:
    """Returns the error of the asyncio of a parent."""
    return ClientUnusableError(
        "ual.aio or ual.Team was used before this process was forked, which gRPC's asyncio does not survive: this "
        "process may crash at any time. Begin it by multiprocessing's 'spawn', or before their first use"
    )


def _begin_anew() -> None:
    _Asyncio.is_lost = _Asyncio.is_used
    for each in list(_alive):
        each.begin_anew()


if hasattr(os, "register_at_fork"):  # Windows has no fork
    os.register_at_fork(after_in_child=_begin_anew)
