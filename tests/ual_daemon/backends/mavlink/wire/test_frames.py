import itertools
import random

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import AutopilotCodec
from tests.ual_daemon.backends.mavlink import fakes
from tests.ual_daemon.backends.mavlink.fakes import Harness, heartbeat, packer
from ual_daemon.backends.mavlink.wire import checksum, dialect, frames
from ual_daemon.backends.mavlink.wire.frames import (
    CREDIT_PER_BYTE,
    LARGEST_CREDIT_BYTES,
    FrameReader,
    MavlinkFrame,
    split,
)
from ual_daemon.backends.mavlink.wire.messages import Codec


def test_every_frame_of_a_datagram_is_found_with_its_header() -> None:
    data = packer(3)(heartbeat()) + packer(4, 154)(fakes.attitude())
    frames, garbage = split(data)
    assert [(f.message_id, f.system_id, f.component_id) for f in frames] == [(0, 3, 1), (31, 4, 154)]
    assert garbage == 0
    assert b"".join(frame.data for frame in frames) == data


def test_mavlink_1_frames_are_found() -> None:
    data = heartbeat().pack(mavlink.MAVLink(None, 5, 1), force_mavlink1=True)
    (frame,), garbage = split(data)
    assert (frame.message_id, frame.system_id, frame.component_id, garbage) == (0, 5, 1, 0)
    assert Codec(1).decode(frame).custom_mode == 0x03040000


def test_a_signed_frame_is_taken_whole() -> None:
    sender = mavlink.MAVLink(None, 1, 1)
    sender.signing.secret_key = b"x" * 32
    sender.signing.sign_outgoing = True
    frames, garbage = split(heartbeat().pack(sender) * 2)
    assert (len(frames), garbage) == (2, 0)
    assert Codec(1).decode(frames[0]).autopilot == mavlink.MAV_AUTOPILOT_PX4


def test_frames_are_found_between_garbage() -> None:
    frame = packer()(heartbeat())
    frames, garbage = split(b"abc" + frame + b"\xfd\x00" + frame[:-1])
    assert [f.data for f in frames] == [frame]
    assert garbage == 3 + 2 + len(frame) - 1


@given(st.binary(max_size=600))
def test_any_bytes_are_split_without_an_error_and_accounted_for(data: bytes) -> None:
    frames, garbage = split(data)
    assert sum(len(frame.data) for frame in frames) + garbage == len(data)


@given(st.data())
def test_a_damaged_or_truncated_frame_never_decodes_to_another(data: st.DataObject) -> None:
    whole = packer()(fakes.position(1.0))
    at = data.draw(st.integers(10, len(whole) - 1))
    damaged = bytearray(whole)
    damaged[at] ^= data.draw(st.integers(1, 255))
    assert split(bytes(damaged)) == ([], len(whole))
    assert split(whole[:at]) == ([], at)


def signed(data: bytes) -> bytes:
    """The frame in some bytes, as one of MAVLink 2 with a signature."""
    sender = mavlink.MAVLink(None, 1, 1)
    sender.signing.secret_key = b"x" * 32
    sender.signing.sign_outgoing = True
    packed: bytes = AutopilotCodec(1).decode(split(data)[0][0]).pack(sender)
    return packed


def abandoned(reader: FrameReader) -> list[MavlinkFrame]:
    """The frames within what was begun, in which the reader does not believe any more."""
    return [frame for _, found in reader.give_up() for frame in found]


pack = packer()
FRAMES = [
    pack(heartbeat()),
    pack(fakes.position(1.0)),
    heartbeat().pack(mavlink.MAVLink(None, 5, 1), force_mavlink1=True),
    signed(pack(fakes.attitude())),
    pack(mavlink.MAVLink_statustext_message(6, b"\xfd\xfe\xfd\x09\x00\xfe", 0, 0)),
]
garbage = st.binary(max_size=40) | st.sampled_from(
    [b"\xfd", b"\xfe\xff", b"\xfd\xff\x00", b"\xfd\xff\x01\0\0\1\1\0\0\0", FRAMES[1][:-1], FRAMES[0][:5]]
)


@pytest.mark.parametrize("noise", [b"\x00", b"\x00\x01\x02"])
def test_each_run_of_garbage_is_one_damage(noise: bytes) -> None:
    reader = FrameReader()
    reader.feed(noise + FRAMES[0] + noise + FRAMES[1] + FRAMES[2] + noise + FRAMES[0])
    assert (reader.garbage_count, reader.corrupt_count) == (3 * len(noise), 3)


@given(st.lists(st.tuples(garbage, st.sampled_from(FRAMES)), max_size=8), st.data())
@example([(b"\xfd\xff\x00", FRAMES[0]), (FRAMES[1][:12], FRAMES[2])], None)
def test_a_stream_cut_anywhere_with_garbage_anywhere_yields_all_its_frames(
    pieces: list[tuple[bytes, bytes]], data: st.DataObject | None
) -> None:
    stream = b"".join(noise + frame for noise, frame in pieces)
    places = st.lists(st.integers(0, len(stream)), max_size=20).map(sorted)
    cuts = range(len(stream)) if data is None else data.draw(places)
    reader = FrameReader()
    found = [
        frame for begin, end in itertools.pairwise([0, *cuts, len(stream)]) for frame in reader.feed(stream[begin:end])
    ]
    found += abandoned(reader)
    assert [frame.data for frame in found] == [frame for _, frame in pieces]
    assert reader.garbage_count == sum(len(noise) for noise, _ in pieces)
    whole = FrameReader()
    assert [*whole.feed(stream), *abandoned(whole)] == found
    assert (whole.garbage_count, whole.corrupt_count) == (reader.garbage_count, reader.corrupt_count)


def test_frames_come_as_soon_as_they_are_whole() -> None:
    reader = FrameReader()
    for _ in range(3):
        assert [len(reader.feed(bytes((byte,)))) for byte in FRAMES[0]] == [0] * (len(FRAMES[0]) - 1) + [1]
        assert reader.give_up() == []


def test_what_only_resembles_a_beginning_does_not_hold_a_frame_up_for_ever() -> None:
    """A heartbeat a second takes many to complete a false beginning that announces 280 bytes."""
    harness = Harness(is_stream=True)
    harness.receive(data=b"\xfd\xff\0\0\0\1\1\0\0\0")
    harness.receive(heartbeat())
    assert harness.discovery.session is None
    harness.run(0.6)
    assert harness.session.system_id == 1


def test_a_frame_that_comes_in_two_pieces_is_received() -> None:
    harness = Harness(is_stream=True)
    harness.receive(data=FRAMES[0][:7])
    harness.run(0.2)
    harness.receive(data=FRAMES[0][7:])
    assert harness.session.system_id == 1
    assert harness.discovery.receiver.corrupt_count == 0


def test_after_a_new_connection_the_old_ones_last_piece_is_not_continued() -> None:
    harness = Harness(is_stream=True)
    harness.receive(data=FRAMES[1][:7])
    harness.discovery.reconnected()
    harness.receive(data=FRAMES[0])
    assert harness.session.system_id == 1


def test_flags_that_nobody_knows_make_a_frame_that_is_passed_over() -> None:
    frame = bytearray(FRAMES[0])
    frame[2] = 0x02
    crc = mavlink.x25crc(bytes(frame[1:-2]) + bytes((50,))).crc
    assert split(bytes(frame[:-2]) + int(crc).to_bytes(2, "little"))[0] == []


def test_garbage_is_counted_and_harms_nothing() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    noise = random.Random(2)
    for _ in range(2000):
        head = bytes((0xFD, noise.randrange(60), 0, 0, 0, 1, 1, noise.choice((0, 1, 24, 32, 77)), 0, 0))
        harness.receive(data=noise.choice((b"", head)) + noise.randbytes(noise.randrange(1, 80)))
    assert 1000 < harness.discovery.receiver.corrupt_count <= 2000
    harness.receive(heartbeat(armed=True))
    assert harness.snapshot().control.armed.value is True


def test_every_message_is_read_as_pymavlink_reads_it() -> None:
    noise = random.Random(4)
    theirs = mavlink.MAVLink(None)
    read_count = 0
    for message_id, kind in mavlink.mavlink_map.items():
        size = kind.unpacker.size
        for payload in (noise.randbytes(size), noise.randbytes(size - 1) + b"\0", noise.randbytes(1), b"\0"):
            data = _frame(message_id, kind.crc_extra, payload.rstrip(b"\0") or b"\0")
            ((frame,), _) = split(data)
            ours, expected = Codec(1).decode(frame), theirs.decode(bytearray(data))
            fields = {name: getattr(ours, name) for name in kind.fieldnames}
            assert repr(fields) == repr({name: getattr(expected, name) for name in kind.fieldnames}), kind.msgname
            for ask in ("get_msgId", "get_seq", "get_type", "get_srcSystem", "get_srcComponent"):
                assert getattr(ours, ask)() == getattr(expected, ask)()
            read_count += 1
    assert read_count > 1000


def test_every_message_is_sent_as_pymavlink_sends_it() -> None:
    noise = random.Random(5)
    theirs, codec = mavlink.MAVLink(None, 7, 191), Codec(191)
    codec.join(7)
    for message_id, kind in mavlink.mavlink_map.items():
        size = kind.unpacker.size
        if kind.msgname == "TEST_TYPES":
            continue  # pymavlink cannot send what it has read: a single letter
        for payload in (noise.randbytes(size), noise.randbytes(size // 2), b"\0"):
            message = theirs.decode(bytearray(_frame(message_id, kind.crc_extra, payload)))
            values = [getattr(message, f"_{name}_raw", getattr(message, name)) for name in kind.fieldnames]
            theirs.seq = codec._number
            assert codec.encode(dialect.mavlink_map[message_id](*values)) == message.pack(theirs), kind.msgname


def test_a_message_has_all_its_fields_and_no_others() -> None:
    kind = dialect.MAVLink_command_ack_message
    assert kind(1, result=2).result_param2 == 0  # an extension
    for values, named in (
        ((), {"result": 2}),
        ((1, 2, 3, 4, 5, 6, 7), {}),
        ((1, 2), {"result": 2}),
        ((1, 2), {"x": 0}),
    ):
        with pytest.raises(TypeError, match="COMMAND_ACK has the fields command, result, "):
            kind(*values, **named)


def test_no_content_of_a_message_is_too_strange() -> None:
    """Whatever an autopilot puts into the messages that are used, with a right checksum."""
    noise = random.Random(3)
    harness = Harness()
    harness.receive(heartbeat())
    used = sorted(harness.session.decoded_ids)
    assert len(used) > 30  # each protocol beside flying adds its own
    for _ in range(300):
        for message_id in used:
            kind = dialect.mavlink_map[message_id]
            size = kind.layout.payload.size
            payload = noise.choice((noise.randbytes(size), b"\xff" * size, b"\0", noise.randbytes(size // 2 + 1)))
            harness.now_s += 0.001
            harness.receive(data=_frame(message_id, kind.crc_extra, payload))
            harness.discovery.tick(harness.now_s)
            harness.snapshot()
            harness.session.info()
    assert harness.discovery.receiver.corrupt_count == 0


def _frame(message_id: int, crc_extra: int, payload: bytes) -> bytes:
    body = bytes((len(payload), 0, 0, 0, 1, 1, *message_id.to_bytes(3, "little"))) + payload
    crc = mavlink.x25crc(body + bytes((crc_extra,))).crc
    return b"\xfd" + body + int(crc).to_bytes(2, "little")


class Work:
    """Work of a reader: beginnings that it looked at, checksums, and the bytes that they covered."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.looks_count = self.checks_count = self.bytes_count = 0
        look, check = frames._size_at, checksum.is_valid

        def counted_poll(data: bytes, at: int) -> int | None:
            self.looks_count += 1
            return look(data, at)

        def counted_check(message_id: int, data: bytes, end: int) -> bool:
            self.checks_count += 1
            self.bytes_count += end
            return check(message_id, data, end)

        monkeypatch.setattr(frames, "_size_at", counted_poll)
        monkeypatch.setattr(checksum, "is_valid", counted_check)


NASTY = {
    "fd ff 00": b"\xfd\xff\x00",
    "fd": b"\xfd",
    "fe": b"\xfe",
    "fd fd 00 00": b"\xfd\xfd\x00\x00",
    "headers of the largest frame": bytes((0xFD, 0xFF, 0, 0, 0, 0xFD, 0xFF, 0, 0, 0)),
    "fe, id and length alike": b"\xfe\x1c",
    "fe of the largest": bytes((0xFE, 0xFE, 0, 0, 0, 0xFC)),
    "v1 of a message without a known length": bytes((0xFE, 0xFF, 0, 0, 0, 8)),
    "flags that nobody knows": b"\xfd\xff\x02",
    "a frame with a wrong checksum": FRAMES[1][:-1] + b"\x00",
    "a magic in zeros": b"\xfd" + b"\0" * 12,
}


@pytest.mark.parametrize("is_stream", [False, True])
@pytest.mark.parametrize("name", NASTY)
def test_the_work_grows_with_the_bytes_whatever_they_are(
    name: str, is_stream: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def work(size: int) -> tuple[int, int]:
        garbage = (NASTY[name] * (size // len(NASTY[name]) + 1))[:size]
        reader, counted = FrameReader(), Work(monkeypatch)
        pieces = [garbage[at : at + 1000] for at in range(0, size, 1000)] if is_stream else [garbage]
        for piece in pieces:
            reader.feed(piece) if is_stream else reader.read(piece)
        abandoned(reader)
        assert reader.garbage_count == size
        monkeypatch.undo()
        return counted.looks_count, counted.bytes_count

    looks, covered = work(20_000)
    assert looks <= 20_000 / 12 + 400
    assert covered <= 20_000 * CREDIT_PER_BYTE + LARGEST_CREDIT_BYTES + 280
    more_looks, more_covered = work(40_000)
    assert more_looks <= 2.1 * looks + 50
    assert more_covered <= 2.1 * covered + 2 * LARGEST_CREDIT_BYTES


@given(st.lists(st.sampled_from([b"\xfd", b"\xfe", b"\x00", b"\x1c", b"\xff", FRAMES[0][:9]]), max_size=400))
def test_no_bytes_cost_more_work_than_they_pay_for(pieces: list[bytes]) -> None:
    data = b"".join(pieces)
    with pytest.MonkeyPatch.context() as monkeypatch:
        counted = Work(monkeypatch)
        split(data)
    assert counted.bytes_count + 48 * counted.looks_count <= 2 * CREDIT_PER_BYTE * len(data) + 600


@pytest.mark.parametrize("is_stream", [False, True])
@pytest.mark.parametrize("name", NASTY)
def test_a_flood_costs_a_limited_work_in_a_second_and_hides_no_datagram_of_frames(
    name: str, is_stream: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """10 MB/s, and between them what the autopilot sends: a frame, and three in one datagram."""
    piece = (NASTY[name] * 1400)[:1400]
    reader, pieces_per_s = FrameReader(), 7000
    own = [FRAMES[0], b"".join(FRAMES[:3])]
    for number in range(pieces_per_s):  # the first second uses up what was saved
        reader.refill(number / pieces_per_s)
        reader.feed(piece) if is_stream else reader.read(piece)
    counted, found_count = Work(monkeypatch), 0
    for number in range(pieces_per_s, 2 * pieces_per_s):
        reader.refill(number / pieces_per_s)
        reader.feed(piece) if is_stream else reader.read(piece)
        if not is_stream and number % 100 < 2:
            found_count += len(reader.read(own[number % 2]))
    assert counted.looks_count <= 3 * pieces_per_s + frames.WORK_PER_S / 48 + 3 * found_count
    assert counted.bytes_count <= pieces_per_s * 280 + 2 * frames.WORK_PER_S + 400 * found_count
    if not is_stream:
        assert found_count == 4 * pieces_per_s / 100


def test_a_frame_after_much_garbage_is_found_in_a_datagram_and_in_a_stream() -> None:
    for garbage in NASTY.values():
        noise = garbage * 40 + b"\0" * 400
        reader = FrameReader()
        found = [*reader.feed(noise + FRAMES[0]), *abandoned(reader)]
        assert [frame.data for frame in found] == [FRAMES[0]]
        assert [frame.data for frame in split(noise + FRAMES[0])[0]] == [FRAMES[0]]


def test_every_whole_frame_is_found_however_many_are_damaged() -> None:
    """As on a radio that damages nine of ten: a damaged frame pays for the work on it."""
    noise = random.Random(5)
    stream, sent = [], []
    for _ in range(3000):
        frame = noise.choice(FRAMES)
        if noise.random() < 0.9:
            damaged = bytearray(frame)
            end = len(frame) - 13 if frame is FRAMES[3] else len(frame)  # no checksum covers a signature
            damaged[noise.randrange(10, end)] ^= noise.randrange(1, 256)
            frame = bytes(damaged)
        else:
            sent.append(frame)
        stream.append(frame)
    reader = FrameReader()
    found = [*reader.feed(b"".join(stream)), *abandoned(reader)]
    assert [frame.data for frame in found] == sent
    assert len(sent) > 200


def test_fields_that_a_newer_autopilot_adds_do_not_cost_a_frame() -> None:
    kind = mavlink.mavlink_map[32]
    data = _frame(32, kind.crc_extra, bytes(range(1, kind.unpacker.size + 21)))
    ((frame,), garbage) = split(b"\0" + data)
    assert (frame.message_id, garbage) == (32, 1)
    assert Codec(1).decode(frame).time_boot_ms == 0x04030201
