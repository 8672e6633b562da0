"""The camera that the autopilot itself triggers, through MAVROS.

PX4's reports pass MAVROS (``camera/image_captured``). ArduPilot's do not, as MAVROS knows no CAMERA_FEEDBACK. It says
by its acknowledgement whether it has triggered: so each of its pictures is ordered, also those by distance.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import NamedTuple

from typing_extensions import override

from ual.cameras import CameraAbility, CameraInfo, CameraStatus
from ual.errors import LinkLostError, NotSupportedError
from ual_daemon.backends import futures
from ual_daemon.backends.chain import done, then
from ual_daemon.backends.engine.distance_trigger import DistanceTrigger
from ual_daemon.backends.engine.due_photos import DuePhotos
from ual_daemon.backends.engine.photo_log import PhotoLog
from ual_daemon.backends.firmwares.gripper_codec import PayloadOrder
from ual_daemon.backends.firmwares.trigger_camera import NAME, Give, Order, TriggerCamera
from ual_daemon.backends.firmwares.triggered_photos import TriggeredPhotos
from ual_daemon.backends.offers.cameras import CameraDriver, CameraDrivers, TakenPhoto, Viewpoint
from ual_daemon.backends.values import Snapshot

_log = logging.getLogger(__name__)

START_CAPTURE = 2000
"""MAV_CMD_IMAGE_START_CAPTURE."""
_ONE = (0.0, 0.0, 1.0)
_CAMERA_ID = 0


class CameraServices(NamedTuple):
    """Services of the backend that cameras need.

    Attributes:
        order: Passes an order to the autopilot.
        post: Has something done on the link's thread.
        give: Returns a future that something ends there.
        why_not: Returns why the autopilot is not reached; None while it is.
        snapshot: Returns what is known now.
        look: Returns from where a picture is taken now.
        utc_s: The time, as UTC.
        tells_photos: Returns whether MAVROS passes on what the autopilot says of its pictures.
        boots_count: Returns how often the autopilot has booted, as far as it is known.
    """

    order: Callable[[PayloadOrder], Future[None]]
    post: Callable[[Callable[[], None]], None]
    give: Give
    why_not: Callable[[str], LinkLostError | None]
    snapshot: Callable[[], Snapshot]
    look: Callable[[], Viewpoint]
    utc_s: Callable[[], float]
    tells_photos: Callable[[], bool]
    boots_count: Callable[[], int]


class _ByDistance(NamedTuple):
    distance_m: float
    trigger: DistanceTrigger
    boots_count: int


class AcknowledgedCamera(CameraDriver):
    """A picture counts once the autopilot has acknowledged that it has triggered. `step` is for the link's thread."""

    def __init__(self, order: Order, means: CameraServices) -> None:
        self._order = order
        self._means = means
        self._lock = threading.Lock()
        self._photos: PhotoLog[TakenPhoto] = PhotoLog()
        self._by_distance: _ByDistance | None = None
        self._due = DuePhotos(_CAMERA_ID, self.take_photo, "the autopilot has not answered the order before")

    @property
    def is_busy(self) -> bool:
        """Whether it takes pictures by distance, so that `step` is to be called."""
        return self._by_distance is not None

    @property
    @override
    def info(self) -> CameraInfo:
        is_up = self._means.why_not("take a photo") is None
        note = "MAVROS does not tell what others order of it"
        return CameraInfo(_CAMERA_ID, NAME, frozenset({CameraAbility.PHOTO}), is_up, note=note)

    @override
    def status(self) -> Future[CameraStatus]:
        by_distance = self._by_distance
        return done(
            CameraStatus(
                is_taking_photos=by_distance is not None,
                distance_m=None if by_distance is None else by_distance.distance_m,
                photos_count=self._photos.count,
                missed_count=self._due.missed_count,
            )
        )

    @override
    def photos(self, first: int) -> Sequence[TakenPhoto]:
        return self._photos.since(first)

    @override
    def take_photo(self) -> Future[TakenPhoto]:
        ordered = self._order("take a photo", START_CAPTURE, _ONE)
        return then(ordered, lambda _: self._photos.add(self._taken))

    def _taken(self, number: int) -> TakenPhoto:
        return TakenPhoto(number, self._means.utc_s(), self._means.look())

    @override
    def start_interval(self, interval_s: float, count: int) -> Future[None]:
        return futures.failed(NotSupportedError(f"camera {_CAMERA_ID} ({NAME}) takes no pictures by time"))

    @override
    def start_distance(self, distance_m: float) -> Future[None]:
        error = self._means.why_not("take photos by distance")
        if error is not None:
            return futures.failed(error)
        boots_count = self._means.look().boots_count
        with self._lock:
            self._by_distance = _ByDistance(distance_m, DistanceTrigger(distance_m), boots_count)
        return done(None)

    @override
    def stop_photos(self) -> Future[None]:
        with self._lock:
            self._by_distance = None
        return done(None)

    def step(self, snapshot: Snapshot) -> None:
        """Takes the picture that is due. Waits for nothing."""
        pose = snapshot.motion.pose
        with self._lock:
            by_distance = self._by_distance
            if by_distance is None or pose is None:
                return
            if snapshot.link.boots_count != by_distance.boots_count:
                _log.warning("camera %d takes no more pictures by distance: the autopilot has booted", _CAMERA_ID)
                self._by_distance = None
                return
            due_count = by_distance.trigger.due_count(pose.value.position)
        self._due.take(due_count)


class MavrosCameras(CameraDrivers):
    """The cameras of one backend: none, or that of the autopilot. `tick` and `trigger` are for the link's thread."""

    def __init__(self, means: CameraServices, *, is_there: bool) -> None:
        self._means = means
        self._is_there = is_there
        self.trigger = TriggeredPhotos()
        self.trigger.look, self.trigger.utc_s = means.look, means.utc_s
        is_up = self._is_up
        self._reported = TriggerCamera(_CAMERA_ID, lambda: self.trigger, self._order, means.post, means.give, is_up)
        self._acknowledged = AcknowledgedCamera(self._order, means)
        self._boots_count = 0

    @override
    def all(self) -> Sequence[CameraDriver]:
        if not self._is_there:
            return []
        return [self._reported if self._means.tells_photos() else self._acknowledged]

    def tick(self, now_s: float) -> None:
        """Ends what has waited too long, and takes what is due; to be called often."""
        if not self._is_there:
            return
        boots_count = self._means.boots_count()
        if boots_count != self._boots_count:  # its numbers begin again, and it triggers by distance no more
            self._boots_count = boots_count
            self.trigger.drop(LinkLostError("the autopilot's camera was given up: the autopilot has booted"))
        self.trigger.tick(now_s)
        if self._acknowledged.is_busy:
            self._acknowledged.step(self._means.snapshot())

    def _is_up(self) -> bool:
        return self._means.why_not("take a photo") is None

    def _order(self, what: str, command_id: int, params: tuple[float, ...]) -> Future[None]:
        return self._means.order(PayloadOrder(what, command_id, params, f"camera {command_id}"))
