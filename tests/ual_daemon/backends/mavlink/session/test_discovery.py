import pytest

from tests.ual_daemon.backends.mavlink.fakes import (
    ADDRESS,
    Harness,
    attitude,
    heartbeat,
    packer,
    position,
)
from ual_daemon.backends.mavlink.settings import MavlinkSettings
from ual_daemon.backends.mavlink.wire import frames
from ual_daemon.backends.mavlink.wire.frames import Frame
from ual_daemon.backends.mavlink.wire.messages import Codec, Message, mavlink
from ual_daemon.backends.mavlink.wire.signing import Signer


def test_the_first_autopilot_heard_is_the_only_one() -> None:
    harness = Harness()
    harness.receive(data=packer(7)(heartbeat()))
    harness.receive(data=packer(8)(heartbeat(armed=True)))
    harness.receive(data=packer(8)(attitude()) + packer(8)(position(0.0)))
    assert harness.session.system_id == 7
    assert harness.snapshot().armed.value is False
    assert harness.snapshot().pose is None


def test_with_a_system_id_set_any_other_is_passed_over() -> None:
    harness = Harness(MavlinkSettings(system_id=8))
    harness.receive(data=packer(7)(heartbeat()))
    assert harness.discovery.session is None
    harness.receive(data=packer(8)(heartbeat()))
    assert harness.session.system_id == 8


def test_heartbeats_of_other_components_change_nothing() -> None:
    harness = Harness()
    gcs = heartbeat(autopilot=mavlink.MAV_AUTOPILOT_INVALID, kind=mavlink.MAV_TYPE_GCS)
    harness.receive(data=packer(255, 190)(gcs))
    harness.receive(data=packer(9, 1)(gcs))  # some ground stations call themselves component 1
    assert harness.discovery.session is None
    harness.receive(heartbeat(0x00060000, armed=True))
    harness.receive(data=packer(1, 154)(heartbeat(0)))  # a gimbal of the same system
    harness.receive(data=packer(255, 190)(gcs))
    snapshot = harness.snapshot()
    assert (snapshot.armed.value, snapshot.mode.value.name) == (True, "OFFBOARD")


def test_nothing_is_sent_until_somebody_is_known_and_then_to_the_address_that_it_sends_from() -> None:
    harness = Harness()
    harness.run(3.0)
    assert harness.link.sent == []
    harness.receive(heartbeat(), address=("10.0.0.7", 1234))
    assert harness.link.peer == ("10.0.0.7", 1234)
    harness.receive(attitude(), address=("10.0.0.7", 5678))
    assert harness.link.peer == ("10.0.0.7", 5678)


def test_who_sends_no_valid_frame_is_not_answered() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    damaged = bytearray(harness.pack(attitude()))
    damaged[-1] ^= 1
    harness.receive(data=bytes(damaged), address=("6.6.6.6", 6))
    harness.receive(data=packer(2)(attitude()), address=("6.6.6.6", 6))
    assert harness.link.peer == ADDRESS


def test_a_known_peer_is_called_once_a_second_until_the_autopilot_answers() -> None:
    harness = Harness()
    harness.link.answer_to(ADDRESS)
    harness.run(2.5)
    assert len(harness.link.take("HEARTBEAT")) == 3


def test_our_heartbeat_is_an_onboard_computers_of_the_same_system_at_1_hz() -> None:
    harness = Harness()
    harness.receive(data=packer(7)(heartbeat()))
    harness.run(5.0)
    beats = harness.link.take("HEARTBEAT")
    assert len(beats) == 5
    assert {(b.get_srcSystem(), b.get_srcComponent(), b.type, b.autopilot) for b in beats} == {
        (7, 191, mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID)
    }


STRANGER = ("6.6.6.6", 6)


def test_another_host_that_sends_as_our_autopilot_is_not_heard_while_our_peer_is() -> None:
    harness = Harness()
    harness.receive(heartbeat(), attitude())
    for _ in range(20):
        harness.now_s += 0.1
        harness.receive(heartbeat(), position(harness.now_s))
        harness.receive(heartbeat(armed=True), attitude(), address=STRANGER)
    assert harness.link.peer == ADDRESS
    assert harness.snapshot().armed.value is False
    assert harness.discovery.receiver.stranger_count == 40
    harness.now_s += 0.6
    harness.receive(heartbeat(armed=True), address=STRANGER)  # our autopilot, by another way
    assert harness.link.peer == STRANGER
    assert harness.snapshot().armed.value is True


def test_a_signed_frame_shows_that_the_autopilot_has_a_new_address() -> None:
    sender = mavlink.MAVLink(None, 1, 1)
    sender.signing.secret_key = b"k" * 32
    sender.signing.sign_outgoing = True
    harness = Harness(signer=Signer(b"k" * 32, lambda: 1.42e9 + 5e8))
    for timestamp, address in ((1, ADDRESS), (2, STRANGER)):
        sender.signing.timestamp = round((1.92e9 - 1_420_070_400) * 1e5) + timestamp
        harness.receive(data=heartbeat().pack(sender), address=address)
        assert harness.link.peer == address


def test_a_strangers_garbage_is_not_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    harness = Harness()
    harness.receive(heartbeat())
    looks = []
    look = frames._size_at

    def counted(data: bytes, at: int) -> int | None:
        looks.append(at)
        return look(data, at)

    monkeypatch.setattr(frames, "_size_at", counted)
    garbage = b"\xfe\x1c" * 600
    harness.receive(data=garbage, address=STRANGER)
    harness.receive(data=b"x" + garbage + harness.pack(heartbeat(armed=True)), address=STRANGER)
    assert looks == [0]
    harness.now_s += 5.0
    harness.receive(data=harness.pack(heartbeat()) + harness.pack(heartbeat(armed=True)), address=STRANGER)
    assert harness.snapshot().armed.value is True


def test_other_systems_are_decoded_once_each_and_few_are_named(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    harness = Harness()
    harness.receive(heartbeat())
    decoded: list[int] = []
    decode = Codec.decode

    def counted(self: Codec, frame: Frame) -> Message:
        decoded.append(frame.system_id)
        return decode(self, frame)

    monkeypatch.setattr(Codec, "decode", counted)
    for _ in range(3):
        for system_id in range(2, 256):
            harness.receive(data=packer(system_id)(heartbeat()), address=STRANGER)
            harness.receive(data=packer(system_id)(attitude()))
    assert decoded == list(range(2, 256))
    assert sum("more than one autopilot" in record.message for record in caplog.records) == 8
    assert harness.link.peer == ADDRESS
