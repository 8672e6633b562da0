"""The cameras of an aircraft, by the camera module of psdk_ros2.

Its services take the mount position of a payload and answer whether DJI's SDK has taken the order: no more is known of
a picture. They are served by a thread of their own, and called on a connection of their own, so that nothing that flies
waits for a camera.
"""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import NamedTuple

from typing_extensions import override

from ual.cameras import (
    CameraAbility,
    CameraInfo,
    CameraStatus,
    CameraStorage,
    StorageState,
)
from ual.errors import InvalidArgumentError, LinkLostError, RejectedByAutopilotError, UalTimeoutError
from ual.geometry import Vector3
from ual_daemon.backends import futures
from ual_daemon.backends.chain import caught, done, then, then_wait
from ual_daemon.backends.engine.distance_trigger import DistanceTrigger
from ual_daemon.backends.engine.due_photos import DuePhotos
from ual_daemon.backends.engine.photo_log import PhotoLog
from ual_daemon.backends.offers.cameras import CameraDriver, CameraDrivers, TakenPhoto, Viewpoint
from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.rosbridge.calls import ServiceError, ServiceTimeoutError
from ual_daemon.backends.rosbridge.fields import number

_log = logging.getLogger(__name__)

POSITIONS = (1, 2, 3)
"""`E_DjiMountPosition`: the ports of payloads."""
EARLY_CHECK_S, SLOW_CHECK_S = 1.0, 30.0
"""Seconds between two looks at an empty port: at first, and once there is a camera, or none was found for a while."""
EARLY_CHECKS_COUNT = 20
KNOWN_CHECK_S = 5.0
"""Seconds between two checks that a camera is still there."""
CALL_TIMEOUT_S = 5.0
INTERVAL_CALL_TIMEOUT_S = 8.0
"""The wrapper sleeps for 2 s while it begins pictures by time."""
FOREVER, MOST_COUNT = 255, 254
"""Of pictures by time, as DJI counts them."""
LONGEST_PHOTO_INTERVAL_S = 3600.0
AUTO_FOCUS_ONCE = 1
"""`DJI_CAMERA_MANAGER_FOCUS_MODE_AUTO`."""
_ABILITIES = frozenset({CameraAbility.PHOTO, CameraAbility.VIDEO, CameraAbility.ZOOM, CameraAbility.FOCUS})
_REASON = "DJI's reason is in the log of the wrapper's camera node"
_MAYBE_TAKEN = "it is not known whether a picture was taken"
_MAYBE_DONE = "it is not known whether it did so"


class Surroundings(NamedTuple):
    """Services of the backend that a camera needs.

    Attributes:
        call: Calls a service of the wrapper by its name, with a time limit in seconds.
        look: Returns from where a picture is taken now.
        now_s: The backend's clock.
        utc_s: The time, as UTC.
        trouble: Returns why the wrapper is not reached; empty while it is.
        silence: Returns why nothing may be called now; empty if it may.
    """

    call: Callable[[str, Message, float], Future[Message]]
    look: Callable[[], Viewpoint]
    now_s: Callable[[], float]
    utc_s: Callable[[], float]
    trouble: Callable[[], str]
    silence: Callable[[], str]


class DjiCamera(CameraDriver):
    """One camera. `observe` and `step` are for the link's thread."""

    def __init__(self, camera: int, position: int, name: str, around: Surroundings) -> None:
        self._number = camera
        self._position = position
        self._name = name or f"payload {position}"
        self._around = around
        self._lock = threading.Lock()
        self._photos: PhotoLog[TakenPhoto] = PhotoLog()
        self._note = ""
        self._is_there = True
        self._by_distance: tuple[float, DistanceTrigger] | None = None
        self._by_time: tuple[float, float] | None = None
        """The interval, and when it ends by its count."""
        self._video_since_s: float | None = None
        self._due = DuePhotos(self._number, self.take_photo, "the camera has not answered the order before")

    @property
    def is_busy(self) -> bool:
        """Whether it takes pictures by distance, so that `step` is to be called."""
        return self._by_distance is not None

    @property
    def position(self) -> int:
        """Mounting position."""
        return self._position

    def observe(self, *, is_there: bool) -> None:
        """Takes whether the wrapper sees it."""
        if self._is_there and not is_there:
            _log.warning("camera %d (%s) is gone", self._number, self._name)
        self._is_there = is_there

    # --- Requests -----------------------------------------------------------------------------------------------------

    @property
    @override
    def info(self) -> CameraInfo:
        is_connected = self._is_there and not self._around.trouble()
        return CameraInfo(self._number, self._name, _ABILITIES, is_connected, note=self._note)

    @override
    def status(self) -> Future[CameraStatus]:
        storage = caught(self._call("get_sd_storage_info"), _unless_refused)
        return then_wait(
            storage,
            lambda stored: then(
                caught(self._call("get_optical_zoom"), _unless_refused), lambda zoomed: self._status(stored, zoomed)
            ),
        )

    @override
    def photos(self, first: int) -> Sequence[TakenPhoto]:
        return self._photos.since(first)

    @override
    def take_photo(self) -> Future[TakenPhoto]:
        return then(self._call("shoot_single_photo", doubt=_MAYBE_TAKEN), lambda _: self._photos.add(self._taken))

    @override
    def start_interval(self, interval_s: float, count: int) -> Future[None]:
        if interval_s != int(interval_s) or interval_s > LONGEST_PHOTO_INTERVAL_S:
            return futures.failed(_invalid("interval_s", f"{interval_s:g}: DJI takes whole seconds"))
        if count > MOST_COUNT:
            return futures.failed(_invalid("count", f"{count}: DJI takes at most {MOST_COUNT}, or 0 for no end"))
        running = self._by_distance
        order = {"num_photos_to_capture": count or FOREVER, "time_interval": int(interval_s)}
        begun = self._call("shoot_interval_photo", order, INTERVAL_CALL_TIMEOUT_S, _MAYBE_DONE)
        begun.add_done_callback(lambda ended: self._end_distance(running, ended))
        return then(begun, lambda _: self._note_interval(interval_s, count))

    @override
    def start_distance(self, distance_m: float) -> Future[None]:
        error = self._why_not()
        if error is not None:
            return futures.failed(error)
        with self._lock:
            self._by_distance, self._by_time = (distance_m, DistanceTrigger(distance_m)), None
        return done(None)

    @override
    def stop_photos(self) -> Future[None]:
        with self._lock:
            was_by_distance, self._by_distance = self._by_distance is not None, None
        if was_by_distance:
            return done(None)
        return then(self._call("stop_shoot_photo", doubt=_MAYBE_DONE), lambda _: self._note_stop())

    @override
    def start_video(self) -> Future[None]:
        def begun(_: Message) -> None:
            self._video_since_s = self._around.now_s()

        return then(self._call("record_video", {"start_stop": True}, doubt=_MAYBE_DONE), begun)

    @override
    def stop_video(self) -> Future[None]:
        def ended(_: Message) -> None:
            self._video_since_s = None

        return then(self._call("record_video", {"start_stop": False}, doubt=_MAYBE_DONE), ended)

    @override
    def set_zoom(self, percent: float) -> Future[None]:
        def zoom(found: Message) -> Future[Message]:
            factor = 1.0 + (max(1.0, number(found["max_zoom_factor"])) - 1.0) * percent / 100.0
            return self._call("set_optical_zoom", {"zoom_factor": factor}, doubt=_MAYBE_DONE)

        return then(then_wait(self._call("get_optical_zoom"), zoom), _nothing)

    @override
    def set_focus(self, percent: float | None) -> Future[None]:
        if percent is not None:
            return futures.failed(_invalid("percent", "DJI's cameras focus by themselves only: leave it out"))
        return then(self._call("set_focus_mode", {"focus_mode": AUTO_FOCUS_ONCE}, doubt=_MAYBE_DONE), _nothing)

    # --- Pictures by distance: the link's thread ----------------------------------------------------------------------

    def step(self, position: Vector3) -> None:
        """Takes the picture that is due. Waits for nothing."""
        with self._lock:
            due_count = 0 if self._by_distance is None else self._by_distance[1].due_count(position)
        self._due.take(due_count)

    # --- How it is done -----------------------------------------------------------------------------------------------

    def _taken(self, photo: int) -> TakenPhoto:
        return TakenPhoto(photo, self._around.utc_s(), self._around.look())

    def _end_distance(self, running: tuple[float, DistanceTrigger] | None, ordered: Future[Message]) -> None:
        """Ends pictures by distance once those by time are taken, or may be."""
        with self._lock:
            if self._by_distance is running and futures.may_be_done(ordered):
                self._by_distance = None

    def _note_interval(self, interval_s: float, count: int) -> None:
        end_s = self._around.now_s() + interval_s * count if count else math.inf
        self._by_time = (interval_s, end_s)

    def _note_stop(self) -> None:
        self._by_time = None

    def _status(self, stored: Message, zoomed: Message) -> CameraStatus:
        now_s, by_distance = self._around.now_s(), self._by_distance
        by_time = self._by_time if self._by_time is not None and now_s < self._by_time[1] else None
        return CameraStatus(
            is_taking_photos=by_time is not None or by_distance is not None,
            interval_s=None if by_time is None else by_time[0],
            distance_m=None if by_distance is None else by_distance[0],
            is_recording=self._video_since_s is not None,
            recording_s=0.0 if self._video_since_s is None else now_s - self._video_since_s,
            photos_count=self._photos.count,
            missed_count=self._due.missed_count,
            storage=self._storage(stored),
            zoom_percent=_percent(zoomed),
        )

    def _storage(self, message: Message) -> CameraStorage:
        """Returns what is reported of the card, in MiB. What cannot be so is left out, and noted."""
        if not message:
            return CameraStorage()
        total_mib, free_mib = number(message["total_capacity"]), number(message["remain_capacity"])
        if free_mib > total_mib:
            self._note = f"it says that {free_mib:g} of {total_mib:g} MiB are free, which is not told on"
            return CameraStorage(total_mib=total_mib)
        self._note = ""
        if not total_mib:
            return CameraStorage(StorageState.NONE)
        return CameraStorage(StorageState.READY if free_mib else StorageState.FULL, total_mib, free_mib)

    def _why_not(self) -> LinkLostError | None:
        trouble = self._around.trouble() or ("" if self._is_there else "the wrapper sees it no more")
        trouble = trouble or self._around.silence()
        return LinkLostError(f"camera {self._number} is not heard: {trouble}") if trouble else None

    def _call(
        self, name: str, arguments: Message | None = None, limit_s: float = CALL_TIMEOUT_S, doubt: str = ""
    ) -> Future[Message]:
        error = self._why_not()
        if error is not None:
            return futures.failed(error)
        request = {"payload_index": self._position, **(arguments or {})}
        answer = self._around.call(service_of(name), request, limit_s)
        whole = caught(answer, lambda failure: futures.failed(_explained(failure, self._number, doubt)))
        return then(whole, lambda values: self._accepted(name, values))

    def _accepted(self, name: str, values: Message) -> Message:
        if not values.get("success"):
            text = f"camera {self._number} refused {name.replace('_', ' ')}: {_REASON}"
            raise RejectedByAutopilotError(text, {"text": _REASON})
        return values


class DjiCameras(CameraDrivers):
    """The cameras of one aircraft. One that was found keeps its number. `tick` and `step` are for the link's thread."""

    def __init__(self, around: Surroundings) -> None:
        self._around = around
        self._cameras: tuple[DjiCamera, ...] = ()
        self._answer: Future[Message] | None = None
        self._next_s = dict.fromkeys(POSITIONS, -math.inf)
        self._due_s = -math.inf
        """Time at which the next port is due."""
        self._checks_count = 0

    @override
    def all(self) -> Sequence[DjiCamera]:
        return self._cameras

    def tick(self, now_s: float) -> None:
        """Looks at one port that is due. One call is in progress at a time."""
        if now_s < self._due_s:
            return
        is_asking = self._answer is not None and not self._answer.done()
        if is_asking or self._around.trouble() or self._around.silence():
            return
        due = [position for position in POSITIONS if now_s >= self._next_s[position]]
        if due:
            self._ask(due[0], now_s)
        self._due_s = min(self._next_s.values())

    def step(self, position: Vector3) -> None:
        """Takes where the aircraft is."""
        for each in self._cameras:
            if each.is_busy:
                each.step(position)

    def _ask(self, position: int, now_s: float) -> None:
        self._checks_count += 1
        is_known = any(each.position == position for each in self._cameras)
        is_early = self._checks_count <= EARLY_CHECKS_COUNT and not self._cameras
        self._next_s[position] = now_s + (KNOWN_CHECK_S if is_known else EARLY_CHECK_S if is_early else SLOW_CHECK_S)
        self._answer = reply = self._around.call(service_of("get_type"), {"payload_index": position}, CALL_TIMEOUT_S)
        reply.add_done_callback(lambda answer: self._on_type(position, answer))

    def _on_type(self, position: int, answer: Future[Message]) -> None:
        if answer.cancelled() or isinstance(answer.exception(), ServiceTimeoutError):
            return  # that is no word on the camera
        values = {} if answer.exception() is not None else answer.result()
        is_there = bool(values.get("success"))
        known = next((each for each in self._cameras if each.position == position), None)
        if known is not None:
            known.observe(is_there=is_there)
        elif is_there:
            name = str(values.get("camera_type") or "")
            self._cameras = (*self._cameras, DjiCamera(len(self._cameras), position, name, self._around))


def service_of(name: str) -> str:
    """Returns the name of a service of the camera module."""
    return f"psdk_ros2/camera_{name}"


def _explained(error: BaseException, camera: int, doubt: str) -> BaseException:
    tail = f"; {doubt}" if doubt else ""
    if isinstance(error, ServiceTimeoutError):
        return UalTimeoutError(f"camera {camera} has not answered: {error}{tail}", {"service": error.service})
    if isinstance(error, ServiceError):
        return RejectedByAutopilotError(f"camera {camera} refused: {error}", {"text": error.text})
    return error


def _unless_refused(error: BaseException) -> Future[Message]:
    """Some cameras do not tell everything: that is not passed on."""
    if isinstance(error, RejectedByAutopilotError):
        return done({})
    raise error


def _percent(message: Message) -> float | None:
    if not message:
        return None
    most, factor = number(message["max_zoom_factor"]), number(message["zoom_factor"])
    return min(max(100.0 * (factor - 1.0) / (most - 1.0), 0.0), 100.0) if most > 1.0 else None


def _nothing(_: object) -> None:
    """There is no more to tell."""


def _invalid(field: str, text: str) -> InvalidArgumentError:
    return InvalidArgumentError(f"{field}: {text}", {"field": field})
