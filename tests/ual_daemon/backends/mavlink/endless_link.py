"""A link on which there is always more to receive."""

from __future__ import annotations

import select
import socket
from abc import abstractmethod

from typing_extensions import override

from ual_daemon.backends.mavlink.links import Address
from ual_daemon.backends.mavlink.links.base import Chunk, MavlinkLink


class EndlessLink(MavlinkLink):
    """Its descriptor is readable all the time; `receive` says what comes."""

    def __init__(self) -> None:
        self.batches_count = 0
        self.sent: list[bytes] = []
        self._ours, self._theirs = socket.socketpair()
        self._theirs.send(b"x")  # never read

    @override
    def open(self) -> None:
        pass

    @override
    def close(self) -> None:
        self._ours.close()
        self._theirs.close()

    @override
    def descriptors(self) -> dict[int, int]:
        return {self._ours.fileno(): select.POLLIN}

    @override
    def send(self, data: bytes, *, is_perishable: bool = False) -> bool:
        self.sent.append(data)
        return True

    @override
    @abstractmethod
    def receive(self, now_s: float) -> list[Chunk]:
        """Returns the next batch, and counts it."""

    @property
    @override
    def peer(self) -> Address | None:
        return None
