from __future__ import annotations

from pymavlink.dialects.v20 import all as mavlink

from tests.campaign.ears import Ears
from tests.campaign.positions import Origin
from tests.campaign.record import Record, ReportedSample

OFFBOARD, POSCTL = 6 << 16, 3 << 16


def heartbeat(sequence: int, mode: int) -> bytes:
    sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=mavlink.MAV_COMP_ID_AUTOPILOT1)
    sender.seq = sequence
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    message = mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4, armed, mode, mavlink.MAV_STATE_ACTIVE, 3
    )
    return bytes(message.pack(sender))


def reported(*heard: bytes) -> list[ReportedSample]:
    record = Record("px4", (100.0, 50.0))
    ears = Ears(record, Origin(47.0, 8.0, 500.0))
    for each in heard:
        ears.hear_autopilot(each)
    return record.told


def test_what_a_path_with_jitter_brings_after_something_newer_is_not_reported() -> None:
    modes = [each.mode for each in reported(heartbeat(254, POSCTL), heartbeat(2, OFFBOARD), heartbeat(255, POSCTL))]
    assert modes == [POSCTL, OFFBOARD]


def test_an_item_of_a_mission_is_no_command() -> None:
    record = Record("px4")
    sender = mavlink.MAVLink(None, srcSystem=250, srcComponent=191)
    item = mavlink.MAVLink_mission_item_int_message(
        1, 1, 0, 6, mavlink.MAV_CMD_NAV_WAYPOINT, 0, 1, *(0.0,) * 4, 0, 0, 3.0
    )
    Ears(record, Origin(47.0, 8.0, 500.0)).hear_daemon(bytes(item.pack(sender)))
    assert [sent.what for sent in record.sent] == ["mission_item_int"]


def test_what_comes_in_order_is_reported() -> None:
    modes = [each.mode for each in reported(heartbeat(254, POSCTL), heartbeat(255, OFFBOARD), heartbeat(0, POSCTL))]
    assert modes == [POSCTL, OFFBOARD, POSCTL]


def test_a_download_of_a_file_or_a_log_changes_nothing() -> None:
    """A download that was begun goes on in every mode. It counted as sending after a take-over."""
    record, sender = Record("px4"), mavlink.MAVLink(None, srcSystem=250, srcComponent=191)
    ears = Ears(record, Origin(47.0, 8.0, 500.0))
    for opcode in (mavlink.MAV_FTP_OPCODE_READFILE, mavlink.MAV_FTP_OPCODE_BURSTREADFILE):
        payload = bytes((1, 0, 0, opcode)).ljust(251, b"\0")
        ears.hear_daemon(bytes(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, payload).pack(sender)))
    ears.hear_daemon(bytes(mavlink.MAVLink_log_request_data_message(1, 1, 3, 0, 90).pack(sender)))
    assert record.sent == []
    payload = bytes((1, 0, 0, mavlink.MAV_FTP_OPCODE_WRITEFILE)).ljust(251, b"\0")
    ears.hear_daemon(bytes(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, payload).pack(sender)))
    ears.hear_daemon(bytes(mavlink.MAVLink_log_erase_message(1, 1).pack(sender)))
    assert [sent.what for sent in record.sent] == ["file_transfer_protocol", "log_erase"]


def test_the_end_of_an_upload_of_the_daemon_is_noted() -> None:
    record, ears_of = Record("ardupilot"), Origin(47.0, 8.0, 500.0)
    ears = Ears(record, ears_of)
    daemon = mavlink.MAVLink(None, srcSystem=250, srcComponent=191)
    ears.hear_daemon(bytes(mavlink.MAVLink_mission_count_message(1, 1, 2, 0).pack(daemon)))
    autopilot = mavlink.MAVLink(None, srcSystem=1, srcComponent=mavlink.MAV_COMP_ID_AUTOPILOT1)
    for target, result, kind in ((255, 0, 0), (250, 13, 0), (250, 0, 1)):
        ears.hear_autopilot(bytes(mavlink.MAVLink_mission_ack_message(target, 191, result, kind).pack(autopilot)))
    assert record.uploaded == []
    ears.hear_autopilot(bytes(mavlink.MAVLink_mission_ack_message(250, 191, 0, 0).pack(autopilot)))
    assert len(record.uploaded) == 1
