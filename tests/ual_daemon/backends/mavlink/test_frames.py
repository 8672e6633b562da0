import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.ual_daemon.backends.mavlink import fakes
from tests.ual_daemon.backends.mavlink.fakes import Talk, heartbeat, packer
from ual_daemon.backends.mavlink.frames import split
from ual_daemon.backends.mavlink.messages import Codec, CorruptFrameError, mavlink


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
    (frame,), _ = split(bytes(damaged))
    with pytest.raises(CorruptFrameError):
        Codec(1).decode(frame)
    assert split(whole[:at])[0] == []


def test_garbage_is_counted_and_harms_nothing() -> None:
    talk = Talk()
    talk.hear(heartbeat())
    noise = random.Random(2)
    for _ in range(2000):
        head = bytes((0xFD, noise.randrange(60), 0, 0, 0, 1, 1, noise.choice((0, 1, 24, 32, 77)), 0, 0))
        talk.hear(data=noise.choice((b"", head)) + noise.randbytes(noise.randrange(1, 80)))
    assert talk.conversation.corrupt_count > 2000
    talk.hear(heartbeat(armed=True))
    assert talk.snapshot().armed.value is True


def test_no_content_of_a_message_is_too_strange() -> None:
    """Whatever an autopilot puts into the messages that are used, with a right checksum."""
    noise = random.Random(3)
    talk = Talk()
    talk.hear(heartbeat())
    used = [i for i in mavlink.mavlink_map if talk.vehicle.uses(i)]
    assert len(used) == 15
    for _ in range(300):
        for message_id in used:
            kind = mavlink.mavlink_map[message_id]
            size = kind.unpacker.size
            payload = noise.choice((noise.randbytes(size), b"\xff" * size, b"\0", noise.randbytes(size // 2 + 1)))
            talk.now_s += 0.001
            talk.hear(data=_frame(message_id, kind.crc_extra, payload))
            talk.conversation.tick(talk.now_s)
            talk.snapshot()
            talk.vehicle.info()
    assert talk.conversation.corrupt_count == 0


def _frame(message_id: int, crc_extra: int, payload: bytes) -> bytes:
    body = bytes((len(payload), 0, 0, 0, 1, 1, *message_id.to_bytes(3, "little"))) + payload
    crc = mavlink.x25crc(body + bytes((crc_extra,))).crc
    return b"\xfd" + body + int(crc).to_bytes(2, "little")
