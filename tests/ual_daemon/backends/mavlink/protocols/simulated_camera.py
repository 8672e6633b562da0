"""A camera that is a component of its own, and the cameras protocol with it, on a link that loses messages."""

from __future__ import annotations

import random
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import received
from ual.geometry import Pose
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.protocols.camera_exchanges import OLDER_REQUESTS
from ual_daemon.backends.mavlink.protocols.camera_link import CameraLink
from ual_daemon.backends.mavlink.protocols.cameras import CameraProtocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.offers.cameras import Viewpoint

T = TypeVar("T")

STEP_S = 0.05
ACCEPTED, DENIED, BUSY = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_IN_PROGRESS
FLAGS = (
    mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE
    | mavlink.CAMERA_CAP_FLAGS_CAPTURE_VIDEO
    | mavlink.CAMERA_CAP_FLAGS_HAS_MODES
    | mavlink.CAMERA_CAP_FLAGS_HAS_BASIC_ZOOM
    | mavlink.CAMERA_CAP_FLAGS_HAS_BASIC_FOCUS
    | mavlink.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM
)


STRAY = MessageSource(7, 103)
"""Of this component one message comes, and no answer."""


class SimulatedCamera:
    """Does as mavlink.io/en/services/camera.html says, but for what a test changes."""

    def __init__(self, send: Callable[[Message], None]) -> None:
        self._send = send
        self.is_there = True
        self.flags = FLAGS
        self.vendor, self.model = b"Acme", b"Eye"
        self.gimbal_device_id = 0
        self.result = ACCEPTED
        """Answer to orders."""
        self.takes = True
        """Whether it takes what it is ordered to take."""
        self.reports = True
        """Whether it says at once that it has taken a picture."""
        self.capture_result = 1
        self.has_boot_time = True
        self.answers_twice = False
        self.is_old = False
        """Whether it knows no command for any message, but one for each."""
        self.lacks: set[int] = set()
        """Messages that it does not have."""
        self.ignored: set[int] = set()
        """Commands that it does not answer."""
        self.storage = (mavlink.STORAGE_STATUS_READY, 1000.0, 400.0, 600.0)
        self.streams_count = 2
        self.orders: list[tuple[int, tuple[float, ...]]] = []
        self.first_index = 0
        self.taken_ms: list[int] = []
        """The time since boot of each picture."""
        self._sequence = 0.0
        self._mode, self._zoom, self._focus = 0, 0.0, 0.0
        self._is_recording = False
        self._interval_s = 0.0
        self.now_s = 0.0

    def heartbeat(self) -> None:
        if self.is_there:
            self._send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_CAMERA, 8, 0, 0, 0, 3))

    def on_command(self, message: Any) -> None:
        """Takes a COMMAND_LONG."""
        params = tuple(getattr(message, f"param{i}") for i in range(1, 8))
        if not self.is_there or message.command in self.ignored:
            return
        asked = self._requested(message.command, params)
        if asked is not None:
            is_known = asked[0] not in self.lacks and self.answer(*asked)
            self._ack(message.command, ACCEPTED if is_known else mavlink.MAV_RESULT_UNSUPPORTED)
            return
        self.orders.append((message.command, params))
        if self.result == ACCEPTED and self.takes:
            self._obey(message.command, params)
        self._ack(message.command, self.result)
        if self.answers_twice:
            self._ack(message.command, self.result)

    def _requested(self, command: int, params: tuple[float, ...]) -> tuple[int, float] | None:
        """Returns the requested message, and its parameter: by the command for all, or by those for one each."""
        if command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            return (-1 if self.is_old else round(params[0])), params[1]
        older = {request: message_id for message_id, (request, _) in OLDER_REQUESTS.items()}
        if command not in older:
            return None
        return (older[command] if self.is_old else -1), params[0]

    def _obey(self, command: int, params: tuple[float, ...]) -> None:
        if command == mavlink.MAV_CMD_IMAGE_START_CAPTURE:
            if params[2] == 1.0 and params[3] != self._sequence:
                self._sequence = params[3]
                self.take()
            self._interval_s = params[1]
        elif command == mavlink.MAV_CMD_IMAGE_STOP_CAPTURE:
            self._interval_s = 0.0
        elif command == mavlink.MAV_CMD_SET_CAMERA_MODE:
            self._mode = round(params[1])
        elif command == mavlink.MAV_CMD_SET_CAMERA_ZOOM:
            self._zoom = params[1]
        elif command == mavlink.MAV_CMD_SET_CAMERA_FOCUS:
            self._focus = params[1]
        elif command in (mavlink.MAV_CMD_VIDEO_START_CAPTURE, mavlink.MAV_CMD_VIDEO_STOP_CAPTURE):
            self._is_recording = command == mavlink.MAV_CMD_VIDEO_START_CAPTURE

    def take(self) -> None:
        """Takes a picture."""
        self.taken_ms.append(round(self.now_s * 1000.0))
        if self.reports:
            self.report(self.first_index + len(self.taken_ms) - 1)

    def report(self, index: int) -> None:
        """Says that a picture was taken."""
        boot_ms = self.taken_ms[index - self.first_index]
        place = (round(47.4e7) + index, round(8.5e7), 500_000, 20_000)
        self._send(
            mavlink.MAVLink_camera_image_captured_message(
                boot_ms * self.has_boot_time, 1_800_000_000_000_000 + boot_ms * 1000, 0, *place,
                (1.0, 0.0, 0.0, 0.0), index,
                self.capture_result, f"http://camera/{index}.jpg".encode(),
            )
        )  # fmt: skip

    def answer(self, message_id: int, parameter: float = 0.0) -> bool:
        """Sends a message that is asked for. Returns whether it has it."""
        boot_ms = round(self.now_s * 1000.0)
        if message_id == mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION:
            names = (self.vendor.ljust(32, b"\0"), self.model.ljust(32, b"\0"))
            optics = (24.0, 36.0, 24.0, 6000, 4000, 0)
            described = (*names, 0x0201, *optics, self.flags, 0, b"", self.gimbal_device_id)
            self._send(mavlink.MAVLink_camera_information_message(boot_ms, *described))
        elif message_id == mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS:
            self._send(mavlink.MAVLink_camera_settings_message(boot_ms, self._mode, self._zoom, self._focus))
        elif message_id == mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION:
            self._send(mavlink.MAVLink_storage_information_message(boot_ms, 1, 1, *self.storage, 10.0, 10.0))
        elif message_id == mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS:
            by_time = 2 if self._interval_s else 0
            count = self.first_index + len(self.taken_ms)
            values = (by_time, int(self._is_recording), self._interval_s, 5000, 600.0, count)
            self._send(mavlink.MAVLink_camera_capture_status_message(boot_ms, *values))
        elif message_id == mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED:
            self.report(round(parameter))
        elif message_id == mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION:
            wanted = [round(parameter)] if parameter else range(1, self.streams_count + 1)
            for each in wanted:
                self._stream(each)
        else:
            return False
        return True

    def _stream(self, number: int) -> None:
        uri = b"rtsp://10.0.0.2:8554/live" if number == 1 else b"5600"
        kind = mavlink.VIDEO_STREAM_TYPE_RTSP if number == 1 else mavlink.VIDEO_STREAM_TYPE_RTPUDP
        self._send(
            mavlink.MAVLink_video_stream_information_message(
                number, self.streams_count, kind, 1, 30.0, 1280, 720, 2_000_000, 0, 60, f"stream {number}".encode(),
                uri, mavlink.VIDEO_STREAM_ENCODING_H264,
            )
        )  # fmt: skip

    def _ack(self, command: int, result: int) -> None:
        self._send(mavlink.MAVLink_command_ack_message(command, result))


class Bench:
    """The protocol of system 7 with one camera, on one clock. `loss` is the share of messages that is lost each way."""

    def __init__(self, loss: float = 0.0, seed: int = 1, component_id: int = mavlink.MAV_COMP_ID_CAMERA) -> None:
        self.now_s = 100.0
        self.loss = loss
        self.place = Pose.at(0.0, 0.0, 10.0)
        self._random = random.Random(seed)
        self._source = MessageSource(7, component_id)
        self._to_us: list[Message] = []
        self._to_camera: list[Message] = []
        self.sent: list[Message] = []
        self.camera = SimulatedCamera(self._to_us.append)
        self.may_be_flying = False
        self.cameras = CameraProtocol(self._to_camera.append, lambda: self.may_be_flying)
        self.cameras.look = lambda: Viewpoint(self.place, 3)
        self.cameras.attach(MessageSource(7, 1), Px4())
        self._next_heartbeat_s = 0.0

    def run(self, duration_s: float) -> None:
        """Lets time pass."""
        for _ in range(max(1, round(duration_s / STEP_S))):
            self.step()

    def step(self) -> None:
        self.now_s += STEP_S
        self.camera.now_s = self.now_s - 50.0
        if self.now_s >= self._next_heartbeat_s:
            self._next_heartbeat_s = self.now_s + 1.0
            self.camera.heartbeat()
        to_camera, self._to_camera[:] = self._to_camera[:], []
        for message in to_camera:
            if (message.target_system, message.target_component) == STRAY:
                continue
            self.sent.append(message)
            assert (message.target_system, message.target_component) == self._source
            if self._random.random() >= self.loss:
                self.camera.on_command(received(message))
        to_us, self._to_us[:] = self._to_us[:], []
        for message in to_us:
            if self._random.random() >= self.loss:
                self.cameras.on_component(self._source, received(message), self.now_s, 1.9e9)
        self.cameras.tick(self.now_s)

    def found(self) -> CameraLink:
        """Lets time pass until the camera is known."""
        self.until(lambda: bool(self.cameras.found) and self.cameras.found[0].identity is not None)
        return self.cameras.found[0]

    def until(self, condition: Callable[[], bool], limit_s: float = 60.0) -> None:
        """Lets time pass until a condition holds."""
        until_s = self.now_s + limit_s
        while not condition():
            assert self.now_s < until_s, f"not within {limit_s} s"
            self.step()

    def ended(self, begin: Callable[[Future[T]], object]) -> Future[T]:
        """Begins an exchange, and lets time pass until it has ended."""
        future: Future[T] = Future()
        begin(future)
        self.until(future.done)
        return future
