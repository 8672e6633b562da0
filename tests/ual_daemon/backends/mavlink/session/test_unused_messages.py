"""Most frames are taken in few steps, and those that no part reads undecoded: all is as if each took the long way."""

import random

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.fakes import ADDRESS, Harness, attitude, heartbeat, packer, position
from ual_daemon.backends.mavlink.links import Address
from ual_daemon.backends.mavlink.wire.receiver import Receiver
from ual_daemon.backends.payload import PayloadMessage

ELSEWHERE = ("127.0.0.1", 14581)
STRANGER = ("192.0.2.1", 14580)
UNUSED = mavlink.MAVLink_vfr_hud_message(1.0, 1.0, 90, 50, 10.0, 0.0)


def connected() -> Harness:
    harness = Harness()
    harness.receive(heartbeat())
    harness.link.answer_to(ADDRESS)
    return harness


def test_a_damaged_frame_of_an_unused_message_does_not_count_as_received() -> None:
    harness = connected()
    harness.now_s = 0.3
    data = bytearray(harness.pack(UNUSED))
    data[12] ^= 0x10
    harness.receive(data=bytes(data))
    assert harness.session.telemetry.heard_s == 0.0
    assert harness.discovery.receiver.corrupt_count == 1
    harness.receive(UNUSED)
    assert harness.session.telemetry.heard_s == 0.3
    assert harness.discovery.receiver.corrupt_count == 1


def test_a_frame_alone_in_its_datagram_is_taken_in_few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    harness = connected()
    taken: list[int] = []
    monkeypatch.setattr(Receiver, "_on_frames", lambda *_, **__: taken.append(1))
    harness.receive(UNUSED)
    harness.receive(attitude())
    assert not taken
    harness.receive(data=harness.pack(attitude()) + harness.pack(UNUSED))
    assert taken


def test_a_message_that_an_extension_wants_is_decoded_at_once_and_no_longer_than_that() -> None:
    harness = connected()
    heard: list[PayloadMessage] = []
    unlisten = harness.discovery._payload_messages.add(UNUSED.get_msgId(), heard.append)
    harness.receive(UNUSED)
    assert [each.name for each in heard] == ["VFR_HUD"]
    unlisten()
    harness.receive(UNUSED)
    assert len(heard) == 1
    assert UNUSED.get_msgId() not in harness.session.decoded_ids


def test_all_that_is_known_is_as_if_each_frame_were_taken_by_itself() -> None:
    """Used and unused messages, doubled, late, damaged, cut, joined, of others, and from elsewhere."""
    noise, both = random.Random(5), (connected(), connected())
    both[1].discovery.receiver._is_plain = False
    pack, others = packer(), packer(2)
    unused = (UNUSED, mavlink.MAVLink_altitude_message(0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0))
    before = pack(UNUSED)
    for number in range(3000):
        now_s = 0.01 * number
        message = noise.choice((*unused, *unused, attitude(), position(now_s), heartbeat()))
        data, address = pack(message), ADDRESS
        chance = noise.random()
        if chance < 0.02:
            data = bytes(each ^ (noise.random() < 0.05) for each in data)
        elif chance < 0.04:
            data = data[: noise.randrange(len(data))]
        elif chance < 0.06:
            data, before = before, data  # late
        elif chance < 0.08:
            data += pack(noise.choice(unused))
        elif chance < 0.1:
            data = others(message)
        elif chance < 0.12:
            address = noise.choice((ELSEWHERE, STRANGER))
        for harness in both:
            harness.now_s = now_s
            harness.receive(data=data, address=address)
            if number % 5 == 0:
                harness.discovery.tick(now_s)
        assert known(both[0]) == known(both[1])
        if chance >= 0.06:
            before = data
    assert both[0].discovery.receiver.corrupt_count > 50


def known(harness: Harness) -> tuple[object, ...]:
    session, receiver = harness.session, harness.discovery.receiver
    peer: Address | None = harness.link.peer
    return (
        harness.supervision.statistics(harness.now_s),
        (receiver.corrupt_count, receiver.stranger_count, peer),
        (session.telemetry.heard_s, session.telemetry._readings.order, session.identity.conflict),
        session.snapshot(harness.now_s),
    )
