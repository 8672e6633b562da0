from tests.ual_daemon.backends.mavlink.fakes import (
    ADDRESS,
    Harness,
    attitude,
    heartbeat,
    packer,
    position,
)
from ual_daemon.backends.mavlink.settings import MavlinkSettings
from ual_daemon.backends.mavlink.wire.messages import mavlink


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
