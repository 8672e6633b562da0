"""What every link can do, and what those that carry a stream of bytes have in common."""

from __future__ import annotations

import fcntl
import struct
import termios
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping

Address = tuple[str, int] | tuple[str, int, int, int]
Chunk = tuple[bytes, Address | None]
"""Bytes that came, and from where; None on a link that has one other end."""

PERISHABLE_QUEUE_BYTES = 1024
"""With more than this unsent, what ages quickly is dropped: 0.3 s of setpoints at 50 Hz."""
QUEUE_BYTES = 8192
"""With more than this unsent, everything is dropped: the link is too slow, or nobody reads at the other end."""


class LinkError(Exception):
    """The link cannot be opened, or broke. The message is for people: what, and why."""


class Link(ABC):
    """A way to an autopilot that can be opened again after it broke. Never blocks.

    `send` is for any thread, everything else for the one that receives; what may raise a `LinkError` may raise an
    `OSError`, too, where there is no more to say than the system says. `is_stream`: bytes come in any pieces, not in
    datagrams. `needs_word`: that the other end is gone may show by its silence only. `sessions_count`: how often
    there was a new other end.
    """

    is_stream = True
    needs_word = False
    sessions_count = 0

    @abstractmethod
    def open(self) -> None:
        """Begins to connect. Raises `LinkError`."""

    @abstractmethod
    def close(self) -> None:
        """Gives everything back. May be called at any time and more than once."""

    @abstractmethod
    def descriptors(self) -> Mapping[int, int]:
        """What to wait for (file descriptors and events of `select.poll`); empty while closed."""

    @abstractmethod
    def receive(self, now_s: float) -> list[Chunk]:
        """What has come, after a wait that ended for one of the descriptors. Raises `LinkError` when it broke."""

    @abstractmethod
    def send(self, data: bytes, *, is_perishable: bool = False) -> bool:
        """Sends a frame, whole or not at all; false when it could not leave now.

        One that is perishable is rather dropped than sent late.
        """

    @property
    @abstractmethod
    def peer(self) -> Address | None:
        """Whom we send to; None while nobody is known."""

    def answer_to(self, address: Address | None) -> None:  # noqa: B027 - only links with many other ends have a choice
        """From now on sends go to this address."""

    def drop_peer(self, why: str) -> None:
        """Gives the other end up, which is silent. Raises `LinkError` where that ends the link."""
        raise LinkError(why)


class StreamWriter:
    """Writes frames to a non-blocking descriptor: a frame begun is ended before the next, old ones do not pile up.

    `write` is as `os.write`. The lock is held over writes, which never block; without it two threads could mix their
    frames.
    """

    def __init__(self, write: Callable[[int, bytes], int]) -> None:
        self._write = write
        self._lock = threading.Lock()
        self._descriptor: int | None = None
        self._rest = b""

    def attach(self, descriptor: int | None) -> None:
        """From now on writes go here; None: nowhere."""
        with self._lock:
            self._descriptor = descriptor
            self._rest = b""

    @property
    def is_attached(self) -> bool:
        return self._descriptor is not None

    def write(self, data: bytes, *, is_perishable: bool) -> bool:
        """Writes a frame, or drops it and returns false. That the link broke shows when it is read."""
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
    """Bytes that the system has taken but not sent (TCP: or that are not acknowledged)."""
    count: int = struct.unpack("i", fcntl.ioctl(descriptor, termios.TIOCOUTQ, b"\0" * 4))[0]
    return count
