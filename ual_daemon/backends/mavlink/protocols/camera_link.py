"""One camera of the vehicle, which is a component of its own on the link."""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from typing import Any, NamedTuple

from ual.cameras import CameraInfo, CameraStatus, VideoStream
from ual.errors import LinkLostError, ResourceExhaustedError, UalError
from ual.geometry import Pose
from ual_daemon.backends import futures
from ual_daemon.backends.engine.agreement import Agreement
from ual_daemon.backends.engine.distance_trigger import DistanceTrigger
from ual_daemon.backends.engine.photo_log import PhotoLog
from ual_daemon.backends.mavlink.protocols import camera_values
from ual_daemon.backends.mavlink.protocols.camera_exchanges import (
    CameraExchange,
    CameraOrder,
    CameraSender,
    MessageRequests,
    Shooting,
    StreamListing,
    refused,
)
from ual_daemon.backends.mavlink.protocols.camera_photos import ReportedPhotos
from ual_daemon.backends.mavlink.protocols.camera_values import CameraIdentity
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.offers.cameras import TakenPhoto, Viewpoint

_log = logging.getLogger(__name__)

LOST_CAMERA_S = 5.0
"""Seconds of silence after which a camera counts as not connected. Its heartbeat comes each second."""
MOST_WAITING_EXCHANGES = 20
"""Exchanges that may wait for their turn with one camera."""
LATE_ANSWER_S = 0.7
"""Seconds for which an order waits after one of its kind that was repeated: late answers to that would be taken for its
own.
"""
IDENTITY_S, LATER_IDENTITY_S = 1.0, 10.0
"""The interval of requests for what a camera is: at first, and after `EARLY_REQUESTS` of them."""
DOUBTED_IDENTITY_S = 0.5
"""Seconds after which a camera is queried again that has reported to be another one."""
EARLY_REQUESTS = 10
SHOT_RETRY_S, SHOT_TRIES_COUNT = 0.15, 3
"""Interval in seconds and attempts of an order of a picture by distance, as long as the UAV is near its place."""
_SETTINGS, _STORAGE = mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS, mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION
_CAPTURE, _BATTERY = mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS, mavlink.MAVLINK_MSG_ID_BATTERY_STATUS
_SHOOT = mavlink.MAV_CMD_IMAGE_START_CAPTURE


Carried = Callable[[int, Pose | None], Pose | None]
"""Returns where the gimbal of a device id is in the body of this pose, and where it looks. None: that is not known."""


class _DistanceShot(NamedTuple):
    """A picture by distance that is ordered, and not acknowledged."""

    sequence: int
    tries_count: int
    next_s: float


class CameraLink:
    """Belongs to the thread that receives; `info`, `photos`, `heard_s` and `number` are for any thread.

    One exchange runs at a time, in the order in which they were requested. `look` returns from where a picture is taken
    now, and `send` sends a message. `carried` returns how what is on a gimbal is mounted now; see `CameraProtocol`.
    """

    def __init__(
        self,
        number: int,
        source: MessageSource,
        send: Callable[[Message], object],
        look: Callable[[], Viewpoint],
        carried: Carried = lambda _device_id, _body: None,
        may_be_flying: Callable[[], bool] = lambda: False,
    ) -> None:
        self.number = number
        self.photos: PhotoLog[TakenPhoto] = PhotoLog()
        self.heard_s = -math.inf
        self._identities: Agreement[CameraIdentity] | None = None
        self._may_be_flying = may_be_flying
        self._source = source
        self._send = send
        self._viewpoint = look
        self._carried = carried
        self._line = CameraSender(self._command, f"camera {number}")
        self._reported = ReportedPhotos(
            lambda index, before_count: self._line.request(
                mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED, float(index), is_older=before_count % 2 == 1
            )
        )
        self._waiting: deque[CameraExchange[Any]] = deque()
        self._running: CameraExchange[Any] | None = None
        self._quiet_until_s: dict[int, float] = {}
        self._sequence = 0
        self._next_identity_s = -math.inf
        self._identity_count = 0
        self._status = CameraStatus()
        self._storage_note = ""
        self._battery_id: int | None = None
        self._distance: tuple[float, DistanceTrigger] | None = None
        self._shot: _DistanceShot | None = None
        self._missed_count = 0

    # --- What is known ------------------------------------------------------------------------------------------------

    @property
    def identity(self) -> CameraIdentity | None:
        """Identity of the camera; None while that is not known."""
        return None if self._identities is None else self._identities.value

    @property
    def name(self) -> str:
        """Human-readable name of the camera."""
        return f"camera {self.number}" if self.identity is None else f"camera {self.number} ({self.identity.name})"

    def info(self, now_s: float) -> CameraInfo:
        """Returns what it is."""
        identity, is_connected = self.identity, now_s - self.heard_s <= LOST_CAMERA_S
        if identity is None:
            return CameraInfo(self.number, self.name, frozenset(), is_connected, note="it has not said what it is")
        return CameraInfo(
            self.number,
            identity.name,
            identity.abilities,
            is_connected,
            identity.firmware_version,
            identity.width_px,
            identity.height_px,
            identity.intrinsics,
            self._storage_note,
        )

    # --- What is requested --------------------------------------------------------------------------------------------

    def order(self, command_id: int, params: Sequence[float], future: Future[None]) -> None:
        """Has the camera do something."""
        self._add(CameraOrder(future, self._line, command_id, params))

    def shoot(self, future: Future[TakenPhoto]) -> None:
        """Takes a picture."""
        self._sequence += 1
        self._add(
            Shooting(
                future, self._line, self._sequence, lambda count: self._line.request(_CAPTURE, is_older=count % 2 == 0)
            )
        )

    def start_interval(self, interval_s: float, count: int, future: Future[None]) -> None:
        """Has it take pictures by time. Those by distance end once it has accepted that, or may have."""
        distance = self._distance

        def on_end(ended: Future[None]) -> None:
            if self._distance is distance and futures.may_be_done(ended):
                self._distance = None

        future.add_done_callback(on_end)
        self.order(_SHOOT, (0.0, interval_s, float(count), 0.0), future)

    def start_distance(self, distance_m: float) -> None:
        """Begins to take pictures by the distance flown; the next tick orders the first."""
        self._distance = (distance_m, DistanceTrigger(distance_m))

    def stop_distance(self) -> bool:
        """Ends that. Returns whether it was in progress."""
        was_running, self._distance = self._distance is not None, None
        return was_running

    def read_status(self, future: Future[CameraStatus]) -> None:
        """Asks what it does now."""
        answered: Future[None] = Future()

        def answer(done: Future[None]) -> None:
            error = done.exception()
            if error is not None:
                futures.fail(future, error)
            elif future.set_running_or_notify_cancel():
                future.set_result(self.status())

        answered.add_done_callback(answer)
        self._add(
            MessageRequests(answered, self._line, (_CAPTURE, _STORAGE, _SETTINGS), frozenset({_STORAGE, _SETTINGS}))
        )

    def list_streams(self, future: Future[list[VideoStream]]) -> None:
        """Lists its video streams."""
        self._add(StreamListing(future, self._line))

    def drop(self, error: UalError) -> None:
        """Ends what is in progress, and what waits."""
        for exchange in (*self._waiting, *([] if self._running is None else [self._running])):
            exchange.fail(error)
        self._waiting.clear()
        self._running = None

    def status(self) -> CameraStatus:
        """Returns its last report of what it does."""
        reported = self._status
        return CameraStatus(
            mode=reported.mode,
            is_taking_photos=reported.is_taking_photos or self._distance is not None,
            interval_s=reported.interval_s,
            distance_m=None if self._distance is None else self._distance[0],
            is_recording=reported.is_recording,
            recording_s=reported.recording_s,
            photos_count=self.photos.count,
            missed_count=self._missed_count + self._reported.lost_count,
            storage=reported.storage,
            zoom_percent=reported.zoom_percent,
            focus_percent=reported.focus_percent,
            battery_percent=reported.battery_percent,
        )

    def _add(self, exchange: CameraExchange[Any]) -> None:
        if len(self._waiting) >= MOST_WAITING_EXCHANGES:
            text = f"{MOST_WAITING_EXCHANGES} orders of {self.name} wait already, which is the limit"
            exchange.fail(ResourceExhaustedError(text, {"limit": str(MOST_WAITING_EXCHANGES)}))
        else:
            self._waiting.append(exchange)

    # --- What comes, and what is due ----------------------------------------------------------------------------------

    def on_heartbeat(self, now_s: float) -> None:
        """Takes that it is there."""
        if now_s - self.heard_s > LOST_CAMERA_S and self.heard_s > -math.inf:
            _log.info("%s is heard again", self.name)
            self._next_identity_s = now_s  # another one may have its place
            if self._identities is not None:
                self._identities = Agreement(self._identities.value)
            self._identity_count = 0
        self.heard_s = now_s

    def on_message(self, message: Message, now_s: float, utc_now_s: float) -> None:
        """Takes a message of it."""
        self.heard_s = now_s
        message_id = message.get_msgId()
        if message_id == mavlink.MAVLINK_MSG_ID_COMMAND_ACK:
            self._on_ack(message, now_s)
            return
        if message_id == mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION:
            self._on_identity(camera_values.identity_of(message), now_s)
        elif message_id == mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED:
            self._on_photo(message, now_s, utc_now_s)
        else:
            self._on_status(message_id, message, now_s)
        if self._running is not None:
            self._running.on_message(message, now_s)

    def tick(self, now_s: float) -> None:
        """Sends what is due; to be called often."""
        if now_s - self.heard_s > LOST_CAMERA_S:
            if self._running is not None or self._waiting:
                silent_s = now_s - self.heard_s
                self.drop(LinkLostError(f"{self.name} is not heard: its last message came {silent_s:.0f} s ago"))
            self._miss_shot("it is not heard")
            return
        self._identify(now_s)
        self._reported.tick(now_s)
        self._tick_distance(now_s)
        self._next_exchange(now_s)
        if self._running is not None:
            self._running.tick(now_s)

    def _next_exchange(self, now_s: float) -> None:
        running = self._running
        if running is not None and running.is_over:
            if isinstance(running, CameraOrder | Shooting) and running.was_repeated:
                self._quiet_until_s[_command_of(running)] = now_s + LATE_ANSWER_S
            self._running = running = None
        while running is None and self._waiting:
            if now_s < self._quiet_until_s.get(_command_of(self._waiting[0]), -math.inf):
                return
            candidate = self._waiting.popleft()
            if not candidate.is_over:
                self._running = running = candidate

    def _identify(self, now_s: float) -> None:
        """Asks what it is, by the two commands for that in turn: cameras know the newer one or the older."""
        is_doubtful = self._identities is not None and self._identities.is_open
        is_known = self.identity is not None and self._identity_count > 0 and not is_doubtful
        if now_s < self._next_identity_s or is_known:
            return
        self._identity_count += 1
        self._next_identity_s = now_s + (IDENTITY_S if self._identity_count < EARLY_REQUESTS else LATER_IDENTITY_S)
        self._line.request(mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION, is_older=self._identity_count % 2 == 0)

    def _on_identity(self, identity: CameraIdentity, now_s: float) -> None:
        """Takes what it says that it is: the first at once, another one once several answers agree."""
        is_first = self._identities is None
        self._identities = self._identities or Agreement(identity)
        if not self._identities.note(identity, now_s, is_flying=self._may_be_flying()) and not is_first:
            self._next_identity_s, self._identity_count = now_s + DOUBTED_IDENTITY_S, min(self._identity_count, 1)
            return
        _log.info("%s: %s", f"camera {self.number}", identity.name)
        self._line = CameraSender(self._command, self.name)

    def _on_photo(self, message: Message, now_s: float, utc_now_s: float) -> None:
        if not self._reported.is_new(message.image_index, message.time_boot_ms or message.time_utc, now_s):
            return
        is_stored = message.capture_result == 1
        if not is_stored:
            self._missed_count += 1
        here = self._viewpoint()
        device_id = 0 if self.identity is None else self.identity.gimbal_device_id
        viewpoint = here._replace(
            position_geo=camera_values.position_of(message) or here.position_geo,
            mounting=self._carried(device_id, here.body) if device_id else here.mounting,
        )
        stamp_s = camera_values.stamp_of(message) or utc_now_s
        url = camera_values.url_of(message)
        taken = self.photos.add(lambda number: TakenPhoto(number, stamp_s, viewpoint, is_stored, url))
        if self._running is not None:
            self._running.on_photo(taken, now_s)

    def _on_status(self, message_id: int, message: Message, now_s: float) -> None:
        reported = self._status
        if message_id == _SETTINGS:
            self._status = replace(
                reported,
                mode=camera_values.mode_of(message),
                zoom_percent=camera_values.percent_of(message.zoomLevel),
                focus_percent=camera_values.percent_of(message.focusLevel),
            )
        elif message_id == _BATTERY:
            self._on_battery(message.id, camera_values.battery_of(message))
        elif message_id == _STORAGE and message.storage_id <= 1:
            storage, self._storage_note = camera_values.storage_of(message)
            self._status = replace(reported, storage=storage)
        elif message_id == _CAPTURE:
            self._reported.on_count(message.image_count, now_s)
            is_by_time = message.image_status in _BY_TIME
            self._status = replace(
                reported,
                is_taking_photos=is_by_time,
                interval_s=message.image_interval if is_by_time and message.image_interval > 0.0 else None,
                is_recording=message.video_status == 1,
                recording_s=message.recording_time_ms / 1e3 if message.video_status == 1 else 0.0,
            )

    def _on_battery(self, battery_id: int, percent: float | None) -> None:
        """Takes the charge of the battery with the lowest number that it has."""
        if self._battery_id is None or battery_id <= self._battery_id:
            self._battery_id = battery_id
            self._status = replace(self._status, battery_percent=percent)

    def _on_ack(self, message: Message, now_s: float) -> None:
        if message.command == _SHOOT and self._shot is not None and not isinstance(self._running, Shooting):
            if message.result not in (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS):
                self._miss_shot(refused(self.name, _SHOOT, message.result).message)
            self._shot = None
        elif self._running is not None:
            self._running.on_ack(message.command, message.result, now_s)

    # --- By distance --------------------------------------------------------------------------------------------------

    def _tick_distance(self, now_s: float) -> None:
        shot = self._shot
        if shot is not None and now_s >= shot.next_s:
            if shot.tries_count >= SHOT_TRIES_COUNT:
                self._miss_shot("it did not answer")
            else:
                self._send_shot(shot.sequence, shot.tries_count, now_s)
        if self._distance is None:
            return
        body = self._viewpoint().body
        due_count = 0 if body is None else self._distance[1].due_count(body.position)
        if due_count:
            self._miss_shot("it did not answer before the next one was due")
            self._missed_count += due_count - 1
            self._sequence += 1
            self._send_shot(self._sequence, 0, now_s)

    def _send_shot(self, sequence: int, sent_count: int, now_s: float) -> None:
        self._command(_SHOOT, (0.0, 0.0, 1.0, float(sequence)), sent_count)
        self._shot = _DistanceShot(sequence, sent_count + 1, now_s + SHOT_RETRY_S)

    def _miss_shot(self, why: str) -> None:
        if self._shot is not None:
            self._shot = None
            self._missed_count += 1
            _log.warning("%s missed a picture by distance: %s", self.name, why)

    def _command(self, command_id: int, params: Sequence[float], confirmation: int) -> None:
        values = (*params, *(0.0,) * (7 - len(params)))
        self._send(mavlink.MAVLink_command_long_message(*self._source, command_id, min(confirmation, 255), *values))


_BY_TIME = (2, 3)
"""The values of CAMERA_CAPTURE_STATUS.image_status while an interval is set: it waits, or takes a picture."""


def _command_of(exchange: CameraExchange[Any]) -> int:
    """Returns the command whose answers an exchange takes."""
    if isinstance(exchange, CameraOrder):
        return exchange.command_id
    request: int = _SHOOT if isinstance(exchange, Shooting) else mavlink.MAV_CMD_REQUEST_MESSAGE
    return request
