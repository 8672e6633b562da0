"""The interface of links, and the writer of those that carry a stream of bytes."""

from __future__ import annotations

import fcntl
import struct
import termios
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Protocol

from ual_daemon.backends import hosts

Address = hosts.Address
Chunk = tuple[bytes, Address | None]
"""Received bytes, and the address that they came from; None on a link that has only one other end."""

PERISHABLE_QUEUE_BYTES = 1024
"""With more than this unsent, perishable frames are dropped: 0.3 s of setpoints at 50 Hz."""
READ_BATCH_BYTES = 8192
"""About the most bytes that are received at once. The rest waits for the next time, and what overflows meanwhile is the
system's to drop: a flood must not keep the thread from flying. PX4 sends 24 kB a second."""
QUEUE_BYTES = 8192
"""With more than this unsent, every frame is dropped: the link is too slow, or nothing reads at the other end."""


class LinkError(Exception):
    """The link cannot be opened, or broke. The message is human-readable: what, and why."""


def cannot_listen(endpoint: object, error: OSError) -> LinkError:
    """Returns the error of a port that cannot be opened."""
    return LinkError(
        f"cannot listen at {endpoint}: {error.strerror}; trying again (does another program use this port?)"
    )


class MessageTransport(Protocol):
    """Transport of messages in both directions: a `LinkConnection`."""

    @property
    def is_stream(self) -> bool:
        """See `MavlinkLink`."""

    @property
    def peer(self) -> Address | None:
        """See `MavlinkLink`."""

    @property
    def has_room(self) -> bool:
        """See `MavlinkLink`."""
        return True

    def answer_to(self, address: Address | None) -> None:
        """See `MavlinkLink`."""

    def send(self, data: bytes, *, is_perishable: bool = False) -> bool:
        """See `MavlinkLink`."""


class MavlinkLink(ABC):
    """A way to an autopilot that can be opened again after it broke. Never blocks.

    `send` is for any thread, everything else for the one that receives. What may raise a `LinkError` may raise an
    `OSError` instead, where the system's message says enough. `is_stream`: bytes come in any pieces, not in datagrams.
    `needs_traffic`: only silence may show that the other end is gone. `connections_count`: how often there was a new
    other end.
    """

    is_stream = True
    needs_traffic = False
    connections_count = 0

    @property
    def trouble(self) -> str:
        """Why nothing can be sent now, human-readable, where that does not break the link; empty while it can."""
        return ""

    @abstractmethod
    def open(self) -> None:
        """Begins to connect.

        Raises:
            LinkError: The link cannot be opened now; it may be tried again later.

        """

    @abstractmethod
    def close(self) -> None:
        """Releases everything. May be called at any time and more than once."""

    def abort(self) -> None:
        """Closes what broke, or is silent: what has not reached the other end yet must not be delivered later."""
        self.close()

    @abstractmethod
    def descriptors(self) -> Mapping[int, int]:
        """Returns what to wait for (file descriptors and events of `select.poll`); empty while closed."""

    @abstractmethod
    def receive(self, now_s: float) -> list[Chunk]:
        """Returns what has come, after a wait that ended for one of the descriptors.

        Raises:
            LinkError: The link broke.

        """

    @abstractmethod
    def send(self, data: bytes, *, is_perishable: bool = False) -> bool:
        """Sends a frame, whole or not at all. Returns False when it could not leave now.

        A perishable frame is dropped rather than sent late.
        """

    def send_to(self, data: bytes, address: Address, *, is_perishable: bool = False) -> bool:
        """Sends as `send` does, to one of several other ends; a stream has only one.

        Raises:
            OSError: Nothing can be sent there now.

        """
        del address
        return self.send(data, is_perishable=is_perishable)

    @property
    @abstractmethod
    def peer(self) -> Address | None:
        """The address that frames are sent to; None while it is not known."""

    @property
    def has_room(self) -> bool:
        """Whether so little waits to leave that what is not urgent may be sent, too. From any thread."""
        return True

    def answer_to(self, address: Address | None) -> None:  # noqa: B027 - only links with many other ends have a choice
        """Sets the address that frames are sent to from now on."""

    def drop_peer(self, why: str) -> None:
        """Drops the connection to the other end, which is silent.

        Raises:
            LinkError: That ends the link.

        """
        raise LinkError(why)


class StreamWriter:
    """Writes frames to a non-blocking descriptor: each is completed before the next, and old ones do not pile up.

    `write` is like `os.write`. The lock is held during writes, which never block; without it two threads could mix
    their frames. `roomy_bytes` is how much may be unsent where there is room for what is not urgent.
    """

    def __init__(self, write: Callable[[int, bytes], int], roomy_bytes: int = 0) -> None:
        self._write = write
        self._roomy_bytes = roomy_bytes
        self._lock = threading.Lock()
        self._descriptor: int | None = None
        self._rest = b""

    def attach(self, descriptor: int | None) -> None:
        """Sets the descriptor that frames are written to from now on; None: they are dropped."""
        with self._lock:
            self._descriptor = descriptor
            self._rest = b""

    @property
    def is_attached(self) -> bool:
        """Whether there is a descriptor to write to."""
        return self._descriptor is not None

    @property
    def has_room(self) -> bool:
        """See `MavlinkLink.has_room`."""
        with self._lock:
            if self._descriptor is None or self._rest:
                return False
            try:
                return _unsent_count(self._descriptor) <= self._roomy_bytes
            except OSError:
                return False

    def write(self, data: bytes, *, is_perishable: bool) -> bool:
        """Writes a frame, or drops it and returns False. Reading shows whether the link broke."""
        with self._lock:
            descriptor = self._descriptor
            if descriptor is None:
                return False
            try:
                if self._rest:
                    self._rest = self._rest[self._write(descriptor, self._rest) :]
                limit = PERISHABLE_QUEUE_BYTES if is_perishable else QUEUE_BYTES
                if self._rest or _unsent_count(descriptor) > limit:
                    return False
                self._rest = data[self._write(descriptor, data) :]
            except OSError:
                return False
            return True


def _unsent_count(descriptor: int) -> int:
    """Returns how many bytes the system has taken but not sent (TCP: or that are not acknowledged)."""
    count: int = struct.unpack("i", fcntl.ioctl(descriptor, termios.TIOCOUTQ, b"\0" * 4))[0]
    return count
