"""Requests that are repeated until they are answered: CRTP loses packets, and cflib's UDP driver never resends."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ual_daemon.backends.crazyflie.packets import CrtpPacket

MOST_PENDING_REQUESTS = 8
"""Most requests on their way at once; the firmware has a short queue for each port."""
FIRST_REPEAT_S, LONGEST_REPEAT_S = 0.1, 0.4


class CrtpRequest(NamedTuple):
    """A packet to send, and how the answer begins: on the same port, and the same channel if no other is given."""

    packet: CrtpPacket
    answer_prefix: bytes
    answer_channel: int | None = None


class _PendingRequest:
    def __init__(self, request: CrtpRequest, on_answer: Callable[[bytes], None], repeat_s: float | None) -> None:
        self.request = request
        self.on_answer = on_answer
        self.due_s = 0.0
        self.repeat_s = FIRST_REPEAT_S if repeat_s is None else repeat_s
        self.longest_s = LONGEST_REPEAT_S if repeat_s is None else repeat_s


class CrtpRequests:
    """The requests of one link that are not answered yet. Not thread-safe: belongs to the thread that receives."""

    def __init__(self, send: Callable[[CrtpPacket], None]) -> None:
        self._send = send
        self._pending: list[_PendingRequest] = []

    def add(self, request: CrtpRequest, on_answer: Callable[[bytes], None], repeat_s: float | None = None) -> None:
        """Adds a request. `on_answer` gets the data of its answer, once.

        `repeat_s` is the interval at which it is repeated; None: an interval that grows.
        """
        self._pending.append(_PendingRequest(request, on_answer, repeat_s))

    def clear(self) -> None:
        """Forgets all requests."""
        self._pending.clear()

    def withdraw(self, request: CrtpRequest) -> None:
        """Forgets a request."""
        self._pending = [each for each in self._pending if each.request is not request]

    @property
    def is_empty(self) -> bool:
        """Whether all have been answered."""
        return not self._pending

    def step(self, now_s: float) -> None:
        """Sends the requests that are due, for the first time or again."""
        for pending in self._pending[:MOST_PENDING_REQUESTS]:
            if now_s >= pending.due_s:
                self._send(pending.request.packet)
                pending.due_s = now_s + pending.repeat_s
                pending.repeat_s = min(2.0 * pending.repeat_s, pending.longest_s)

    def on_packet(self, packet: CrtpPacket) -> bool:
        """Takes an answer. Returns False if it answers nothing that was asked, or is a second answer."""
        for index, pending in enumerate(self._pending):
            if _answers(packet, pending.request):
                del self._pending[index]
                pending.on_answer(packet.data)
                return True
        return False


def _answers(packet: CrtpPacket, request: CrtpRequest) -> bool:
    channel = request.packet.channel if request.answer_channel is None else request.answer_channel
    return (packet.port, packet.channel) == (request.packet.port, channel) and packet.data.startswith(
        request.answer_prefix
    )
