"""Commands to an autopilot, and the makers of those that all autopilots take."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from ual_daemon.backends.mavlink.wire.frames import Source
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink, message_name
from ual_daemon.backends.values import LandedState, Snapshot

_PARAMS_COUNT = 7
LEAST_RATE_HZ = 4.0
"""No stream that is used is requested more slowly: a landed state counts for 1.5 s (`Freshness`), and some are lost."""


@dataclass(frozen=True, slots=True)
class CommandLong:
    """A COMMAND_LONG, and what shows that it was obeyed.

    `params` are the first ones; zeros follow. `what` is for people ("arm"). Of one `group` only the newest command is
    kept; a command without a group only requests data. `acks_count` is how often the autopilot acknowledges it.
    `needs_setpoints_s` is for how long setpoints must have been sent before it. `shows` returns whether a snapshot
    taken since it was sent shows its effect, whatever was acknowledged. `explain` makes the autopilot give the reason
    of a refusal. `then` follows once it is accepted. `mode` is the name of the mode that it leads to, in the group
    "mode".
    """

    id: int
    params: tuple[float, ...]
    what: str
    group: str = ""
    acks_count: int = 1
    needs_setpoints_s: float = 0.0
    shows: Callable[[Snapshot, float], bool] | None = field(default=None, compare=False)
    explain: CommandLong | None = None
    then: CommandLong | None = None
    mode: str = ""

    def encode(self, target: Source, confirmation: int) -> Message:
        """Returns the message to an autopilot. `confirmation` is how often it was sent before."""
        params = (*self.params, *(0.0,) * (_PARAMS_COUNT - len(self.params)))
        return mavlink.MAVLink_command_long_message(*target, self.id, confirmation, *params)


def arm_or_disarm(*, is_arming: bool) -> CommandLong:
    """Arms or disarms, never by force."""

    def shows(snapshot: Snapshot, since_s: float) -> bool:
        armed = snapshot.armed
        return armed is not None and armed.time_s > since_s and armed.value is is_arming

    what = "arm" if is_arming else "disarm"
    return CommandLong(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (float(is_arming),), what, group="arm", shows=shows)


def set_mode(name: str, *numbers: int, what: str) -> CommandLong:
    """Changes the mode to the one of a name, which is given to the autopilot by its own numbers."""
    params = (float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), *map(float, numbers))
    return CommandLong(mavlink.MAV_CMD_DO_SET_MODE, params, what, group="mode", shows=shows_mode(name), mode=name)


def land_in(name: str, params: tuple[float, ...] = ()) -> CommandLong:
    """Lands in the mode of a name."""
    return CommandLong(mavlink.MAV_CMD_NAV_LAND, params, "land", group="mode", shows=shows_mode(name), mode=name)


def shows_mode(name: str) -> Callable[[Snapshot, float], bool]:
    """For `CommandLong.shows`: the autopilot is in the mode of this name."""

    def shows(snapshot: Snapshot, since_s: float) -> bool:
        mode = snapshot.mode
        return mode is not None and mode.time_s > since_s and mode.value.name == name

    return shows


def shows_landed(*states: LandedState) -> Callable[[Snapshot, float], bool]:
    """For `CommandLong.shows`: the autopilot is in one of these landed states."""

    def shows(snapshot: Snapshot, since_s: float) -> bool:
        landed = snapshot.landed
        return landed is not None and landed.time_s > since_s and landed.value in states

    return shows


def set_message_interval(message_id: int, rate_hz: float) -> CommandLong:
    """Requests a stream of a message."""
    return CommandLong(
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (float(message_id), 1e6 / rate_hz), f"stream {message_name(message_id)}"
    )


def default_interval(stream: CommandLong) -> CommandLong:
    """Returns the request for the autopilot's own rate of a stream."""
    return replace(stream, params=(stream.params[0], 0.0))


def slower(stream: CommandLong, share: float) -> CommandLong:
    """Returns the request for a part of a stream's rate, not below `LEAST_RATE_HZ`."""
    interval_us = stream.params[1]
    longest_us = max(interval_us, 1e6 / LEAST_RATE_HZ)
    return replace(stream, params=(stream.params[0], min(interval_us / share, longest_us)))


def pose_streams(rate_hz: float) -> list[CommandLong]:
    """Requests streams of attitude and position."""
    return [
        set_message_interval(mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, rate_hz),
        set_message_interval(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, rate_hz),
    ]


def slow_streams() -> list[CommandLong]:
    """Requests streams of what changes slowly, from an autopilot that does not send it without a request."""
    return [
        set_message_interval(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5.0),
        set_message_interval(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 2.0),
        set_message_interval(mavlink.MAVLINK_MSG_ID_SYS_STATUS, 5.0),
    ]


def request_message(message_id: int) -> CommandLong:
    """Requests a message once."""
    return CommandLong(mavlink.MAV_CMD_REQUEST_MESSAGE, (float(message_id),), f"send {message_name(message_id)}")
