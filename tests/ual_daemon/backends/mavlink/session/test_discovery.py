import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import AutopilotCodec
from tests.ual_daemon.backends.mavlink.fakes import (
    ADDRESS,
    Harness,
    attitude,
    heartbeat,
    packer,
    position,
)
from ual_daemon.backends.mavlink.settings import MavlinkSettings
from ual_daemon.backends.mavlink.wire import frames, untaken
from ual_daemon.backends.mavlink.wire.signing import Signer


def test_the_first_autopilot_received_is_the_only_one() -> None:
    harness = Harness()
    harness.receive(data=packer(7)(heartbeat()))
    harness.receive(data=packer(8)(heartbeat(armed=True)))
    harness.receive(data=packer(8)(attitude()) + packer(8)(position(0.0)))
    assert harness.session.system_id == 7
    assert harness.snapshot().control.armed.value is False
    assert harness.snapshot().motion.pose is None


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
    assert (snapshot.control.armed.value, snapshot.control.mode.value.name) == (True, "OFFBOARD")


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


def test_another_host_that_sends_as_our_autopilot_is_not_received_while_our_peer_is() -> None:
    harness = Harness()
    harness.receive(heartbeat(), attitude())
    for _ in range(20):
        harness.now_s += 0.1
        harness.receive(heartbeat(), position(harness.now_s))
        harness.receive(heartbeat(armed=True), attitude(), address=STRANGER)
    assert harness.link.peer == ADDRESS
    assert harness.snapshot().control.armed.value is False
    assert harness.discovery.receiver.stranger_count == 40
    harness.now_s += 0.6
    harness.receive(heartbeat(armed=True), address=STRANGER)  # our autopilot, by another way
    assert harness.link.peer == STRANGER
    assert harness.snapshot().control.armed.value is True


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
    assert harness.snapshot().control.armed.value is True


def test_others_are_remembered_and_named_in_bounds(caplog: pytest.LogCaptureFixture) -> None:
    harness = Harness()
    harness.receive(heartbeat())
    for _ in range(3):
        for system_id in range(2, 256):
            harness.receive(data=packer(system_id)(heartbeat()), address=STRANGER)
            harness.receive(data=packer(system_id)(attitude()))
    assert sum("more than one autopilot" in record.message for record in caplog.records) == 8
    assert harness.link.peer == ADDRESS
    assert len(harness.discovery.receiver.untaken._notes) == untaken.MOST_NOTES


GROUND_STATION = heartbeat(autopilot=mavlink.MAV_AUTOPILOT_INVALID, kind=mavlink.MAV_TYPE_GCS)
BETAFLIGHT = heartbeat(autopilot=mavlink.MAV_AUTOPILOT_GENERIC)


def received(harness: Harness, *sent: bytes, for_s: float = 3.0) -> str:
    """Sends data each second for some time. Returns what is told instead of the autopilot."""
    for _ in range(round(for_s)):
        for data in sent:
            harness.receive(data=data)
        harness.run(1.0)
    return harness.discovery.why_silent(harness.now_s)


@pytest.mark.parametrize("component_id", [0, 50, 200, 250])
def test_a_px4_or_ardupilot_at_any_component_is_taken_and_addressed_there(component_id: int) -> None:
    harness = Harness()
    harness.pack = packer(3, component_id)
    harness.receive(heartbeat())
    harness.run(1.0)
    harness.receive(heartbeat())
    assert harness.discovery.session is None, "an autopilot at component 1 may be beside it"
    harness.run(1.0)
    harness.receive(heartbeat(), heartbeat(armed=True), attitude(), position(harness.now_s))
    assert harness.session.source == (3, component_id)
    assert harness.snapshot().control.armed.value is True
    harness.run(1.0)
    sent = harness.link.take("COMMAND_LONG")
    assert {(each.target_system, each.target_component) for each in sent} == {(3, component_id)}
    assert len(sent) > 3


def test_an_autopilot_at_component_1_goes_before_any_other_component() -> None:
    harness = Harness()
    companion = packer(1, 191)
    harness.receive(data=companion(heartbeat()))
    harness.run(1.0)
    harness.receive(data=companion(heartbeat()))
    harness.receive(heartbeat())
    assert harness.session.source == (1, 1)


@pytest.mark.parametrize("component_id", [1, 200])
def test_an_autopilot_of_system_0_is_watched_and_nothing_is_sent_to_all_systems(component_id: int) -> None:
    harness = Harness()
    harness.pack = packer(0, component_id)
    for _ in range(4):
        harness.receive(BETAFLIGHT, attitude(), position(harness.now_s))
        harness.run(1.0)
    assert harness.session.source == (0, component_id)
    assert "system 0 (generic, quadrotor): what is sent to system 0 reaches every vehicle" in (
        harness.session.info().limitation
    )
    assert not harness.session.info().capabilities
    assert harness.snapshot().motion.pose is not None
    sent = [AutopilotCodec(1).decode(frame) for data in harness.link.sent for frame in frames.split(data)[0]]
    assert {each.get_type() for each in sent} == {"HEARTBEAT", "TIMESYNC"}
    assert {each.get_srcSystem() for each in sent} == {245}


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (packer(255, 190)(GROUND_STATION), "a gcs (system 255, component 190 at 127.0.0.1:14580): no autopilot"),
        (packer(255, 1)(GROUND_STATION), "a gcs (system 255 at 127.0.0.1:14580): no autopilot"),
        (
            packer(2)(heartbeat()),
            "px4 on a quadrotor (system 2 at 127.0.0.1:14580): mavlink.system_id is 7",
        ),
        (
            packer(7, 50)(BETAFLIGHT),
            (
                "generic on a quadrotor (system 7, component 50 at 127.0.0.1:14580): if it is the autopilot, set "
                "mavlink.autopilot_component_id=50"
            ),
        ),
        (packer(7)(attitude()), "messages of system 7, but no heartbeat"),
        (b"\x80\xf8\x00" * 30, "bytes that are no MAVLink (another baud rate or protocol?)"),
    ],
)
def test_what_is_received_and_why_it_is_not_taken_is_reported(
    data: bytes, told: str, caplog: pytest.LogCaptureFixture
) -> None:
    harness = Harness(MavlinkSettings(system_id=7))
    assert harness.discovery.why_silent(0.0) == "nothing comes to test"
    assert received(harness, data) == f"heard at test instead: {told}"
    (event,) = [record for record in caplog.records if vars(record).get("ual_event") == "no_autopilot"]
    assert vars(event)["ual_fields"]["heard"] == told
    assert harness.discovery.session is None
    harness.run(6.0)
    assert harness.discovery.why_silent(harness.now_s) == "nothing comes to test"


def test_an_autopilot_comes_first_of_what_is_reported_and_the_rest_is_counted() -> None:
    harness = Harness(MavlinkSettings(system_id=7))
    sent = [packer(1, component_id)(GROUND_STATION) for component_id in range(10, 15)]
    told = received(harness, *sent, packer(2)(heartbeat()))
    assert told.startswith("heard at test instead: px4 on a quadrotor (system 2 ")
    assert told.endswith("; and 3 more")


def test_a_chosen_component_is_taken_at_once_and_no_other() -> None:
    harness = Harness(MavlinkSettings(autopilot_component_id=50))
    harness.receive(data=packer(1)(heartbeat()))
    assert harness.discovery.session is None
    assert "mavlink.autopilot_component_id is 50" in harness.discovery.why_silent(0.0)
    harness.receive(data=packer(1, 50)(BETAFLIGHT))
    assert harness.session.source == (1, 50)


def test_what_is_received_after_the_autopilot_fell_silent_is_reported() -> None:
    """As where its id was changed, and it was booted."""
    harness = Harness()
    harness.receive(heartbeat())
    harness.receive(data=packer(4)(GROUND_STATION))
    harness.run(0.5)
    assert harness.discovery.why_silent(harness.now_s) == ""
    told = received(harness, packer(9)(heartbeat()))
    assert told == (
        "heard at test instead: px4 on a quadrotor (system 9 at 127.0.0.1:14580): this daemon flies system 1, "
        "the first heard"
    )


def test_a_ground_station_at_component_1_is_no_second_autopilot(caplog: pytest.LogCaptureFixture) -> None:
    harness = Harness()
    harness.receive(heartbeat())
    for autopilot in (mavlink.MAV_AUTOPILOT_INVALID, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 0):
        harness.receive(data=packer(255)(heartbeat(autopilot=autopilot, kind=mavlink.MAV_TYPE_GCS)))
    assert [record.message for record in caplog.records if "more than one" in record.message] == []


@pytest.mark.parametrize("flag", [0, mavlink.MAV_PROTOCOL_CAPABILITY_COMPONENT_IMPLEMENTS_GIMBAL_MANAGER])
def test_gimbals_are_requested_of_a_px4_if_its_version_says_that_it_manages_some(flag: int) -> None:
    harness = Harness()
    harness.receive(heartbeat())
    harness.run(5.0)  # its version is not known yet
    assert gimbal_requests(harness) == 0
    texts = [[0] * 8] * 3
    harness.receive(heartbeat(), mavlink.MAVLink_autopilot_version_message(flag, 0x011100FF, 0, 0, 0, *texts, 0, 0, 0))
    for _ in range(10):
        harness.receive(heartbeat())
        harness.run(1.0)
    assert (gimbal_requests(harness) > 0) is (flag > 0)


def gimbal_requests(harness: Harness) -> int:
    asked = harness.commands(mavlink.MAV_CMD_REQUEST_MESSAGE)
    return sum(each.param1 == mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION for each in asked)
