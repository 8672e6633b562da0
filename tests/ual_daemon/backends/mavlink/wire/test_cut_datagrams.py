"""A byte stream that comes in datagrams: a bridge from a serial line cuts it without regard to frames."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink import fakes
from tests.ual_daemon.backends.mavlink.fakes import ADDRESS, Harness, heartbeat, packer
from ual_daemon.backends.mavlink.wire import checksum, frames
from ual_daemon.backends.mavlink.wire.frames import MOST_SOURCES, FrameReader

pack = packer()
TEXT = pack(mavlink.MAVLink_statustext_message(6, b"\xfd\xfe\xfd\x09\x00\xfe" * 8, 7, 0))
LOG = mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, [0xAA] * 12 + list(TEXT) + [0xAA] * (239 - len(TEXT)))
NESTED = pack(LOG)
"""A frame within the content of another: of a log that a ground station downloads."""
LONG = pack(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, [0xAA] * 239 + [0] * 12))
STRANGER = ("6.6.6.6", 6)
SIZES = [17, 64, 256]


def stream_of(count: int, seed: int = 1) -> list[bytes]:
    noise = random.Random(seed)
    kinds = [heartbeat(), fakes.attitude(), fakes.position(1.0), mavlink.MAVLink_statustext_message(6, b"x" * 50)]
    return [pack(noise.choice(kinds)) for _ in range(count)]


def cut(stream: bytes, sizes: list[int]) -> list[bytes]:
    pieces: list[bytes] = []
    at = 0
    while at < len(stream):
        size = sizes[len(pieces) % len(sizes)]
        pieces.append(stream[at : at + size])
        at += size
    return pieces


def read_all(reader: FrameReader, datagrams: list[bytes]) -> list[bytes]:
    found = [frame.data for datagram in datagrams for frame in reader.read(datagram, ADDRESS)]
    return found + [frame.data for _, given_up in reader.give_up() for frame in given_up]


@pytest.mark.parametrize("size", SIZES)
def test_no_frame_of_a_stream_that_is_cut_anywhere_is_lost(size: int) -> None:
    sent = stream_of(2000)
    reader = FrameReader()
    assert read_all(reader, cut(b"".join(sent), [size])) == sent
    assert (reader.garbage_count, reader.corrupt_count) == (0, 0)


pieces = st.lists(st.integers(1, 300), min_size=1, max_size=30)


@given(pieces, st.integers(0, 1000))
def test_cut_at_random_all_come_in_their_order(sizes: list[int], seed: int) -> None:
    sent = [*stream_of(30, seed), LONG, *stream_of(5, seed)]
    reader = FrameReader()
    assert read_all(reader, cut(b"".join(sent), sizes)) == sent
    assert reader.garbage_count == 0


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(("lost", "doubled"), [(0.05, 0.0), (0.0, 0.05), (0.1, 0.1)])
def test_a_lost_or_doubled_datagram_costs_the_frames_that_it_touches(size: int, lost: float, doubled: float) -> None:
    sent = stream_of(2000)
    noise = random.Random(size)
    datagrams, touched, at = [], set(), 0
    ends = [0]
    for frame in sent:
        ends.append(ends[-1] + len(frame))
    for piece in cut(b"".join(sent), [size]):
        copies = 0 if noise.random() < lost else 2 if noise.random() < doubled else 1
        datagrams += [piece] * copies
        if copies != 1:
            touched |= {i for i in range(len(sent)) if ends[i] < at + len(piece) and ends[i + 1] > at}
        at += len(piece)
    found = read_all(FrameReader(), datagrams)
    assert len(found) >= len(sent) - len(touched)
    assert set(found) <= set(sent)


def test_a_datagram_that_begins_with_a_frame_never_waits_for_what_was_begun_before() -> None:
    reader = FrameReader()
    three = stream_of(3)
    for begun in (NESTED[:10], NESTED[:200][:80], three[0][:5]):
        assert reader.read(begun, ADDRESS) == []
        assert [frame.data for frame in reader.read(three[0], ADDRESS)] == three[:1]
        assert [frame.data for frame in reader.read(three[1] + three[2], ADDRESS)] == three[1:]


def test_a_whole_frame_between_the_pieces_of_another_costs_neither() -> None:
    reader = FrameReader()
    assert reader.read(NESTED[:100], ADDRESS) == []
    assert [frame.data for frame in reader.read(TEXT, ADDRESS)] == [TEXT]
    assert [frame.data for frame in reader.read(NESTED[100:], ADDRESS)] == [NESTED]


def test_garbage_that_resembles_a_beginning_holds_up_no_frame_behind_it() -> None:
    """As in a message that no dialect knows, before others in the same datagram."""
    sent = stream_of(2)
    unknown = b"\xfd\x20\x00\x00\x00\x01\x01\xff\xff\x00" + b"\xfe\x1c\x00\x00\x00\x1e" * 5 + b"\xfe\x1c"
    reader = FrameReader()
    assert [frame.data for frame in reader.read(unknown + sent[0] + sent[1], ADDRESS)] == sent


def test_after_a_damaged_length_the_frames_behind_it_come_with_the_next_datagram() -> None:
    sent = stream_of(5)
    damaged = bytearray(sent[0])
    damaged[1] = 255
    reader = FrameReader()
    found = reader.read(bytes(damaged) + sent[1] + sent[2], ADDRESS) + reader.read(sent[3] + sent[4], ADDRESS)
    assert [frame.data for frame in found] == sent[1:]
    assert reader.garbage_count == len(damaged)


def test_a_frame_within_another_is_not_taken_where_frames_are_cut() -> None:
    """Else an old heartbeat in a downloaded log would be taken for the vehicle's."""
    inner = pack(heartbeat(armed=True))
    content = [0] * 12 + list(inner) + [0] * (239 - len(inner))
    outer = pack(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, [*content[:-1], 1]))
    reader = FrameReader()
    found = read_all(reader, cut(TEXT + outer * 20, [64]))
    assert found == [TEXT] + [outer] * 20


def test_each_source_continues_its_own_frames_and_few_are_remembered() -> None:
    reader = FrameReader()
    sources = [("10.0.0.1", port) for port in range(1000, 1000 + MOST_SOURCES)]
    for number, source in enumerate(sources):
        reader.refill(number * 0.01)
        assert reader.read(NESTED[: 20 + number], source) == []
    for number, source in enumerate(sources):
        assert [frame.data for frame in reader.read(NESTED[20 + number :], source)] == [NESTED]
    for port in range(5000):
        reader.refill(1.0 + port * 1e-3)
        reader.read(NESTED[:200], ("10.0.0.2", port))
    assert len(reader._sources) == MOST_SOURCES
    assert all(len(source.begun) <= 280 for source in reader._sources.values())


def test_the_work_on_pieces_is_paid_by_their_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Datagrams of one byte, each of which completes one more false beginning."""
    covered_count = 0
    check = checksum.is_valid

    def counted(message_id: int, data: bytes, end: int) -> bool:
        nonlocal covered_count
        covered_count += end
        return check(message_id, data, end)

    monkeypatch.setattr(checksum, "is_valid", counted)
    reader = FrameReader()
    for count in range(20_000):
        reader.refill(0.0)
        reader.read(b"\xfd\xff\x00"[count % 3 :][:1], ADDRESS)
    assert covered_count <= 20_000 * frames.CREDIT_PER_BYTE + frames.LARGEST_CREDIT_BYTES


def test_an_autopilot_behind_a_bridge_is_found_and_followed_to_a_new_port() -> None:
    harness = Harness()
    for address in (ADDRESS, STRANGER):
        for number in range(20):
            said = [heartbeat(armed=address is STRANGER), fakes.attitude(), fakes.position(harness.now_s)]
            for piece in cut(b"".join(map(harness.pack, said)), [17]):
                harness.receive(data=piece, address=address)
            harness.run(0.1)
            assert harness.snapshot().control.armed.value is (address is STRANGER and number >= 6) or number < 7
    assert harness.link.peer == STRANGER
    assert harness.snapshot().motion.pose is not None
    assert harness.discovery.link_statistics(harness.now_s).corrupt_count <= 40
    assert harness.discovery.receiver.stranger_count == 0
