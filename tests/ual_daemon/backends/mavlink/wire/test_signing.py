import hashlib
import logging
import os
import random
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.fakes import ADDRESS, Harness, attitude, heartbeat, packer
from ual_daemon.backends.mavlink.wire import checksum
from ual_daemon.backends.mavlink.wire import dialect as wire_dialect
from ual_daemon.backends.mavlink.wire.frames import MavlinkFrame, split
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.mavlink.wire.signing import (
    EPOCH_S,
    MOST_SENDERS,
    OLDEST_TIMESTAMP_S,
    SignatureVerdict,
    Signer,
    read_key,
)
from ual_daemon.settings import ConfigError

KEY = bytes(range(200, 232))
NOW_S = 1.8e9
NOW = int((NOW_S - EPOCH_S) * 1e5)


class Vehicle:
    """Signs as pymavlink does, which others use."""

    def __init__(self, key: bytes = KEY, timestamp: int = NOW, link_id: int = 0) -> None:
        self.mav: Any = mavlink.MAVLink(None, 1, 1)
        self.mav.signing.secret_key = key
        self.mav.signing.sign_outgoing = True
        self.mav.signing.timestamp = timestamp
        self.mav.signing.link_id = link_id

    def pack(self, message: Message) -> bytes:
        packed: bytes = message.pack(self.mav)
        return packed

    def frame(self) -> MavlinkFrame:
        return split(self.pack(heartbeat()))[0][0]


def signer(utc_s: float = NOW_S) -> Signer:
    return Signer(KEY, lambda: utc_s)


def key_file(tmp_path: Path, content: bytes, mode: int = 0o600) -> str:
    path = tmp_path / "key"
    path.write_bytes(content)
    path.chmod(mode)
    return str(path)


def test_a_key_is_what_the_file_says_it_is(tmp_path: Path) -> None:
    for content in (b"raw:" + KEY, b"hex:" + KEY.hex().encode(), b"hex: " + KEY.hex(" ").upper().encode() + b"\r\n"):
        assert read_key(key_file(tmp_path, content)) == KEY


@pytest.mark.parametrize("length", [1, 11, 30, 31, 32, 33, 64])
@pytest.mark.parametrize("end", [b"", b"\n", b"\r\n"])
def test_a_row_of_text_is_a_passphrase_whatever_its_length(tmp_path: Path, length: int, end: bytes) -> None:
    passphrase = (b"open sesame " * 6)[:length].replace(b" ", b"-")
    assert read_key(key_file(tmp_path, passphrase + end)) == hashlib.sha256(passphrase).digest()


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "no line of text"),
        (b"\n", "no line of text"),
        (b"\xff\xfe\x00" * 9, "no line of text"),
        (KEY, "write raw: before the 32 bytes"),
        (b"two\nlines\n", "no line of text"),
        (b"a" * 5000, "no line of text"),
        (b"raw:" + KEY[:-1], "raw: must be followed by the 32 bytes"),
        (b"raw:" + KEY + b"\n", "raw: must be followed by the 32 bytes"),
        (b"HEX:" + KEY.hex().encode(), "begins with 'HEX': write hex: as its first letters"),
        (b" hex:" + KEY.hex().encode(), "begins with ' hex': write hex: as its first letters"),
        (b"Raw :" + KEY, "begins with 'Raw ': write raw: as its first letters"),
        (b"hex:" + b"0f" * 31, "hex: must be followed by 64 hexadecimal digits"),
        (b"hex:" + b"0g" * 32, "hex: must be followed by 64 hexadecimal digits"),
    ],
)
def test_a_file_that_is_no_key_is_refused(tmp_path: Path, content: bytes, why: str) -> None:
    with pytest.raises(ConfigError, match=why) as caught:
        read_key(key_file(tmp_path, content))
    assert caught.value.key == "mavlink.signing_key_file"


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o666])
def test_a_key_that_others_could_read_is_refused_with_what_to_do(tmp_path: Path, mode: int) -> None:
    path = key_file(tmp_path, KEY, mode)
    with pytest.raises(ConfigError) as caught:
        read_key(path)
    assert f"run: chmod 600 {path}" in str(caught.value)


def test_a_key_that_is_not_there_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        read_key(os.fspath(tmp_path / "none"))


def test_what_is_signed_with_the_key_is_good_once() -> None:
    ours, frame = signer(), Vehicle().frame()
    assert [ours.check(frame), ours.check(frame)] == [SignatureVerdict.GOOD, SignatureVerdict.REPEATED]


def test_what_is_not_or_wrongly_signed_is_not_believed() -> None:
    ours = signer()
    assert ours.check(split(packer()(heartbeat()))[0][0]) is SignatureVerdict.UNSIGNED
    assert ours.check(Vehicle(b"y" * 32).frame()) is SignatureVerdict.WRONG_KEY


def test_a_forged_timestamp_does_not_shut_the_autopilot_out() -> None:
    ours = signer()
    assert ours.check(Vehicle(b"y" * 32, timestamp=NOW + 10**9).frame()) is SignatureVerdict.WRONG_KEY
    assert ours.check(Vehicle().frame()) is SignatureVerdict.GOOD


def test_a_sender_first_received_may_be_a_minute_behind_us() -> None:
    assert signer().check(Vehicle(timestamp=NOW - 5_999_999).frame()) is SignatureVerdict.GOOD
    assert signer().check(Vehicle(timestamp=NOW - 6_000_100).frame()) is SignatureVerdict.OLD


def test_each_link_of_a_sender_has_its_own_timestamps() -> None:
    ours = signer()
    assert ours.check(Vehicle(timestamp=NOW).frame()) is SignatureVerdict.GOOD
    assert ours.check(Vehicle(timestamp=NOW - 100, link_id=1).frame()) is SignatureVerdict.GOOD


class Clock:
    """Our clock, which a test sets."""

    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def crowd(ours: Signer, timestamp: int) -> list[SignatureVerdict]:
    """Signs once on each link but the last one."""
    return [ours.check(Vehicle(timestamp=timestamp + each, link_id=each).frame()) for each in range(255)]


def test_the_number_of_senders_that_are_remembered_is_limited() -> None:
    ours = signer()
    assert crowd(ours, NOW) == [SignatureVerdict.GOOD] * MOST_SENDERS + [SignatureVerdict.CROWDED] * (
        255 - MOST_SENDERS
    )
    assert len(ours._newest) == MOST_SENDERS


def test_a_sender_that_is_received_is_not_forgotten_for_others_whose_clock_is_ahead() -> None:
    clock = Clock()
    ours = Signer(KEY, lambda: NOW_S + clock.now_s, clock)
    for each in range(3):
        clock.now_s += OLDEST_TIMESTAMP_S - 1.0
        now = NOW + round(clock.now_s * 1e5)
        assert ours.check(Vehicle(timestamp=now, link_id=255).frame()) is SignatureVerdict.GOOD
        crowd(ours, now + 10**6 * each)
        assert ours.check(Vehicle(timestamp=now + 1, link_id=255).frame()) is SignatureVerdict.GOOD


def test_what_a_forgotten_sender_signed_is_not_accepted_again() -> None:
    clock = Clock()
    ours = Signer(KEY, lambda: NOW_S, clock)
    ahead = [Vehicle(timestamp=NOW + 10**7 + each, link_id=each).frame() for each in range(MOST_SENDERS)]
    assert {ours.check(frame) for frame in ahead} == {SignatureVerdict.GOOD}
    clock.now_s = OLDEST_TIMESTAMP_S + 1.0
    new = Vehicle(timestamp=NOW + 10**7 + 1000, link_id=255)
    assert ours.check(new.frame()) is SignatureVerdict.GOOD  # the first of them is forgotten for it
    assert ours.check(ahead[0]) is SignatureVerdict.REPEATED
    assert len(ours._newest) == MOST_SENDERS


def test_our_timestamps_always_grow_and_follow_the_newest_received() -> None:
    ours = signer(utc_s=0.0)  # a computer that does not know what time it is
    assert [ours.next_timestamp(), ours.next_timestamp()] == [1, 2]
    assert ours.check(Vehicle(timestamp=NOW).frame()) is SignatureVerdict.GOOD
    assert ours.next_timestamp() >= NOW


def mutated(data: bytes, chance: random.Random) -> bytes:
    """Changes a frame in one way: a bit, a byte more or less, its end, or its head; often with a right checksum."""
    changed = bytearray(data)
    at = chance.randrange(len(changed))
    kind = chance.randrange(5)
    if kind == 0:
        changed[at] ^= 1 << chance.randrange(8)
    elif kind == 1:
        changed.insert(at, chance.randrange(256))
    elif kind == 2:
        del changed[at]
    elif kind == 3:
        del changed[at:]
    else:
        changed[chance.randrange(1, 10)] = chance.randrange(256)
    end = 10 + changed[1] if len(changed) > 1 else 0
    if chance.random() < 0.7 and 10 <= end < len(changed) - 1:  # as a forger would
        number = changed[7] | changed[8] << 8 | changed[9] << 16
        kind_of = wire_dialect.mavlink_map.get(number)
        if kind_of is not None:
            changed[end : end + 2] = checksum.compute(bytes(changed[1:end]), kind_of.crc_extra)
    return bytes(changed)


def test_of_thousands_of_forged_frames_none_is_good_and_each_right_one_is_good_once() -> None:
    chance, ours, accepted = random.Random(7), signer(), set[bytes]()
    vehicle, pieces_count = Vehicle(), 0
    right = [vehicle.pack(heartbeat()) for _ in range(40)] + [vehicle.pack(attitude()) for _ in range(40)]
    for number, data in enumerate(right):
        for _ in range(60):
            base = right[chance.randrange(number + 1)]  # one that came before, or this one
            forged = mutated(base, chance) if chance.random() < 0.9 or base not in accepted else base
            for frame in split(forged)[0]:
                pieces_count += 1
                verdict = ours.check(frame)
                assert verdict is not SignatureVerdict.GOOD or (frame.data == data and data not in accepted)
                accepted |= {frame.data} if verdict is SignatureVerdict.GOOD else set()
        if data not in accepted:
            assert ours.check(split(data)[0][0]) is SignatureVerdict.GOOD
            accepted.add(data)
    assert pieces_count > 1000
    assert accepted == set(right)


def test_the_last_timestamp_that_there_is_does_not_keep_us_from_sending() -> None:
    ours = signer()
    assert ours.check(Vehicle(timestamp=2**48 - 1).frame()) is SignatureVerdict.GOOD
    for _ in range(2):
        assert len(ours.sign(packer()(heartbeat()))) > 13


# --- In the receiver --------------------------------------------------------------------------------------------------


def test_what_we_send_is_signed_so_that_pymavlink_believes_it() -> None:
    harness = Harness(signer=signer())
    harness.receive(data=Vehicle().pack(heartbeat()))
    harness.run(1.0)
    receiver: Any = mavlink.MAVLink(None)
    receiver.signing.secret_key = KEY
    assert len(harness.link.sent) > 5
    for data in harness.link.sent:
        receiver.decode(bytearray(data))
    assert receiver.signing.goodsig_count == len(harness.link.sent)


def test_unsigned_messages_are_dropped_counted_and_reported_once(caplog: pytest.LogCaptureFixture) -> None:
    harness = Harness(signer=signer())
    with caplog.at_level(logging.WARNING):
        harness.receive(heartbeat(), heartbeat(), attitude())
    assert harness.discovery.session is None
    assert harness.link.peer is None
    assert harness.discovery.receiver.unsigned_count == 2  # until it is found, only heartbeats matter
    assert [record.message for record in caplog.records] == ["messages of system 1 are dropped: not signed"]
    vehicle = Vehicle()
    harness.receive(data=vehicle.pack(heartbeat()))
    harness.receive(heartbeat(armed=True), address=("6.6.6.6", 6))
    assert harness.snapshot().control.armed.value is False
    assert harness.link.peer == ADDRESS


def test_an_autopilot_whose_clock_is_behind_is_answered_so_that_it_can_follow() -> None:
    harness = Harness(signer=signer())
    harness.receive(data=Vehicle(timestamp=5).pack(heartbeat()))
    assert harness.discovery.session is None
    harness.run(0.1)
    assert len(harness.link.take("HEARTBEAT")) == 1
    harness.receive(data=Vehicle(timestamp=NOW).pack(heartbeat()))
    assert harness.session.system_id == 1


def test_signed_messages_are_received_without_a_key_and_that_it_is_missing_is_reported_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    harness, vehicle = Harness(), Vehicle()
    with caplog.at_level(logging.WARNING):
        harness.receive(data=vehicle.pack(heartbeat()) + vehicle.pack(attitude()))
    assert harness.session.system_id == 1
    assert [record.message for record in caplog.records] == [
        "system 1 signs its messages and may not listen to ours: set mavlink.signing_key_file"
    ]


def test_that_a_key_may_be_missing_is_reported_where_no_request_is_answered() -> None:
    harness, vehicle = Harness(), Vehicle()
    for _ in range(80):
        harness.receive(data=vehicle.pack(heartbeat()))
        harness.run(0.1)
    refused = harness.snapshot().link.refused
    assert refused.startswith("CURRENT_MODE (no answer)")
    assert refused.endswith("; it signs its messages and may not listen to ours: set mavlink.signing_key_file")
    harness.receive(heartbeat())  # not signed
    assert "signs" not in harness.snapshot().link.refused


def test_a_key_in_a_home_directory_that_is_not_there_is_refused_by_its_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr("pwd.getpwuid", {}.__getitem__)
    with pytest.raises(ConfigError, match="cannot read ~/key: there is no home directory: set HOME"):
        read_key("~/key")
