from __future__ import annotations

from collections.abc import Sequence

import pytest
from typing_extensions import override

from ual_daemon.backends.rosbridge.outbox import Outbox
from ual_daemon.backends.rosbridge.websocket import BridgeTransport


class Socket(BridgeTransport):
    """Takes messages, unless it is full."""

    received_count = 0

    def __init__(self) -> None:
        self.is_full = False
        self.sent: list[bytes] = []

    @override
    def receive(self, timeout_s: float) -> Sequence[str | bytes]:
        return ()

    @override
    def send(self, text: bytes, *, is_perishable: bool = False) -> bool:
        if not self.is_full:
            self.sent.append(text)
        return not self.is_full

    @override
    def ping(self) -> None:
        raise AssertionError

    @override
    def close(self) -> None:
        raise AssertionError


@pytest.fixture
def socket() -> Socket:
    return Socket()


def test_an_older_message_of_a_topic_never_leaves_after_a_newer_one(socket: Socket) -> None:
    outbox = Outbox(socket)
    socket.is_full = True
    outbox.put("/setpoint", b"old: 5 m/s")
    socket.is_full = False
    outbox.put("/setpoint", b"new: stop")
    outbox.flush()
    assert socket.sent == [b"new: stop"]


def test_messages_of_different_topics_leave_in_their_order(socket: Socket) -> None:
    outbox = Outbox(socket)
    socket.is_full = True
    outbox.put("/a", b"1")
    outbox.put("/b", b"2")
    socket.is_full = False
    outbox.put("/c", b"3")
    assert socket.sent == [b"1", b"2", b"3"]


def test_what_is_withdrawn_does_not_leave(socket: Socket) -> None:
    outbox = Outbox(socket)
    socket.is_full = True
    outbox.put("/a", b"1")
    outbox.put("/b", b"2")
    outbox.withdraw("/a")
    assert outbox.clear() == ("/b",)
    socket.is_full = False
    outbox.flush()
    assert socket.sent == []


def test_what_may_not_leave_yet_leaves_when_it_is_flushed(socket: Socket) -> None:
    outbox = Outbox(socket)
    outbox.put("/a", b"1", may_leave=False)
    assert socket.sent == []
    outbox.flush()
    assert socket.sent == [b"1"]
