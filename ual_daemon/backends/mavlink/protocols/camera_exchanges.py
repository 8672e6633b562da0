"""Exchanges with one camera: an order, a picture, its status, and its video streams.

Messages may be lost, doubled and late. Each exchange repeats what it requests, and ends by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import NamedTuple, TypeVar

from typing_extensions import override

from ual.cameras import VideoStream
from ual.errors import RejectedByAutopilotError, UalError, UalTimeoutError
from ual_daemon.backends.engine.command import Repeat
from ual_daemon.backends.mavlink.protocols import camera_values
from ual_daemon.backends.mavlink.protocols.exchange import Exchange
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink, member_name, message_name
from ual_daemon.backends.offers.cameras import TakenPhoto

T = TypeVar("T")

RETRY_S = 0.5
TRIES_COUNT = 10
"""Attempts of an order or a request: on a link that loses 30 % each way, one in a thousand has no answer then."""
BUSY_TIMEOUT_S = 12.0
"""Seconds that an order may be in progress, or a picture may take, ..."""
PROGRESS_REQUEST_S = 1.5
"""... and seconds without the picture after which the camera is requested it."""
MOST_STREAMS = 16
OLDER_REQUESTS: dict[int, tuple[int, tuple[float, ...]]] = {
    mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION: (mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION, (1.0,)),
    mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS: (mavlink.MAV_CMD_REQUEST_CAMERA_SETTINGS, (1.0,)),
    mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION: (mavlink.MAV_CMD_REQUEST_STORAGE_INFORMATION, (0.0, 1.0)),
    mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS: (mavlink.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS, (1.0,)),
    mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED: (mavlink.MAV_CMD_REQUEST_CAMERA_IMAGE_CAPTURE, (0.0,)),
    mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION: (mavlink.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION, (0.0,)),
}
"""The commands that were for one message each, before MAV_CMD_REQUEST_MESSAGE: with their parameters."""
_STREAM = mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION
_GOES_ON = (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS)


class CameraSender(NamedTuple):
    """Sender to one camera: it sends a command, its parameters, and the number of attempts before.

    `name` is human-readable.
    """

    command: Callable[[int, Sequence[float], int], object]
    name: str

    def request(self, message_id: int, parameter: float | None = None, *, is_older: bool = False) -> None:
        """Requests a message once: by the command for any message, or by the older one that is for this message alone.

        Cameras know one or the other, and MAVSDK's server (4.1) knows some messages by the one and some by the other.
        """
        if is_older:
            command_id, params = OLDER_REQUESTS[message_id]
            self.command(command_id, params if parameter is None else (parameter,), 0)
        else:
            self.command(mavlink.MAV_CMD_REQUEST_MESSAGE, (message_id, parameter or 0.0), 0)


class CameraExchange(Exchange[T]):
    """An exchange with one camera."""

    def __init__(self, future: Future[T], line: CameraSender) -> None:
        super().__init__(future)
        self._line = line
        self._tries_count = 0
        self._next_s: float | None = None

    def on_ack(self, command_id: int, result: int, now_s: float) -> None:
        """Takes the camera's answer to a command."""

    def on_message(self, message: Message, now_s: float) -> None:
        """Takes another message of the camera."""

    def on_photo(self, taken: TakenPhoto, now_s: float) -> None:
        """Takes a picture that is new."""


class CameraOrder(CameraExchange[None]):
    """Has the camera do something, and ends once it has reported that it does, or has done so.

    It is repeated until the first answer. One that is in progress is waited for, as MAVLink's command protocol says.
    """

    repeat = Repeat(RETRY_S, TRIES_COUNT)

    def __init__(self, future: Future[None], line: CameraSender, command_id: int, params: Sequence[float]) -> None:
        super().__init__(future, line)
        self.command_id = command_id
        self._params = params
        self._busy_until_s: float | None = None
        self.is_answered = False
        """Whether its last answer has come: that it is done, or refused."""

    @property
    def was_sent(self) -> bool:
        """Whether it was sent."""
        return self._tries_count > 0

    @property
    def was_repeated(self) -> bool:
        """Whether it was sent more than once, so that answers to it may still come."""
        return self._tries_count > 1

    @override
    def tick(self, now_s: float) -> None:
        if self._busy_until_s is not None:
            if now_s >= self._busy_until_s:
                self.fail(UalTimeoutError(f"{self._line.name} was busy with {self._words} for {BUSY_TIMEOUT_S:g} s"))
        elif self._next_s is None or now_s >= self._next_s:
            self._send(now_s)

    def _send(self, now_s: float) -> None:
        if self._tries_count >= self.repeat.most:
            text = f"{self._line.name} did not answer to {self._words} in {self.repeat.most} tries"
            self.fail(UalTimeoutError(f"{text}: it is not known whether it did so"))
            return
        self._line.command(self.command_id, self._params, self._tries_count)
        self._tries_count, self._next_s = self._tries_count + 1, now_s + self.repeat.every_s

    @override
    def on_ack(self, command_id: int, result: int, now_s: float) -> None:
        if command_id != self.command_id or not self._tries_count:
            return
        self.is_answered = result != mavlink.MAV_RESULT_IN_PROGRESS
        if result == mavlink.MAV_RESULT_ACCEPTED:
            self._end(None)
        elif result == mavlink.MAV_RESULT_IN_PROGRESS:
            self._busy_until_s = now_s + BUSY_TIMEOUT_S
        else:
            self.fail(refused(self._line.name, command_id, result))

    @property
    def _words(self) -> str:
        return _command_name(self.command_id)


class Shooting(CameraExchange[TakenPhoto]):
    """Takes one picture. Ends with the picture, whatever is answered to the order.

    The order is repeated with its number, by which a camera knows that it is the same picture. `ask` asks how many
    pictures there are, for the first, second, ... time.
    """

    def __init__(
        self, future: Future[TakenPhoto], line: CameraSender, sequence: int, ask: Callable[[int], object]
    ) -> None:
        super().__init__(future, line)
        self._ordering: Future[None] = Future()
        self._order = CameraOrder(
            self._ordering, line, mavlink.MAV_CMD_IMAGE_START_CAPTURE, (0.0, 0.0, 1.0, float(sequence))
        )
        self._ask = ask
        self._asks_count = 0
        self._ask_s = 0.0
        self._until_s: float | None = None

    @property
    def was_repeated(self) -> bool:
        """Whether the order was sent more than once."""
        return self._order.was_repeated

    @override
    def tick(self, now_s: float) -> None:
        if self._until_s is None:
            self._order.tick(now_s)
            self._follow(now_s)
        elif now_s >= self._until_s:
            self.fail(
                UalTimeoutError(
                    f"{self._line.name} accepted, and has not told a picture for {BUSY_TIMEOUT_S:g} s: it is not known "
                    "whether there is one"
                )
            )
        elif now_s >= self._ask_s:
            self._asks_count, self._ask_s = self._asks_count + 1, now_s + PROGRESS_REQUEST_S
            self._ask(self._asks_count)

    @override
    def on_ack(self, command_id: int, result: int, now_s: float) -> None:
        self._order.on_ack(command_id, result, now_s)
        self._follow(now_s)

    @override
    def on_photo(self, taken: TakenPhoto, now_s: float) -> None:
        if not self._order.was_sent:
            return
        if taken.is_stored:
            self._end(taken)
        else:
            self.fail(RejectedByAutopilotError(f"{self._line.name} says that the picture failed", {"result": "FAILED"}))

    def _follow(self, now_s: float) -> None:
        """Waits for the picture once the order was accepted, and ends with it where that failed."""
        if self._until_s is not None or not self._ordering.done():
            return
        error = self._ordering.exception()
        if isinstance(error, UalError):
            self.fail(error)
        self._until_s, self._ask_s = now_s + BUSY_TIMEOUT_S, now_s + PROGRESS_REQUEST_S


class MessageRequests(CameraExchange[None]):
    """Requests messages, one after the other. What the camera refuses is left out; so is what is `optional`."""

    def __init__(
        self, future: Future[None], line: CameraSender, message_ids: Sequence[int], optional: frozenset[int]
    ) -> None:
        super().__init__(future, line)
        self._left = list(message_ids)
        self._optional = optional
        self._is_older = False

    @override
    def tick(self, now_s: float) -> None:
        if not self._left:
            self._end(None)
        elif self._next_s is None or now_s >= self._next_s:
            self._request(self._left[0], now_s)

    def _request(self, message_id: int, now_s: float) -> None:
        most = TRIES_COUNT // 3 if message_id in self._optional else TRIES_COUNT
        if self._tries_count >= most:
            if message_id in self._optional:
                self._go_on(now_s)
            else:
                text = f"{self._line.name} did not send {message_name(message_id)} in {most} tries"
                self.fail(UalTimeoutError(text))
            return
        self._line.request(message_id, is_older=self._is_older)
        self._tries_count, self._next_s = self._tries_count + 1, now_s + RETRY_S

    @override
    def on_message(self, message: Message, now_s: float) -> None:
        if self._left and self._tries_count and message.get_msgId() == self._left[0]:
            self._go_on(now_s)

    @override
    def on_ack(self, command_id: int, result: int, now_s: float) -> None:
        if result in _GOES_ON or not self._left or not self._tries_count:
            return
        if command_id == mavlink.MAV_CMD_REQUEST_MESSAGE and not self._is_older:
            self._is_older = True
            self._request(self._left[0], now_s)
        elif command_id == OLDER_REQUESTS[self._left[0]][0]:
            if self._left[0] in self._optional:
                self._go_on(now_s)
            else:
                self.fail(refused(self._line.name, command_id, result))

    def _go_on(self, now_s: float) -> None:
        del self._left[0]
        self._tries_count, self._next_s, self._is_older = 0, None, False
        self.tick(now_s)


class StreamListing(CameraExchange[list[VideoStream]]):
    """Lists the video streams: all at once, and then those that are missing."""

    def __init__(self, future: Future[list[VideoStream]], line: CameraSender) -> None:
        super().__init__(future, line)
        self._found: dict[int, VideoStream] = {}
        self._count: int | None = None
        self._refused: set[bool] = set()
        """Commands that it has refused: the older one (True), the one for any message (False)."""
        self._is_older = False
        """Command of the last request: the older one, or the one for any message."""

    @override
    def tick(self, now_s: float) -> None:
        if self._next_s is not None and now_s < self._next_s:
            return
        if self._tries_count >= TRIES_COUNT:
            missing = "no answer" if self._count is None else f"{len(self._found)} of {self._count}"
            self.fail(UalTimeoutError(f"the video streams of {self._line.name} have not come: {missing}"))
            return
        self._is_older = False in self._refused or (True not in self._refused and self._tries_count % 2 == 1)
        self._tries_count, self._next_s = self._tries_count + 1, now_s + RETRY_S
        wanted = [0] if self._count is None else [each for each in range(1, self._count + 1) if each not in self._found]
        for stream_id in wanted:
            self._line.request(_STREAM, float(stream_id), is_older=self._is_older)

    @override
    def on_message(self, message: Message, now_s: float) -> None:
        if message.get_msgId() != _STREAM or not self._tries_count:
            return
        self._refused = {not self._is_older}  # it knows this one
        stream = camera_values.stream_of(message)
        if stream.url:
            self._found[message.stream_id] = stream
        # MAVSDK's server (4.1) says that it has 0 streams, and which one.
        self._count = min(max(message.count, len(self._found)), MOST_STREAMS)
        if len(self._found) >= self._count:
            self._end([stream for _, stream in sorted(self._found.items())])

    @override
    def on_ack(self, command_id: int, result: int, now_s: float) -> None:
        is_request = command_id in (mavlink.MAV_CMD_REQUEST_MESSAGE, OLDER_REQUESTS[_STREAM][0])
        if not is_request or result in _GOES_ON or not self._tries_count or self._found:
            return
        self._refused.add(command_id != mavlink.MAV_CMD_REQUEST_MESSAGE)
        if len(self._refused) > 1:
            self.fail(refused(self._line.name, command_id, result))
        else:
            self._next_s = now_s  # by the other command


def refused(name: str, command_id: int, result: int) -> RejectedByAutopilotError:
    """Returns what a camera answers, in its words."""
    words = member_name("MAV_RESULT", result) or f"result {result}"
    text = f"{name} refused {_command_name(command_id)}: {words}"
    return RejectedByAutopilotError(text, {"result": words, "command": _command_name(command_id)})


def _command_name(command_id: int) -> str:
    return member_name("MAV_CMD", command_id) or f"command {command_id}"
