"""Hears what passes on the wire, and notes what the judge needs."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable

from pymavlink.dialects.v20 import all as mavlink

from tests.campaign.modes import BY_AUTOPILOT
from tests.campaign.positions import Origin
from tests.campaign.record import Located, Place, Record, ReportedSample, Sent, Text, Value
from tests.campaign.truth import note_home
from ual_daemon.backends.mavlink.session.sequence import SequenceUnwrapper
from ual_daemon.backends.mavlink.wire.frames import FrameReader, MavlinkFrame
from ual_daemon.backends.mavlink.wire.messages import Codec, Message

_CURRENT_MODE, _EVENT = 436, 410
_ARMING_EVENTS = {26266355: True, 32794487: False}
"""PX4 tells so that it was armed or disarmed, ahead of its heartbeat."""
_AUTOPILOT = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION,
        mavlink.MAVLINK_MSG_ID_PARAM_VALUE,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_STATUSTEXT,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
        mavlink.MAVLINK_MSG_ID_MISSION_ACK,
        _CURRENT_MODE,
        _EVENT,
    }
)
_BOUNDING = frozenset(
    {
        "GF_MAX_HOR_DIST",
        "FENCE_ENABLE",
        "FENCE_TYPE",
        "FENCE_RADIUS",
        "MPC_XY_VEL_MAX",
        "MPC_XY_CRUISE",
        "WPNAV_SPEED",
    }
)
"""Parameters that bound where and how fast it may be flown. All are sent as numbers in floating point."""
_PLACED = mavlink.ESTIMATOR_VELOCITY_HORIZ | mavlink.ESTIMATOR_POS_HORIZ_ABS
_HARMLESS = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_TIMESYNC,
        mavlink.MAVLINK_MSG_ID_PING,
        mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
        mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST,
        mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
        mavlink.MAVLINK_MSG_ID_MISSION_ACK,  # the end of a download; it sends no MISSION_COUNT, which begins an upload
        mavlink.MAVLINK_MSG_ID_LOG_REQUEST_LIST,
        mavlink.MAVLINK_MSG_ID_LOG_REQUEST_DATA,
        mavlink.MAVLINK_MSG_ID_LOG_REQUEST_END,
        412,  # REQUEST_EVENT
    }
)
"""Messages that a daemon may send unasked; all other messages may move the vehicle or change it."""
_FTP_OPCODE_AT = 6
"""Offset of the opcode in FILE_TRANSFER_PROTOCOL: after network, system, component, the number of two bytes, and
session.
"""
_READING = frozenset({0, 1, 2, 3, 4, 5, 14, 15})
"""The opcodes of file transfers that only read: a download that was begun goes on in every mode."""
_ASKING = frozenset({mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE})
_NAMES = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: "arm",
    mavlink.MAV_CMD_NAV_TAKEOFF: "take_off",
    mavlink.MAV_CMD_NAV_LAND: "land",
    mavlink.MAV_CMD_DO_SET_MODE: "mode",
}
_CLOCK_S = 5.0
_MOST_SEVERE = mavlink.MAV_SEVERITY_CRITICAL
_NO_POSITION, _NO_VELOCITY = 0b111, 0b111 << 3
_LATE_S = 0.3
_MODE, _LANDED, _PLACE_FLAGS = "mode", "landed", "placed"


class Ears:
    """Fills `record`, which may be exchanged between flights. Places count from `origin`.

    A message that comes later than a newer one of what it tells, as a line with jitter brings it, tells nothing.
    """

    def __init__(self, record: Record, origin: Origin) -> None:
        self.record = record
        self._mode_number = BY_AUTOPILOT[record.autopilot].number
        self._origin = origin
        self._codec = Codec(0)
        self.renew()

    def renew(self) -> None:
        """Forgets a half frame: the connection is a new one."""
        self._newest_event_ms = 0
        self._own_ids = (0, 0)
        """Ids of the daemon."""
        self._sequence = SequenceUnwrapper(_LATE_S)
        self._newest: dict[str, int] = {}
        self._local: Place | None = None
        self._from_daemon, self._from_autopilot = FrameReader(), FrameReader()

    def hear_daemon(self, data: bytes) -> None:
        """Takes what the daemon has sent."""
        now_s = time.monotonic()
        for frame in self._from_daemon.feed(data):
            self._own_ids = (frame.system_id, frame.component_id)
            if frame.message_id in _HARMLESS or _reads_a_file(frame):
                continue
            sent = _sent(self._codec.decode(frame), now_s, self._mode_number, self._local)
            if sent is not None:
                self.record.sent.append(sent)

    def hear_autopilot(self, data: bytes) -> None:
        """Takes what has reached the daemon, as it reached it."""
        now_s = time.monotonic()
        for frame in self._from_autopilot.feed(data):
            if frame.component_id != mavlink.MAV_COMP_ID_AUTOPILOT1:
                continue
            self._sequence.update(frame.sequence, now_s)
            if frame.message_id not in _AUTOPILOT:
                continue
            if frame.message_id == _CURRENT_MODE:
                (mode,) = struct.unpack_from("<I", frame.payload.ljust(4, b"\0"))
                if self._is_newest(_MODE):
                    self.record.told.append(ReportedSample(now_s, mode=mode))
                continue
            if frame.message_id == _EVENT:
                self._note_event(frame.payload, now_s)
                continue
            try:
                self._note(self._codec.decode(frame), now_s)
            except KeyError:
                continue

    def _is_newest(self, what: str) -> bool:
        """Returns whether the frame that came last was not sent before another that told this."""
        is_newest = self._sequence.value > self._newest.get(what, self._sequence.value - 1)
        if is_newest:
            self._newest[what] = self._sequence.value
        return is_newest

    def _note_event(self, payload: bytes, now_s: float) -> None:
        """PX4 sends old events again, with their old times."""
        kind, time_ms = struct.unpack_from("<II", payload.ljust(8, b"\0"))
        if kind in _ARMING_EVENTS and time_ms > self._newest_event_ms:
            self.record.told.append(ReportedSample(now_s, armed=_ARMING_EVENTS[kind]))
        self._newest_event_ms = max(time_ms, self._newest_event_ms)

    def _note(self, message: Message, now_s: float) -> None:
        if message.get_type() == "HEARTBEAT":
            armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
            if self._is_newest(_MODE):
                self.record.told.append(ReportedSample(now_s, armed, message.custom_mode))
        elif message.get_type() == "EXTENDED_SYS_STATE":
            if self._is_newest(_LANDED):
                self.record.told.append(ReportedSample(now_s, landed=message.landed_state))
        elif message.get_type() == "HOME_POSITION":
            note_home(self.record.told_homes, self._origin, message, now_s)
        elif message.get_type() == "PARAM_VALUE":
            if message.param_id in _BOUNDING:
                self.record.values.append(Value(now_s, message.param_id, message.param_value))
        elif message.get_type() == "MISSION_ACK":
            is_whole = message.type == mavlink.MAV_MISSION_ACCEPTED and not message.mission_type
            if is_whole and (message.target_system, message.target_component) == self._own_ids:
                self.record.uploaded.append(Value(now_s, "mission", 0.0))
        elif hasattr(message, "flags"):
            if self._is_newest(_PLACE_FLAGS):
                self.record.told.append(ReportedSample(now_s, is_placed=message.flags & _PLACED == _PLACED))
        else:
            self._note_position_or_text(message, now_s)

    def _note_position_or_text(self, message: Message, now_s: float) -> None:
        if message.get_type() == "LOCAL_POSITION_NED":
            self._local = (message.y, message.x, -message.z)
        elif message.get_type() == "STATUSTEXT":
            if message.severity <= _MOST_SEVERE and not message.chunk_seq:  # the rest of a long one says less
                self.record.texts.append(Text(now_s, message.text))
        elif message.get_type() == "MISSION_CURRENT":
            told = float(getattr(message, "mission_id", 0) or message.total)
            if not self.record.missions or self.record.missions[-1].value != told:
                self.record.missions.append(Value(now_s, "mission", told))
        elif message.lat or message.lon:
            place = self._origin.current_position(message.lat / 1e7, message.lon / 1e7, message.alt / 1e3)
            self.record.estimate.append(Located(now_s, place))


def _reads_a_file(frame: MavlinkFrame) -> bool:
    is_transfer = frame.message_id == mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL
    return is_transfer and frame.payload.ljust(_FTP_OPCODE_AT + 1, b"\0")[_FTP_OPCODE_AT] in _READING


def _sent(message: Message, now_s: float, mode_number: Callable[[int, int], int], local: Place | None) -> Sent | None:
    """Returns what the message does to the vehicle, which takes itself to be at `local`; None: nothing."""
    if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
        return _setpoint(message, now_s, local)
    is_item = message.get_type() == "MISSION_ITEM_INT"
    command = None if is_item else getattr(message, "command", None)
    if command in _ASKING:
        return None
    if command is None:
        return Sent(now_s, str(message.get_type()).lower())
    is_mode = command == mavlink.MAV_CMD_DO_SET_MODE
    mode = mode_number(int(message.param2), int(message.param3)) if is_mode else None
    return Sent(now_s, _NAMES.get(command, f"command {command}"), mode)


def _setpoint(
    message: mavlink.MAVLink_set_position_target_local_ned_message, now_s: float, local: Place | None
) -> Sent:
    way = velocity = None
    is_local = message.coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED
    if is_local and local is not None and not message.type_mask & _NO_POSITION:
        way = (round(message.y - local[0], 2), round(message.x - local[1], 2), round(-message.z - local[2], 2))
    if is_local and not message.type_mask & _NO_VELOCITY:
        velocity = (round(message.vy, 2), round(message.vx, 2), round(-message.vz, 2))
    written_s = message.time_boot_ms / 1e3  # the daemon writes when it has sent it, by the same clock
    return Sent(written_s if abs(written_s - now_s) < _CLOCK_S else now_s, "setpoint", None, way, velocity)
