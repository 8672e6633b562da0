"""Commands to an autopilot, and the makers of those that all autopilots take."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, TypeAlias

from ual_daemon.backends.engine.command import ARMING, FLYING, Command, Repeat, shows_armed, shows_mode
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink, member_name, message_name

_PARAMS_COUNT = 7
LEAST_STREAM_RATE_HZ = 4.0
"""No stream that is used is requested more slowly: a landed state counts for 1.5 s (`Freshness`), and some are lost."""
TARGET_HZ = 37.0
"""Rate of the target. A setpoint of another program lasts 10 ms of 50, until the next one of ours. A rate that is no
multiple of usual ones sees each phase of that."""
AGAIN = Repeat(every_s=0.25, most=20)
"""Repetition of an unanswered command: an autopilot answers within 15 ms, over a bad radio within 200. It is sent so
often within `COMMAND_PATIENCE_S` of `ual_daemon.flight`. On a link that loses 30 % each way and damages 10 % of the
rest, 0.4 of the commands are acknowledged. 0.6 to the power of 20 is 4 in 100,000.
"""
REQUESTED = Repeat(every_s=0.5, most=4)
"""The same for commands that only request data. Their acknowledgements do not show which of them they are for. So no
repetition may be on its way any more when the next one is sent: it waits until then."""


class CommandLong(NamedTuple):
    """Content of a COMMAND_LONG: its id (MAV_CMD), and the first parameters; zeros follow."""

    id: int
    params: tuple[float, ...] = ()

    def encode(self, target: MessageSource, confirmation: int) -> Message:
        """Returns the message to an autopilot. `confirmation` is how often it was sent before."""
        params = (*self.params, *(0.0,) * (_PARAMS_COUNT - len(self.params)))
        return mavlink.MAVLink_command_long_message(*target, self.id, confirmation, *params)


LongCommand: TypeAlias = Command[CommandLong]
"""A command that is sent as a COMMAND_LONG. Its acknowledgement carries only the id."""


def command_of(command_id: int, params: tuple[float, ...], what: str, group: str = "") -> LongCommand:
    """Makes a command of a group; one without a group only requests data."""
    repeat = AGAIN if group else REQUESTED
    details = (("command", _name_of(command_id)),)
    return Command(what, CommandLong(command_id, params), group, command_id, repeat=repeat, details=details)


def arm_or_disarm(*, is_arming: bool) -> LongCommand:
    """Arms or disarms, never by force."""
    what = "arm" if is_arming else "disarm"
    command = command_of(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (float(is_arming),), what, ARMING)
    return replace(command, shows=shows_armed(is_armed=is_arming))


def set_mode(name: str, *numbers: int, what: str) -> LongCommand:
    """Changes the mode to the one of a name, which is given to the autopilot by its own numbers."""
    params = (float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), *map(float, numbers))
    return _entering(name, command_of(mavlink.MAV_CMD_DO_SET_MODE, params, what, FLYING))


def land_in(name: str, params: tuple[float, ...] = ()) -> LongCommand:
    """Lands in the mode of a name."""
    return _entering(name, command_of(mavlink.MAV_CMD_NAV_LAND, params, "land", FLYING))


def _entering(mode: str, command: LongCommand) -> LongCommand:
    return replace(command, mode=mode, shows=shows_mode(mode))


def set_message_interval(message_id: int, rate_hz: float) -> LongCommand:
    """Requests a stream of a message."""
    params = (float(message_id), 1e6 / rate_hz)
    return command_of(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, params, f"stream {message_name(message_id)}")


def default_interval(stream: LongCommand) -> LongCommand:
    """Returns the request for the autopilot's own rate of a stream."""
    return _with_interval(stream, 0.0)


def slower(stream: LongCommand, share: float) -> LongCommand:
    """Returns the request for a part of a stream's rate, not below `LEAST_STREAM_RATE_HZ`."""
    interval_us = stream.request.params[1]
    longest_us = max(interval_us, 1e6 / LEAST_STREAM_RATE_HZ)
    return _with_interval(stream, min(interval_us / share, longest_us))


def _with_interval(stream: LongCommand, interval_us: float) -> LongCommand:
    return replace(stream, request=stream.request._replace(params=(stream.request.params[0], interval_us)))


def pose_streams(rate_hz: float) -> list[LongCommand]:
    """Requests streams of attitude and position."""
    return [
        set_message_interval(mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, rate_hz),
        set_message_interval(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, rate_hz),
    ]


def target_stream(rate_hz: float = TARGET_HZ) -> LongCommand:
    """Requests the target that is flown."""
    return set_message_interval(mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED, rate_hz)


def slow_streams() -> list[LongCommand]:
    """Requests streams of what changes slowly, from an autopilot that does not send it without a request."""
    return [
        set_message_interval(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5.0),
        set_message_interval(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 2.0),
        set_message_interval(mavlink.MAVLINK_MSG_ID_SYS_STATUS, 5.0),
        set_message_interval(mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, 1.0),
    ]


def request_message(message_id: int) -> LongCommand:
    """Requests a message once."""
    return command_of(mavlink.MAV_CMD_REQUEST_MESSAGE, (float(message_id),), f"send {message_name(message_id)}")


def _name_of(command_id: int) -> str:
    name = member_name("MAV_CMD", command_id)
    return f"command {command_id}" if name is None else f"MAV_CMD_{name}"
