"""The cameras of a light UAV: pictures of a simulated world, and everything else that a camera says of itself."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import NamedTuple, TypeVar

from typing_extensions import override

from ual.cameras import (
    CameraAbility,
    CameraInfo,
    CameraIntrinsics,
    CameraMode,
    CameraStatus,
    CameraStorage,
    ImageFormat,
    ImageKind,
    StorageState,
)
from ual.errors import LinkLostError, RejectedByAutopilotError, ResourceExhaustedError, UalError
from ual.geometry import Pose, Quaternion, Vector3
from ual_daemon._version import __version__
from ual_daemon.backends import futures
from ual_daemon.backends.chain import then
from ual_daemon.backends.engine.distance_trigger import DistanceTrigger
from ual_daemon.backends.engine.photo_log import PhotoLog
from ual_daemon.backends.light.gimbal import GimbalMoment, LightGimbal
from ual_daemon.backends.light.painter import Painter
from ual_daemon.backends.light.scene import Marker, PaintedScene, PaintOrder
from ual_daemon.backends.light.settings import LightCameraSettings
from ual_daemon.backends.offers.cameras import (
    CameraDriver,
    CameraDrivers,
    EncodedImage,
    TakenPhoto,
    Viewpoint,
    mounted,
)
from ual_daemon.backends.values import Snapshot

T = TypeVar("T")

MOST_WAITING_PICTURES = 8
"""Pictures that may wait to be painted, of all cameras of a UAV."""
PHOTO_MIB = 1.0
"""Storage in MiB that a picture takes, ..."""
VIDEO_MIB_S = 2.0
"""... and a second of video."""
LARGEST_ZOOM_FACTOR = 4.0
_SEED_DISTANCE, _MOST_CAMERAS = 1 << 40, 1 << 8
"""Larger than the number of steps in any world, and of cameras: no two pictures have the same noise."""
_ABILITIES = frozenset(CameraAbility) - {CameraAbility.FOCUS, CameraAbility.STREAMS}

_log = logging.getLogger(__name__)


class CameraMoment(NamedTuple):
    """State at a moment: the real pose of the body, the height of the ground, and the autopilot's snapshot."""

    body: Pose
    ground_z_m: float
    snapshot: Snapshot
    step: int
    is_link_lost: bool

    @property
    def moment(self) -> GimbalMoment:
        """Input of its gimbals at that moment."""
        return GimbalMoment(self.snapshot.time_s, self.body.yaw_rad, self.is_link_lost)


class _PaintedShot(NamedTuple):
    """A picture that can be painted: now, or later."""

    seen: CameraMoment
    intrinsics: CameraIntrinsics
    taken: TakenPhoto


class LightCamera(CameraDriver):
    """One camera. `look` returns what is so now; `paint` has a picture painted, as PNG.

    With `carrier` it is mounted on what that returns the pose of in the body, at a moment.
    """

    def __init__(
        self,
        number: int,
        settings: LightCameraSettings,
        seed: int,
        look: Callable[[], CameraMoment],
        paint: Callable[[PaintOrder], Future[bytes]],
        carrier: Callable[[CameraMoment], Pose] | None = None,
    ) -> None:
        self._number = number
        self._settings = settings
        self._carrier = carrier
        self._seed = seed
        self._observe = look
        self._paint = paint
        self._mounting = _mounting(settings)
        self._lock = threading.Lock()
        self._shots: PhotoLog[_PaintedShot] = PhotoLog()
        self._missed_count = 0
        self._used_mib = 0.0
        self._mode = CameraMode.PHOTO
        self._zoom_percent = 0.0
        self._video_since_s: float | None = None
        self._interval_s: float | None = None
        self._next_s = math.inf
        self._left_count = 0
        self._by_distance: tuple[float, DistanceTrigger] | None = None

    @property
    @override
    def info(self) -> CameraInfo:
        settings = self._settings
        return CameraInfo(
            self._number,
            settings.name,
            _ABILITIES,
            not self._observe().is_link_lost,
            __version__,
            settings.width_px,
            settings.height_px,
            self._intrinsics(0.0),
            image_kinds=frozenset(ImageKind),
        )

    @property
    def is_busy(self) -> bool:
        """Whether `step` is to be called after each step of the world."""
        return self._interval_s is not None or self._by_distance is not None

    def step(self, seen: CameraMoment) -> None:
        """Takes the pictures that are due."""
        with self._lock:
            self._take_due(seen)

    def _take_due(self, seen: CameraMoment) -> None:
        now_s = seen.snapshot.time_s
        while self._interval_s is not None and now_s >= self._next_s:
            self._next_s += self._interval_s
            self._shoot_or_miss(seen)
            self._left_count -= 1
            if not self._left_count:
                self._interval_s = None
        pose = seen.snapshot.motion.pose
        if self._by_distance is not None and pose is not None:
            due_count = self._by_distance[1].due_count(pose.value.position)
            if due_count:
                self._shoot_or_miss(seen)
                self._missed_count += due_count - 1

    # --- Requests -----------------------------------------------------------------------------------------------------

    @override
    def status(self) -> Future[CameraStatus]:
        def answer(seen: CameraMoment) -> CameraStatus:
            recording_s = 0.0 if self._video_since_s is None else seen.snapshot.time_s - self._video_since_s
            free_mib = self._free_mib(seen)
            state = StorageState.FULL if free_mib < PHOTO_MIB else StorageState.READY
            return CameraStatus(
                mode=self._mode,
                is_taking_photos=self.is_busy,
                interval_s=self._interval_s,
                distance_m=None if self._by_distance is None else self._by_distance[0],
                is_recording=self._video_since_s is not None,
                recording_s=recording_s,
                photos_count=self._shots.count,
                missed_count=self._missed_count,
                storage=CameraStorage(state, self._settings.storage_mib, free_mib),
                zoom_percent=self._zoom_percent,
            )

        return self._do(answer)

    @override
    def photos(self, first: int) -> Sequence[TakenPhoto]:
        return [each.taken for each in self._shots.since(first)]

    @override
    def take_photo(self) -> Future[TakenPhoto]:
        return self._do(lambda seen: self._shoot(seen).taken)

    @override
    def start_interval(self, interval_s: float, count: int) -> Future[None]:
        def start(seen: CameraMoment) -> None:
            self._require_room(seen)
            self._by_distance = None
            self._interval_s, self._next_s, self._left_count = interval_s, seen.snapshot.time_s, count
            self._take_due(seen)

        return self._do(start)

    @override
    def start_distance(self, distance_m: float) -> Future[None]:
        def start(seen: CameraMoment) -> None:
            self._require_room(seen)
            self._interval_s = None
            self._by_distance = (distance_m, DistanceTrigger(distance_m))
            self._take_due(seen)

        return self._do(start)

    @override
    def stop_photos(self) -> Future[None]:
        def stop(_: CameraMoment) -> None:
            self._interval_s = self._by_distance = None

        return self._do(stop)

    @override
    def start_video(self) -> Future[None]:
        def start(seen: CameraMoment) -> None:
            self._require_room(seen)
            if self._video_since_s is None:
                self._video_since_s = seen.snapshot.time_s

        return self._do(start)

    @override
    def stop_video(self) -> Future[None]:
        def stop(seen: CameraMoment) -> None:
            self._used_mib = self._settings.storage_mib - self._free_mib(seen)
            self._video_since_s = None

        return self._do(stop)

    @override
    def set_mode(self, mode: CameraMode) -> Future[None]:
        def set_(_: CameraMoment) -> None:
            self._mode = mode

        return self._do(set_)

    @override
    def set_zoom(self, percent: float) -> Future[None]:
        def set_(_: CameraMoment) -> None:
            self._zoom_percent = percent

        return self._do(set_)

    @override
    def image(self, photo: int | None, kind: ImageKind = ImageKind.COLOUR) -> Future[EncodedImage]:
        def shot(seen: CameraMoment) -> _PaintedShot:
            return self._shot(seen, 0) if photo is None else self._shots.get(photo)

        found = self._do(shot)
        error = found.exception(0)
        if error is not None:
            return futures.failed(error)
        chosen = found.result(0)
        return then(self._paint(self._order(chosen, kind)), lambda data: _encoded(chosen, kind, data))

    # --- How it is done -----------------------------------------------------------------------------------------------

    def _do(self, act: Callable[[CameraMoment], T]) -> Future[T]:
        """Does something at once, unless the link is lost. Returns its result or its error."""
        future: Future[T] = Future()
        seen = self._observe()
        try:
            if seen.is_link_lost:
                raise LinkLostError(f"camera {self._number} is not heard (simulated)")
            with self._lock:
                future.set_result(act(seen))
        except UalError as error:
            future.set_exception(error)
        return future

    def _shoot_or_miss(self, seen: CameraMoment) -> None:
        try:
            self._shoot(seen)
        except RejectedByAutopilotError as error:
            if not self._missed_count:
                _log.warning("camera %d misses pictures: %s", self._number, error)
            self._missed_count += 1

    def _shoot(self, seen: CameraMoment) -> _PaintedShot:
        self._require_room(seen)
        self._used_mib += PHOTO_MIB
        return self._shots.add(lambda number: self._shot(seen, number))

    def _require_room(self, seen: CameraMoment) -> None:
        if self._free_mib(seen) < PHOTO_MIB:
            raise RejectedByAutopilotError(
                f"camera {self._number} refused: its storage is full", {"text": "storage is full"}
            )

    def _free_mib(self, seen: CameraMoment) -> float:
        recorded_s = 0.0 if self._video_since_s is None else seen.snapshot.time_s - self._video_since_s
        return max(0.0, self._settings.storage_mib - self._used_mib - recorded_s * VIDEO_MIB_S)

    def _shot(self, seen: CameraMoment, number: int) -> _PaintedShot:
        snapshot = seen.snapshot
        pose = snapshot.motion.pose
        viewpoint = Viewpoint(
            None if pose is None else pose.value,
            snapshot.link.boots_count,
            self._mounting if self._carrier is None else mounted(self._carrier(seen), self._mounting),
            snapshot.position_geo(),
        )
        taken = TakenPhoto(number, snapshot.motion.stamp_s, viewpoint)
        return _PaintedShot(seen, self._intrinsics(self._zoom_percent), taken)

    def _intrinsics(self, zoom_percent: float) -> CameraIntrinsics:
        settings = self._settings
        zoom = 1.0 + (LARGEST_ZOOM_FACTOR - 1.0) * zoom_percent / 100.0
        view_rad = 2.0 * math.atan(math.tan(settings.horizontal_view_rad / 2.0) / zoom)
        return CameraIntrinsics.of_view(settings.width_px, settings.height_px, view_rad)

    def _order(self, shot: _PaintedShot, kind: ImageKind) -> PaintOrder:
        """Returns what is to be painted."""
        mounting = shot.taken.viewpoint.mounting
        assert mounting is not None
        markers = [Marker(*each.position, each.size_m, each.yaw_rad, each.cells) for each in self._settings.markers]
        seed = (self._seed * _SEED_DISTANCE + shot.seen.step) * _MOST_CAMERAS + self._number
        return PaintOrder(
            mounted(shot.seen.body, mounting),
            shot.intrinsics,
            PaintedScene(shot.seen.ground_z_m, markers),
            kind,
            self._settings.noise,
            abs(seed),
        )


class LightCameras(CameraDrivers):
    """The cameras of one UAV."""

    def __init__(
        self,
        settings: Sequence[LightCameraSettings],
        seed: int,
        look: Callable[[], CameraMoment],
        painter: Painter,
        gimbals: Sequence[LightGimbal],
    ) -> None:
        self._cameras = [
            LightCamera(number, each, seed, look, self._paint, _carrier(each, gimbals))
            for number, each in enumerate(settings)
        ]
        self._lock = threading.Lock()
        self._painter = painter
        self._waiting: set[Future[bytes]] = set()
        self._is_closed = False

    @override
    def all(self) -> Sequence[CameraDriver]:
        return self._cameras

    @property
    def is_busy(self) -> bool:
        """Whether `step` is to be called after each step of the world."""
        for each in self._cameras:  # noqa: SIM110  each step of each UAV asks, and a generator costs as much again
            if each.is_busy:
                return True
        return False

    def step(self, seen: CameraMoment) -> None:
        """Takes the pictures that are due."""
        for each in self._cameras:
            each.step(seen)

    def close(self) -> None:
        """Cancels the pictures that wait to be painted."""
        with self._lock:
            self._is_closed, waiting = True, list(self._waiting)
        for each in waiting:
            each.cancel()

    def _paint(self, order: PaintOrder) -> Future[bytes]:
        """Has a picture painted, one after the other for all UAVs, so that the flights have the other processors."""
        with self._lock:
            if len(self._waiting) >= MOST_WAITING_PICTURES:
                text = f"{MOST_WAITING_PICTURES} pictures are being painted already, which is the limit: wait for one"
                return futures.failed(ResourceExhaustedError(text, {"limit": str(MOST_WAITING_PICTURES)}))
            if self._is_closed:
                return futures.failed(UalError("this UAV is closed"))
            painted = self._painter.paint(order)
            self._waiting.add(painted)
        painted.add_done_callback(self._on_painted)
        return painted

    def _on_painted(self, painted: Future[bytes]) -> None:
        with self._lock:
            self._waiting.discard(painted)


def _encoded(shot: _PaintedShot, kind: ImageKind, data: bytes) -> EncodedImage:
    is_picture = kind in (ImageKind.COLOUR, ImageKind.SEGMENTATION)
    encoding = ImageFormat.PNG if is_picture else ImageFormat.FLOAT32
    width_px, height_px = shot.intrinsics.width_px, shot.intrinsics.height_px
    stamp_s, viewpoint = shot.taken.stamp_s, shot.taken.viewpoint
    return EncodedImage(data, encoding, width_px, height_px, stamp_s, shot.intrinsics, viewpoint, kind)


def _carrier(settings: LightCameraSettings, gimbals: Sequence[LightGimbal]) -> Callable[[CameraMoment], Pose] | None:
    if settings.gimbal is None:
        return None
    gimbal = gimbals[settings.gimbal]
    return lambda seen: gimbal.pose(seen.moment)


def _mounting(settings: LightCameraSettings) -> Pose:
    turned = Quaternion.from_euler(settings.mount_roll_rad, settings.mount_pitch_rad, settings.mount_yaw_rad)
    return Pose(Vector3(*settings.mount_position), turned)
