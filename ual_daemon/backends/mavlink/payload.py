"""Messages that extensions may send to a MAVLink autopilot, and those that they may read from it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import InvalidArgumentError, PermissionDeniedError
from ual_daemon.backends.mavlink.dialects.command_long import (
    LongCommand,
    command_of,
    request_message,
    set_message_interval,
)
from ual_daemon.backends.mavlink.session.payload_messages import PayloadMessages
from ual_daemon.backends.mavlink.wire.messages import mavlink
from ual_daemon.backends.payload import Payload, PayloadCallback

PERMITTED = (
    "DO_GIMBAL_MANAGER_PITCHYAW",
    "DO_GIMBAL_MANAGER_CONFIGURE",
    "DO_DIGICAM_CONFIGURE",
    "DO_DIGICAM_CONTROL",
    "DO_GRIPPER",
    "DO_WINCH",
    "DO_SET_RELAY",
    "DO_REPEAT_RELAY",
    "DO_SET_SERVO",
    "DO_REPEAT_SERVO",
    "SET_CAMERA_MODE",
    "SET_CAMERA_ZOOM",
    "SET_CAMERA_FOCUS",
    "IMAGE_START_CAPTURE",
    "IMAGE_STOP_CAPTURE",
    "VIDEO_START_CAPTURE",
    "VIDEO_STOP_CAPTURE",
)
"""The commands (MAV_CMD) that extensions may send. None of them flies.

DO_MOUNT_CONTROL and DO_SET_ROI are not here: an ArduCopter whose gimbal cannot turn turns itself instead.
"""
STREAMED = ("CAMERA_", "GIMBAL_", "MOUNT_", "WINCH_")
"""The messages that extensions may request begin with one of these."""

_PARAMS_COUNT = 7
_NAMES = {int(getattr(mavlink, f"MAV_CMD_{name}")): name for name in PERMITTED}
_IDS: dict[str, int] = {kind.name: message_id for message_id, kind in mavlink.mavlink_map.items()}


class MavlinkPayload(Payload):
    """The payload of one backend. `submit` passes a command to the autopilot, with a human-readable name."""

    def __init__(
        self, submit: Callable[[str, Callable[[], LongCommand]], Future[None]], messages: PayloadMessages
    ) -> None:
        self._submit = submit
        self._messages = messages
        self._lock = threading.Lock()
        self._newest: dict[int, Future[None]] = {}

    @override
    def send_command(self, command_id: int, params: Sequence[float]) -> Future[None]:
        name = _NAMES.get(command_id)
        if name is None:
            raise PermissionDeniedError(
                f"extensions may not send command {command_id}; permitted: {', '.join(PERMITTED)}"
            )
        if len(params) > _PARAMS_COUNT:
            raise InvalidArgumentError(f"{name} takes at most {_PARAMS_COUNT} parameters, not {len(params)}")
        values = tuple(map(float, params))
        command = command_of(command_id, values, f"obey {name}", group=f"payload {command_id}")
        with self._lock:  # one order for all threads
            replaced = self._newest.get(command_id)
            self._newest[command_id] = sent = self._submit(f"send {name}", lambda: command)
        if replaced is not None:
            replaced.cancel()  # without the lock: the callback may send the next
        return sent

    @override
    def subscribe(self, message: str, callback: PayloadCallback) -> Callable[[], None]:
        return self._messages.add(_id_of(message), callback)

    @override
    def request_message(self, message: str, rate_hz: float | None = None) -> Future[None]:
        message_id = _id_of(message)
        if not message.startswith(STREAMED):
            known = ", ".join(f"{beginning}..." for beginning in STREAMED)
            raise PermissionDeniedError(f"extensions may not request {message}; permitted: {known}")
        if rate_hz is None:
            return self._submit(f"send {message}", lambda: request_message(message_id))
        if not rate_hz > 0.0:
            raise InvalidArgumentError(f"the rate of {message} must be positive, not {rate_hz}", {"field": "rate_hz"})
        return self._submit(f"stream {message}", lambda: set_message_interval(message_id, rate_hz))


def _id_of(message: str) -> int:
    message_id = _IDS.get(message)
    if message_id is None:
        raise InvalidArgumentError(f"MAVLink has no message {message!r}", {"field": "message"})
    return message_id
