"""Ends connections of Zenoh on which no answer comes any more.

Zenoh closes a connection once its lease is over, and connects again after that. But it first writes what still waits,
and TCP tries that ever more seldom: after a minute without network up to a minute later. Zenoh has no setting for it.
Linux has one for each socket: it ends a connection that had no answer for `LEASE_MS`.
"""

from __future__ import annotations

import os
import re
import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Protocol

from ual.network.configuration import LEASE_MS
from ual.shared.renamed import renamed

_DESCRIPTORS = Path("/proc/self/fd")
_LOCATOR = re.compile(r"(?:tcp|tls)/\[?([^\]/]+?)\]?:([0-9]+)(?:[?#].*)?")
_End = tuple[str, int]
_Ends = tuple[_End, _End]
"""Address and port here, and there."""


class Link(Protocol):
    """A connection by its locators, as Zenoh tells them."""

    @property
    def src(self) -> str:
        """Its end here, ``tls/10.0.0.5:36708``."""

    @property
    def dst(self) -> str:
        """Its other end."""


def option() -> int | None:
    """Returns the number of the option; None where the system has none."""
    return getattr(socket, "TCP_USER_TIMEOUT", None) if _DESCRIPTORS.is_dir() else None


class LostLinks:
    """Sees to the connections of a session. `keep` is to be called repeatedly, on one thread.

    Args:
        links: Returns the connections that there are now.

    """

    def __init__(self, links: Callable[[], Iterable[Link]]) -> None:
        self._links = links
        self._option = option()
        self._known: set[_Ends] = set()

    def keep(self) -> None:
        """Sets the option of connections that are new."""
        if self._option is None:
            return
        now = {ends for link in self._links() if (ends := _ends(link)) is not None}
        if new := now - self._known:
            _limit(new, self._option)
        self._known = now

    look = renamed(keep, "LostLinks.look")


def own_sockets() -> Iterator[socket.socket]:
    """Yields all sockets of this process by descriptors of their own, to be closed: the first may close meanwhile."""
    for each in _DESCRIPTORS.iterdir():
        with suppress(OSError):
            if str(each.readlink()).startswith("socket:"):
                yield _doubled(int(each.name))


def _doubled(descriptor: int) -> socket.socket:
    double = os.dup(descriptor)
    is_blocking = os.get_blocking(double)
    try:
        made = socket.socket(fileno=double)
    except OSError:
        os.close(double)
        raise
    os.set_blocking(double, is_blocking)  # both share it, and `socket.setdefaulttimeout` changes it
    return made


def end_of(locator: str) -> _End | None:
    """Returns the address and port of a locator over TCP; None for others."""
    match = _LOCATOR.fullmatch(locator)
    return None if match is None else (match[1], int(match[2]))


def _ends(link: Link) -> _Ends | None:
    here, there = end_of(link.src), end_of(link.dst)
    return None if here is None or there is None else (here, there)


def _limit(wanted: set[_Ends], number: int) -> None:
    for found in own_sockets():
        with closing(found), suppress(OSError):  # those that listen have no other end
            if (found.getsockname()[:2], found.getpeername()[:2]) in wanted:
                found.setsockopt(socket.IPPROTO_TCP, number, LEASE_MS)
