import struct

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.fakes import BOOT_MS, Harness, ack, attitude, heartbeat, position
from tests.ual_daemon.backends.mavlink.traces import load
from ual_daemon.backends.firmwares.px4_events import Event, event_id
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.wire import checksum
from ual_daemon.backends.mavlink.wire.frames import MavlinkFrame, split
from ual_daemon.backends.mavlink.wire.messages import Codec
from ual_daemon.backends.mavlink.wire.messages import mavlink as ours

EVENT_ID = ours.MAVLINK_MSG_ID_EVENT
LOITER, LOITER_NAME = 4 << 16 | 3 << 24, "AUTO.LOITER"
ERROR, INFO = 0x33, 0x66
ARM, CHECK = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_RUN_PREARM_CHECKS
MODES_ALL, MODES_MANUAL, MODES_LOITER = 0xFFFFFFFF, 0b0111, 1 << 4


def event(name: str, *, levels: int = ERROR, modes: int = 0, sequence: int = 1, boot_ms: int = 5000) -> bytes:
    """The frame of an event as PX4 sends it, the zeros at its end left out."""
    arguments = struct.pack("<IB", modes, 20)
    payload = struct.pack("<IIHBBB", event_id(name), boot_ms, sequence, 0, 0, levels) + arguments
    payload = payload.rstrip(b"\0")
    covered = (
        struct.pack("<BBBBBB", len(payload), 0, 0, sequence % 256, 1, 1) + EVENT_ID.to_bytes(3, "little") + payload
    )
    crc = mavlink.x25crc(covered + bytes((160,))).crc
    data = bytes((0xFD, *covered, crc & 0xFF, crc >> 8))
    assert checksum.is_valid(EVENT_ID, data, 1 + len(covered))
    return data


def frame(data: bytes) -> MavlinkFrame:
    ((found,), garbage_count) = split(data)
    assert not garbage_count
    return found


def read(data: bytes, mode: str) -> Event:
    """Returns the event in a frame, as it is in a mode."""
    return Px4().event(Codec(1).decode(frame(data)), mode)


def test_ids_are_those_that_a_real_px4_sends() -> None:
    # of the recorded flights: the pilot arms, and PX4 disarms after the landing
    assert event_id("commander_armed_by") == 0x0190CAF3
    assert event_id("commander_disarmed_by") == 0x01F46777


def test_words_of_a_denial_are_those_of_its_name() -> None:
    found = read(event("commander_arm_denied_resolve_failures"), LOITER_NAME)
    assert found.text == "arm denied resolve failures"
    assert found.armed is None


@pytest.mark.parametrize(("boot_ms", "is_news"), [(BOOT_MS + 10_000, True), (BOOT_MS + 9_500, True), (5_000, False)])
def test_an_event_that_px4_sends_again_for_somebody_else_is_no_news(boot_ms: int, is_news: bool) -> None:
    harness = Harness()
    harness.receive(heartbeat(6 << 16, armed=True), attitude())
    harness.now_s = 0.5  # in the time of a fast simulator
    harness.receive(position(10.0))
    harness.receive(data=event("commander_disarmed_by", sequence=3, boot_ms=boot_ms))
    assert harness.snapshot().control.armed.value is not is_news


@pytest.mark.parametrize(
    ("modes", "mode", "is_told"),
    [
        (MODES_ALL, LOITER_NAME, True),
        (MODES_LOITER, LOITER_NAME, True),
        (MODES_MANUAL, LOITER_NAME, False),
        (MODES_MANUAL, "POSCTL", True),
        (MODES_MANUAL, "EXTERNAL1", True),  # not known: better a word too many
    ],
)
def test_a_failed_check_is_reported_where_it_concerns_the_mode(modes: int, mode: str, is_told: bool) -> None:
    found = read(event("check_modes_manual_control", modes=modes), mode)
    assert found.text == ("check modes manual control" if is_told else "")


def test_what_is_not_known_or_no_trouble_has_no_words() -> None:
    assert read(event("some_event_of_a_later_px4"), LOITER_NAME).text == ""
    assert read(event("check_battery_low", levels=INFO, modes=MODES_ALL), LOITER_NAME).text == ""


def test_arming_and_disarming_are_known_with_the_event_before_the_heartbeat() -> None:
    harness = Harness()
    harness.receive(heartbeat(LOITER))
    harness.receive(data=event("commander_armed_by", levels=INFO, sequence=5))
    assert harness.snapshot().control.armed.value is True
    harness.receive(data=event("commander_disarmed_by", levels=INFO, sequence=7))
    assert harness.snapshot().control.armed.value is False
    harness.receive(data=event("commander_armed_by", levels=INFO, sequence=6))  # late, by a bad link
    assert harness.snapshot().control.armed.value is False


def test_a_refused_arming_says_which_checks_failed_on_a_link_without_status_texts() -> None:
    harness = Harness()
    harness.receive(heartbeat(LOITER))
    future = harness.session.submit(Px4().arm(harness.snapshot()), harness.now_s)
    harness.receive(data=event("commander_arm_denied_resolve_failures"))
    harness.receive(ack(ARM, mavlink.MAV_RESULT_TEMPORARILY_REJECTED))
    harness.run(0.1)
    assert len(harness.commands(CHECK)) == 1
    assert not future.done()
    for sequence, name in enumerate(("check_battery_low", "check_gyro_missing", "check_battery_low"), 2):
        harness.receive(data=event(name, modes=MODES_ALL, sequence=sequence))
    harness.run(0.5)
    assert str(future.exception(0)) == (
        "PX4 refused to arm: TEMPORARILY_REJECTED; it said: arm denied resolve failures; "
        "it said: check battery low; it said: check gyro missing"
    )


@pytest.mark.parametrize("name", ["px4_auto_takeoff_loiter_rtl", "px4_offboard_manual_recover"])
def test_the_events_of_a_recorded_flight_say_when_it_was_armed_and_disarmed(name: str) -> None:
    trace = load(name)
    events = [
        (time_s, found.armed)
        for time_s, data in trace.frames
        if frame(data).message_id == EVENT_ID and (found := read(data, "")).armed is not None
    ]
    assert [armed for _, armed in events] == [True, False]
    assert events[0][0] == pytest.approx(trace.time_s("pilot_arms"), abs=0.3)
    assert trace.time_s("autopilot_disarmed") - 1.1 < events[1][0] < trace.time_s("autopilot_disarmed") + 0.1


def test_the_mode_that_came_with_the_event_of_an_arming_may_be_the_one_before() -> None:
    """A busy computer reads both at the same moment. The mode that the arming has entered comes a second later."""
    harness = Harness()
    landed = mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_ON_GROUND)
    harness.receive(heartbeat(6 << 16), attitude(), landed, data=event("commander_armed_by"))
    control = harness.snapshot().control
    assert control.armed is not None
    assert control.armed.value
    assert control.settled_mode == ""
    harness.now_s += 0.5
    harness.receive(heartbeat(LOITER, armed=True))
    assert harness.snapshot().control.settled_mode == LOITER_NAME


CRITICAL, WARNING = 0x42, 0x44


@pytest.mark.parametrize(
    ("name", "levels", "text"),
    [
        ("navigator_terrain_collision_risk", CRITICAL, "navigator terrain collision risk"),
        ("commander_failsafe_enter", CRITICAL, "failsafe enter"),
        ("commander_gcs_lost", WARNING, ""),
        ("check_battery_critical", CRITICAL, ""),
    ],
)
def test_a_severe_event_is_reported_unless_it_is_a_check(name: str, levels: int, text: str) -> None:
    assert read(event(name, levels=levels), LOITER_NAME).severe_text == text


def test_a_severe_event_without_a_name_is_reported_by_its_number() -> None:
    found = read(event("no_name_of_ours", levels=CRITICAL), LOITER_NAME)
    assert found.severe_text == f"event {event_id('no_name_of_ours')}, of which UAL knows no name"
