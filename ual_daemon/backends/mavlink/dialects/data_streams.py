"""Streams in groups (REQUEST_DATA_STREAM): for autopilots that do not know MAV_CMD_SET_MESSAGE_INTERVAL."""

from __future__ import annotations

from collections.abc import Iterable

from ual_daemon.backends.mavlink.dialects.command_long import LongCommand
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

_GROUPS = {
    mavlink.MAVLINK_MSG_ID_ATTITUDE: mavlink.MAV_DATA_STREAM_EXTRA1,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: mavlink.MAV_DATA_STREAM_EXTRA1,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: mavlink.MAV_DATA_STREAM_POSITION,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: mavlink.MAV_DATA_STREAM_POSITION,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: mavlink.MAV_DATA_STREAM_EXTENDED_STATUS,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: mavlink.MAV_DATA_STREAM_EXTENDED_STATUS,
    mavlink.MAVLINK_MSG_ID_RC_CHANNELS: mavlink.MAV_DATA_STREAM_RC_CHANNELS,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: mavlink.MAV_DATA_STREAM_RC_CHANNELS,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: mavlink.MAV_DATA_STREAM_EXTRA3,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: mavlink.MAV_DATA_STREAM_EXTRA3,
}
"""The group of each message that is used, in ArduPilot. The target comes with SYS_STATUS: its own rate is too much for
that group.
"""


def group_rates_hz(streams: Iterable[LongCommand]) -> dict[int, int]:
    """Returns the groups that have these streams, and the rate of the fastest of them in each."""
    rates_hz: dict[int, int] = {}
    for stream in streams:
        group = _GROUPS.get(round(stream.request.params[0]))
        if group is not None:
            rates_hz[group] = max(rates_hz.get(group, 1), round(1e6 / stream.request.params[1]))
    return rates_hz


def request_group(target: MessageSource, group: int, rate_hz: int) -> Message:
    """Returns the message that requests a group of streams. It is not acknowledged."""
    return mavlink.MAVLink_request_data_stream_message(*target, group, rate_hz, 1)
