"""Keeps a link open: waits for it, opens it again after a growing pause when it broke, logs each trouble once."""

from __future__ import annotations

import contextlib
import logging
import select
import socket
from collections.abc import Callable, Mapping

from typing_extensions import override

from ual_daemon.backends.mavlink.links.base import Address, Chunk, LinkError, MavlinkLink, MessageTransport

_log = logging.getLogger(__name__)

FIRST_RECONNECT_PAUSE_S = 0.2
LONGEST_RECONNECT_PAUSE_S = 3.0
MOST_DISCARDED_BATCHES = 512
"""Most batches that are discarded. No system keeps more: 4 MiB, or in small datagrams 32,768."""
PEER_SILENCE_S = 5.0
"""After a silence this long a connection counts as half-open: the other end is gone without having closed it. An
autopilot sends a heartbeat each second."""


class LinkConnection(MessageTransport):
    """A link that is opened again by itself. `send` and `wake` are for any thread, the rest for the receiving one."""

    def __init__(self, link: MavlinkLink, url: str) -> None:
        self._trouble = ""
        self.on_sent: Callable[[bytes], None] | None = None
        """Called with the bytes of each frame that has left, by the thread that sent it; never blocks."""
        self._link = link
        self._url = url
        self._logged: set[str] = set()
        self._is_open = False
        self._next_open_s = float("-inf")
        self._pause_s = FIRST_RECONNECT_PAUSE_S
        self._alive_s = float("-inf")
        self._connections_count = 0
        self._waker, self._woken = socket.socketpair()
        self._waker.setblocking(False)
        self._woken.setblocking(False)
        self._poll = select.poll()
        self._woken_descriptor = self._woken.fileno()
        self._poll.register(self._woken, select.POLLIN)
        self._registered: dict[int, int] = {}

    @property
    @override
    def is_stream(self) -> bool:
        return self._link.is_stream

    @property
    def trouble(self) -> str:
        """Human-readable trouble of the link; empty while there is none."""
        return self._trouble or self._link.trouble

    @property
    def connections_count(self) -> int:
        """Changes of the other end."""
        return self._link.connections_count

    @property
    @override
    def peer(self) -> Address | None:
        return self._link.peer

    @property
    @override
    def has_room(self) -> bool:
        return self._link.has_room

    @override
    def answer_to(self, address: Address | None) -> None:
        self._link.answer_to(address)

    @override
    def send(self, data: bytes, *, is_perishable: bool = False) -> bool:
        has_left = self._link.send(data, is_perishable=is_perishable)
        if has_left and self.on_sent is not None:
            self.on_sent(data)
        return has_left

    def send_to(self, data: bytes, address: Address, *, is_perishable: bool = False) -> bool:
        """Sends to one of several other ends; see `MavlinkLink`."""
        return self._link.send_to(data, address, is_perishable=is_perishable)

    def wake(self) -> None:
        """Ends a running, or the next, `receive` at once."""
        with contextlib.suppress(OSError):  # full of wake-ups that are not read yet, or closed
            self._waker.send(b"\0")

    def close(self) -> None:
        """Ends the link for good."""
        self._link.close()
        self._waker.close()
        self._woken.close()

    def receive(self, timeout_s: float, now_s: float) -> list[Chunk]:
        """Waits for data up to a time, and returns them; empty when nothing came, or when woken."""
        wanted = self._link.descriptors()
        if wanted != self._registered:
            self._register(wanted)
        is_ready = False
        for descriptor, _ in self._poll.poll(timeout_s * 1000.0 if timeout_s > 0.0 else 0):
            if descriptor == self._woken_descriptor:
                self._woken.recv(4096)
            else:
                is_ready = True
        try:
            return self._link.receive(now_s) if is_ready else []
        except (LinkError, OSError) as error:
            self._fail(error, now_s)
            return []

    def restart(self, now_s: float) -> None:
        """Closes the link and opens it again after a pause, as if it had broken."""
        self._fail(LinkError(f"{self._url}: opening the link anew"), now_s)

    def discard(self, now_s: float) -> None:
        """Discards all data that have arrived and are not received yet; under a flood, about as many as fit."""
        for _ in range(MOST_DISCARDED_BATCHES):
            if not self.receive(0.0, now_s):
                return

    def on_received(self, heard_s: float) -> None:
        """Takes when the last message of the autopilot came: if that is new, the link works."""
        if heard_s <= self._alive_s:
            return
        self._alive_s = heard_s
        self._pause_s = FIRST_RECONNECT_PAUSE_S
        if self._logged:
            self._logged.clear()
            _log.info("the link %s works again", self._url)
        self._trouble = ""

    def tick(self, now_s: float) -> None:
        """Opens the link when that is due, and detects a half-open one; to be called often."""
        if self._link.connections_count != self._connections_count:
            self._connections_count = self._link.connections_count
            self._alive_s = now_s
            self._trouble = ""
        if not self._is_open:
            if now_s >= self._next_open_s:
                self._open(now_s)
        elif self._link.peer is None:
            self._alive_s = now_s  # no other end is known yet whose silence could mean anything
        elif self._link.needs_traffic and now_s - self._alive_s > PEER_SILENCE_S:
            try:
                self._link.drop_peer(f"nothing came from {self._url} for {PEER_SILENCE_S:.0f} s; connecting anew")
            except (LinkError, OSError) as error:
                self._fail(error, now_s)

    def _open(self, now_s: float) -> None:
        try:
            self._link.open()
        except (LinkError, OSError) as error:
            self._fail(error, now_s)
            return
        self._is_open = True
        self._alive_s = now_s
        if not self._logged:
            _log.info("waiting for an autopilot at %s", self._url)

    def _fail(self, error: LinkError | OSError, now_s: float) -> None:
        self._link.abort()
        self._is_open = False
        self._alive_s = now_s  # what was received until now does not show that it works again
        self._next_open_s = now_s + self._pause_s
        self._pause_s = min(self._pause_s * 2.0, LONGEST_RECONNECT_PAUSE_S)
        # An OSError that no link has explained: the system is short of something (descriptors, memory).
        trouble = f"{self._url}: {error.strerror}; trying again" if isinstance(error, OSError) else str(error)
        self._trouble = trouble
        if trouble not in self._logged:  # each once until the link works again: two may alternate
            self._logged.add(trouble)
            _log.warning("%s", trouble)

    def _register(self, wanted: Mapping[int, int]) -> None:
        """Registers what the link waits for now. A descriptor number may have been closed and reused meanwhile."""
        for descriptor in self._registered:
            self._poll.unregister(descriptor)
        for descriptor, events in wanted.items():
            self._poll.register(descriptor, events)
        self._registered = dict(wanted)
