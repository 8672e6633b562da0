"""A frame alone in its datagram is taken in few steps: by the same rules as any other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.ual_daemon.backends.mavlink.fakes import ADDRESS
from tests.ual_daemon.backends.mavlink.fuzz import STRANGER, Fuzz
from ual_daemon.backends.mavlink.wire import dialect as mavlink

STEPS_COUNT = 800


class Received(Fuzz):
    """Datagrams of any kind, by turns, and what their receiver makes of each."""

    def __init__(self, *, is_plain: bool) -> None:
        super().__init__("plain", is_stream=False)
        self.receiver = self.harness.discovery.receiver
        self.receiver._is_plain = is_plain

    def _plain(self) -> bytes:
        strange = self._replayed, self._damaged, self._mutated, self._invented, self._signed, self._cut, self._random
        return self._noise.choice((self._one, self._one, self._one, *strange))()

    def _one(self) -> bytes:
        return self._noise.choice(self._frames)

    def _signed(self) -> bytes:
        """With the flag of a signature, and with other flags, which no frame has."""
        frame = bytearray(self._one())
        frame[2] = self._noise.choice((1, 2, 0x80))
        return bytes(frame) + self._noise.randbytes(self._noise.choice((0, 13)))

    def _cut(self) -> bytes:
        return self._one()[: self._noise.randrange(1, 14)]

    def next(self) -> tuple[Any, ...]:
        """Takes the next datagram. Returns all that shows what it was taken for."""
        harness, noise = self.harness, self._noise
        harness.now_s += noise.choice((0.001, 0.004, 0.004, 0.3))
        address = noise.choice((STRANGER, *(ADDRESS for _ in range(20))))
        harness.receive(data=self._make(), address=address)
        harness.discovery.tick(harness.now_s)
        receiver, session = self.receiver, harness.session
        shown = harness.snapshot(), session.info(), session.telemetry.message_counts.copy(), session.identity.sequence
        link = harness.link.peer, list(harness.link.sent), session._signs, sorted(session._unused_ids)
        harness.link.sent.clear()
        counts = receiver.corrupt_count, receiver._reader.garbage_count, receiver.stranger_count
        return *shown, *link, *counts, harness.discovery.link_statistics(harness.now_s)


def test_a_plain_frame_is_taken_as_any_other() -> None:
    quick, thorough = Received(is_plain=True), Received(is_plain=False)
    listened = mavlink.MAVLINK_MSG_ID_ODOMETRY, mavlink.MAVLINK_MSG_ID_HIGHRES_IMU
    ends: list[Callable[[], None]] = []
    routes_count = 0
    for number in range(STEPS_COUNT):
        if number % 200 == 100:  # an extension listens to a message that was not decoded, and ends that
            ends = [
                each.harness.discovery._payload_messages.add(listened[number // 200 % 2], lambda _: None)
                for each in (quick, thorough)
            ]
        elif number % 200 == 0:
            for end in ends:
                end()
        assert quick.next() == thorough.next(), f"datagram {number}"
        routes_count = max(routes_count, len(quick.receiver._routes))
    assert routes_count > 25
    assert not thorough.receiver._routes
